"""Places where one mesh with the same materials stands, gathered, and what follows from many matrices at once."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from . import materials, meshes
from .meshfolder import digest_of

AT_ONCE = 1_000_000
"""Vertices that are placed at once to find where they are."""
FLAT = 1e-6
"""Volume that a matrix gives to a cube of its size, up to which what it places is flat."""


@dataclass(frozen=True)
class Source:
    """The object of Blender that one of the scene file comes from.

    Attributes:
        name: of the object.
        asset: name of the outermost of its parents, or its own.
        pass_index: of the object.
    """

    name: str
    asset: str
    pass_index: int


@dataclass
class Together:
    """Instances that are alike.

    Attributes:
        members: their indices among all that is rendered, in its order.
        places: their matrices, shape (k, 4, 4), once all are known.
    """

    members: list[int]
    places: np.ndarray = field(default_factory=lambda: np.empty((0, 4, 4)))


@dataclass
class Group:
    """Places where one mesh with the same materials stands, each as its own object or all made by one instancer.

    Attributes:
        source: what it is in Blender.
        key: of the mesh and its materials.
        instanced: whether one instancer made all.
        singles: matrices that were added one by one, shape (4, 4).
        ways: likewise, of each place while the shutter is open; ``None`` for one that stands still. Empty without motion
            blur.
        together: instances that were gathered; ``None`` where each was added by itself.
        origin: of the scene file, to which the gathered ones are not relative yet, shape (3,).
    """

    source: Source
    key: tuple
    instanced: bool
    singles: list[np.ndarray] = field(default_factory=list)
    ways: list[list[np.ndarray] | None] = field(default_factory=list)
    together: Together | None = None
    origin: np.ndarray = field(default_factory=lambda: np.zeros(3))

    def places(self) -> np.ndarray:
        """All matrices relative to the scene file's origin, shape (k, 4, 4)."""
        if self.together is None:
            return np.array(self.singles)
        places = self.together.places.copy()
        places[:, :3, 3] -= self.origin
        return places


@dataclass
class Look:
    """A mesh and the surfaces of its slots.

    Attributes:
        name: of the object.
        triangles: the mesh.
        slots: names of the slots' materials.
        surfaces: the materials.
        shapes: the mesh at the shutter's times; ``None`` where it does not deform.
    """

    name: str
    triangles: meshes.Triangles
    slots: list[str]
    surfaces: list[materials.Surface]
    shapes: list[meshes.Triangles] | None = None

    @cached_property
    def digest(self) -> bytes:
        """Of all that its file is made of."""
        return digest_of(self.triangles, self.slots, self.surfaces, self.shapes)

    def bounds(self, places: np.ndarray) -> np.ndarray:
        """Smallest and largest coordinates of its vertices at places of shape (k, 4, 4), shape (k, 2, 3)."""
        found = np.empty((len(places), 2, 3))
        step = max(AT_ONCE // max(len(self.triangles.positions), 1), 1)
        positions = self.triangles.positions.T
        for start in range(0, len(places), step):
            some = places[start : start + step]
            for axis in range(3):  # axis by axis in single precision: it goes through memory once
                along = some[:, axis, :3].astype(np.float32) @ positions
                found[start : start + step, 0, axis] = along.min(axis=1) + some[:, axis, 3]
                found[start : start + step, 1, axis] = along.max(axis=1) + some[:, axis, 3]
        return found


@dataclass(frozen=True)
class File:
    """A mesh file.

    Attributes:
        table: what an object's table says of it; nothing where there are no faces.
        materials: of its parts.
    """

    table: dict[str, Any]
    materials: tuple[str, ...]


def flat(places: np.ndarray) -> np.ndarray:
    """Which matrices flatten what they place, shape (k,)."""
    linear = places[:, :3, :3]
    return np.abs(np.linalg.det(linear)) <= FLAT * np.sqrt((linear**2).sum(axis=(1, 2))) ** 3


def have_area(places: np.ndarray) -> np.ndarray:
    """Which matrices leave an area of what they place, shape (k,)."""
    sizes = np.linalg.svd(places[:, :3, :3], compute_uv=False)
    return sizes[:, 1] > FLAT * np.maximum(sizes[:, 0], 1e-30)


def placements(places: np.ndarray) -> list[dict[str, list[float]] | None]:
    """Matrices as position, rotation (degrees) and scale, or ``None`` for one that shears or flattens.

    Args:
        places: shape (k, 4, 4).
    """
    linear = places[:, :3, :3]
    scale = np.linalg.norm(linear, axis=1)
    turn = linear / np.where(scale > 0.0, scale, 1.0)[:, None]
    mirrored = np.linalg.det(turn) < 0.0
    scale, turn = np.where(mirrored[:, None], -scale, scale), np.where(mirrored[:, None, None], -turn, turn)
    upright = np.einsum("kij,kil->kjl", turn, turn) - np.eye(3)
    possible = (np.abs(upright).max(axis=(1, 2)) < 1e-5) & (scale != 0.0).all(axis=1)
    # XYZ: turn = z(c) y(b) x(a). Where b is a right angle only a + c or a - c counts.
    level = np.hypot(turn[:, 0, 0], turn[:, 1, 0])
    locked = level < 1e-6
    a = np.where(locked, np.arctan2(-turn[:, 1, 2], turn[:, 1, 1]), np.arctan2(turn[:, 2, 1], turn[:, 2, 2]))
    c = np.where(locked, 0.0, np.arctan2(turn[:, 1, 0], turn[:, 0, 0]))
    angles = np.degrees(np.stack([a, np.arctan2(-turn[:, 2, 0], level), c], axis=1))
    return [
        {"position": position, "rotation": rotation, "scale": size} if fits else None
        for position, rotation, size, fits in zip(
            places[:, :3, 3].tolist(), angles.tolist(), scale.tolist(), possible.tolist(), strict=True
        )
    ]
