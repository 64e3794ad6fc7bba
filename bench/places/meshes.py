"""Rectangles with rectangular holes and boxes, as triangles."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from lightdepth.scene.model import Mesh

Hole = tuple[float, float, float, float]
"""``(u0, u1, v0, v1)`` in metres along a rectangle's two edges."""


def rectangle(corner: ArrayLike, edge_u: ArrayLike, edge_v: ArrayLike, holes: Sequence[Hole] = ()) -> Mesh:
    """A rectangle with rectangular holes, cut along every hole's edges so that no vertex lies inside another's edge.

    Args:
        corner: one corner, world, metres, shape (3,).
        edge_u: from the corner along one side, metres, shape (3,).
        edge_v: from the corner along the other side; the front side is where ``edge_u x edge_v`` points.
        holes: what is cut out.

    Returns:
        The triangles of all cells that no hole covers; their texture coordinates go from 0 to 1 along the edges.
    """
    corner, edge_u, edge_v = (np.asarray(vector, dtype=np.float64) for vector in (corner, edge_u, edge_v))
    length_u, length_v = np.linalg.norm(edge_u), np.linalg.norm(edge_v)
    us = np.unique([0.0, length_u, *(value for hole in holes for value in hole[:2])])
    vs = np.unique([0.0, length_v, *(value for hole in holes for value in hole[2:])])
    coordinates = np.array([(u / length_u, v / length_v) for v in vs for u in us])
    faces = []
    for row in range(len(vs) - 1):
        for column in range(len(us) - 1):
            u, v = 0.5 * (us[column] + us[column + 1]), 0.5 * (vs[row] + vs[row + 1])
            if any(u0 < u < u1 and v0 < v < v1 for u0, u1, v0, v1 in holes):
                continue
            a, b = row * len(us) + column, (row + 1) * len(us) + column
            faces += [(a, a + 1, b + 1), (a, b + 1, b)]
    vertices = corner + coordinates[:, :1] * edge_u + coordinates[:, 1:] * edge_v
    return Mesh(
        vertices.astype(np.float32), np.asarray(faces, np.int32), texture_coordinates=coordinates.astype(np.float32)
    )


def box(low: ArrayLike, high: ArrayLike, sides: str = "-x+x-y+y-z+z") -> Mesh:
    """An axis-aligned box seen from outside.

    Args:
        low: smallest corner, world, metres, shape (3,).
        high: largest corner.
        sides: which of its faces are there, each as sign and axis.
    """
    (x0, y0, z0), (x1, y1, z1) = low, high
    dx, dy, dz = (x1 - x0, 0, 0), (0, y1 - y0, 0), (0, 0, z1 - z0)
    faces = {
        "-x": ((x0, y0, z0), dz, dy),
        "+x": ((x1, y0, z0), dy, dz),
        "-y": ((x0, y0, z0), dx, dz),
        "+y": ((x0, y1, z0), dz, dx),
        "-z": ((x0, y0, z0), dy, dx),
        "+z": ((x0, y0, z1), dx, dy),
    }
    return join([rectangle(*faces[sides[i : i + 2]]) for i in range(0, len(sides), 2)])


def join(meshes: Sequence[Mesh]) -> Mesh:
    """Several rectangles as one mesh, flat-shaded; their textures stand side by side, vertices are not merged."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    coordinates = [
        (mesh.texture_coordinates + np.array([tile, 0.0])) / (len(meshes), 1.0)
        for tile, mesh in enumerate(meshes)
        if mesh.texture_coordinates is not None
    ]
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts[:-1], strict=True)]).astype(np.int32),
        texture_coordinates=np.concatenate(coordinates).astype(np.float32),
    )


def turned(mesh: Mesh, degrees: float, center: ArrayLike) -> Mesh:
    """A mesh turned about the vertical axis through ``center`` (world, metres, shape (2,) or (3,))."""
    cos, sin = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    middle = np.array([*np.asarray(center, dtype=np.float64)[:2], 0.0])
    rotation = np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
    return Mesh(((mesh.vertices - middle) @ rotation.T + middle).astype(np.float32), mesh.faces)
