"""The real surfaces of a scene as one mesh: what is traced, and the values of each of its faces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from lightdepth.scene.model import Gloss, Mesh, RealSurface, Role


class FaceKind(IntEnum):
    """How a real face takes part in the transport."""

    ENVIRONMENT = 0
    SUPPORT = 1
    RELIT = 2  # Support with rest positions: scatters all light by its recovered albedo (paper, section 5.8).
    OPENING = 3  # Environment through which declared suns shine in.
    REMOVED = 4  # What leaves the picture: it is there before the change, and not afterwards.


RECEIVING = (FaceKind.SUPPORT, FaceKind.RELIT)
"""Faces that receive the influence of the new objects."""


@dataclass(frozen=True)
class RealSurfaces:
    """All real surfaces, merged. World space, metres.

    Attributes:
        vertices: shape (n, 3), float32.
        faces: shape (m, 3), int32.
        kind: :class:`FaceKind` of each face, shape (m,), uint32.
        gloss: 0 for none, else 1 + index into ``glosses``, shape (m,), uint32.
        glosses: the specular lobes that occur.
        rest: where each vertex takes its colour from, shape (n, 3), float32; ``vertices`` where nothing is deformed.
        divisions: into how many parts the grid of each face's nodes divides its edges, shape (m,), uint32.
        first_node: where the nodes of each face begin, shape (m,), uint32; several faces may share theirs. They come in
            rows along the edge from the first to the second vertex, the rows one after the other toward the third.
        irradiance: E at each node, linear RGB, shape (k, 3), float32; zero where it was not recovered.
        unseen_albedo: of the unseen part of each face, occluded from the capture point, linear RGB, shape (m, 3),
            float32; zero where it was not recovered.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.int32]
    kind: NDArray[np.uint32]
    gloss: NDArray[np.uint32]
    glosses: tuple[Gloss, ...]
    rest: NDArray[np.float32]
    divisions: NDArray[np.uint32]
    first_node: NDArray[np.uint32]
    irradiance: NDArray[np.float32]
    unseen_albedo: NDArray[np.float32]

    @property
    def receiving(self) -> NDArray[np.bool_]:
        """Which faces receive the influence of the new objects, shape (m,)."""
        return np.isin(self.kind, RECEIVING)

    @property
    def scattering(self) -> NDArray[np.bool_]:
        """Which faces send on light of the new objects, shape (m,): those that receive, and environment with gloss."""
        return self.receiving | ((self.kind == FaceKind.ENVIRONMENT) & (self.gloss > 0))

    @property
    def deformed(self) -> bool:
        """Whether any vertex takes its colour from elsewhere."""
        return bool(np.any(self.rest != self.vertices))

    def mesh(self) -> Mesh:
        """The geometry alone."""
        return Mesh(self.vertices, self.faces)


def merge_real_surfaces(surfaces: Sequence[RealSurface]) -> RealSurfaces:
    """Merge real surfaces into one; each face keeps its role and gloss, each vertex its rest position."""
    glosses: list[Gloss] = []
    vertices, faces, kinds, gloss_indices, rests = [], [], [], [], []
    offset = 0
    for surface in surfaces:
        mesh = surface.mesh
        index = 0
        if surface.gloss is not None:
            if surface.gloss not in glosses:
                glosses.append(surface.gloss)
            index = 1 + glosses.index(surface.gloss)
        kind = FaceKind.OPENING if surface.opening else FaceKind.ENVIRONMENT
        if surface.role == Role.SUPPORT:
            kind = FaceKind.SUPPORT if mesh.rest is None else FaceKind.RELIT
        if surface.removed:
            kind = FaceKind.REMOVED
        vertices.append(mesh.vertices)
        faces.append(mesh.faces + offset)
        kinds.append(np.full(len(mesh.faces), kind, np.uint32))
        gloss_indices.append(np.full(len(mesh.faces), index, np.uint32))
        rests.append(mesh.vertices if mesh.rest is None else mesh.rest)
        offset += len(mesh.vertices)
    if not surfaces:
        empty = np.zeros((0, 3), np.float32)
        no_faces = np.zeros(0, np.uint32)
        return RealSurfaces(
            empty, np.zeros((0, 3), np.int32), no_faces, no_faces, (), empty, no_faces, no_faces, empty, empty
        )
    merged = np.concatenate(vertices).astype(np.float32)
    kind_of_faces = np.concatenate(kinds)
    no_values = np.zeros((3, 3), np.float32)
    return RealSurfaces(
        merged,
        np.concatenate(faces).astype(np.int32),
        kind_of_faces,
        np.concatenate(gloss_indices),
        tuple(glosses),
        np.concatenate(rests).astype(np.float32),
        np.ones_like(kind_of_faces),
        np.zeros_like(kind_of_faces),
        no_values,
        np.zeros((len(kind_of_faces), 3), np.float32),
    )
