"""Points on surfaces, and whether the capture point sees them."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from lightdepth.checks.view import CaptureView
from lightdepth.scene.meshes.geometry import expanded
from lightdepth.scene.model import AnalyticShape, Mesh, Scene, SyntheticObject, SyntheticPart

MOST_TRIANGLES = 1_000_000
"""Of instances that are looked at."""
AROUND, FROM_POLE = 96, 48
"""Edges around a round shape, and from pole to pole of a sphere."""


def surface_points(
    vertices: NDArray[np.float32], faces: NDArray[np.int32], count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Points distributed evenly over a mesh's area, the same ones each time.

    Returns:
        ``(points, normals)``, each of shape (count, 3), normals unit and as the faces are wound; of shape (0, 3) for a
        mesh without area.
    """
    corners = np.asarray(vertices, dtype=np.float64)[faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice_area = np.linalg.norm(cross, axis=1)
    if not twice_area.any():
        return np.zeros((0, 3)), np.zeros((0, 3))
    generator = np.random.default_rng(0)
    steps = (np.arange(count) + generator.random(count)) / count
    chosen = np.searchsorted(np.cumsum(twice_area) / twice_area.sum(), steps).clip(max=len(faces) - 1)
    u, v = generator.random((2, count, 1))
    u, v = np.where(u + v > 1.0, 1.0 - u, u), np.where(u + v > 1.0, 1.0 - v, v)
    a, b, c = np.moveaxis(corners[chosen], 1, 0)
    return a + u * (b - a) + v * (c - a), cross[chosen] / np.maximum(twice_area[chosen], 1e-300)[:, None]


def unseen(points: NDArray[np.floating], view: CaptureView) -> NDArray[np.bool_]:
    """Whether points of shape (n, 3) are occluded from the capture point by real surfaces."""
    towards = points - view.position
    distance = np.maximum(np.linalg.norm(towards, axis=1), 1e-9)
    hits = view.caster.cast(view.position, towards / distance[:, None])
    return np.asarray(hits.distance < distance * (1.0 - view.tuned.seen_depth) - view.tuned.seen_distance)


def unseen_share(mesh: Mesh, views: Sequence[CaptureView]) -> float:
    """Share of a surface's area that none of the capture points sees, where it was photographed; in [0, 1]."""
    count = views[0].tuned.surface_points
    points, _ = surface_points(mesh.vertices if mesh.rest is None else mesh.rest, mesh.faces, count)
    return float(np.mean(np.all([unseen(points, view) for view in views], axis=0)))


def unseen_shares(scene: Scene, views: Sequence[CaptureView]) -> dict[str, float]:
    """The same of every real surface, by its name."""
    return {surface.name: unseen_share(surface.mesh, views) for surface in scene.real}


def object_mesh(thing: SyntheticObject) -> Mesh:
    """All parts of an object as one mesh in world space; analytic shapes become fine meshes.

    Of very many instances, some.
    """
    meshes = [_placed_mesh(part) for part in thing.parts]
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]).astype(np.float32),
        np.concatenate([mesh.faces + first for mesh, first in zip(meshes, offsets, strict=False)]).astype(np.int32),
    )


def _placed_mesh(part: SyntheticPart) -> Mesh:
    if not isinstance(part.geometry, Mesh):
        return _mesh_of(part.geometry)
    if part.places is None:
        return part.geometry
    step = -(-len(part.geometry.faces) * len(part.places) // MOST_TRIANGLES)
    return expanded(part.geometry, part.places[::step])


def _mesh_of(shape: AnalyticShape) -> Mesh:
    """A shape in its place."""
    vertices, faces = _unit_mesh(shape.kind)
    placed = vertices @ shape.to_world[:3, :3].T + shape.to_world[:3, 3]
    mirrored = np.linalg.det(shape.to_world[:3, :3]) < 0.0
    return Mesh(placed.astype(np.float32), faces[:, ::-1] if mirrored else faces)


@cache
def _unit_mesh(kind: str) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Vertices and faces of a shape of unit size as in Mitsuba: from -1 to 1, the cylinder open and from z = 0 to 1."""
    angle = 2.0 * np.pi * np.arange(AROUND) / AROUND
    rim = np.stack([np.cos(angle), np.sin(angle), np.zeros(AROUND)], axis=1)
    pole = np.array([[0.0, 0.0, 1.0]])
    here, after = np.arange(AROUND), np.roll(np.arange(AROUND), -1)
    match kind:
        case "sphere":
            polar = np.pi * np.arange(1, FROM_POLE) / FROM_POLE
            rings = np.sin(polar)[:, None, None] * rim + np.cos(polar)[:, None, None] * pole
            vertices = np.concatenate([rings.reshape(-1, 3), pole, -pole])
            north, south, last = len(vertices) - 2, len(vertices) - 1, AROUND * (FROM_POLE - 2)
            lower = np.concatenate([_band(here, after) + AROUND * ring for ring in range(FROM_POLE - 2)])
            cap = np.stack([here, after, np.full(AROUND, north)], axis=1)
            base = np.stack([after + last, here + last, np.full(AROUND, south)], axis=1)
            faces = np.concatenate([lower[:, ::-1], cap, base])
        case "cube":
            vertices = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3, indexing="ij")).reshape(3, 8).T
            quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
            faces = np.concatenate([quads[:, :3], quads[:, [0, 2, 3]]])
        case "cylinder":
            vertices = np.concatenate([rim, rim + pole])
            faces = _band(here, after)
        case "disk":
            vertices = np.concatenate([rim, np.zeros((1, 3))])
            faces = np.stack([np.full(AROUND, AROUND), here, after], axis=1)
        case _:
            vertices = np.array([[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]])
            faces = np.array([[0, 1, 2], [0, 2, 3]])
    return vertices, faces.astype(np.int32)


def _band(here: NDArray[np.integer], after: NDArray[np.integer]) -> NDArray[np.integer]:
    """Triangles between two rings of vertices, the second one above the first, seen from outside; shape (n, 3)."""
    above = len(here)
    return np.concatenate(
        [np.stack([here, after, after + above], axis=1), np.stack([here, after + above, here + above], axis=1)]
    )
