"""Checking, placing and joining meshes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import euler_rotation
from lightdepth.quantities import FARTHEST
from lightdepth.scene.meshes.rows import unique_rows
from lightdepth.scene.model import Mesh

Triple = tuple[float, float, float]
COARSEST_STEP = 0.002
"""Of a mesh's size: coarser steps of single precision would be seen."""
EXPANDED_AT_ONCE = 1 << 20
"""Vertices that are placed at once."""


def placement(position: Triple, rotation: Triple, scale: Triple) -> NDArray[np.float64]:
    """Matrix that scales, then turns (XYZ Euler, degrees), then moves; shape (4, 4), float64."""
    matrix = np.eye(4)
    matrix[:3, :3] = euler_rotation(rotation) * np.asarray(scale)
    matrix[:3, 3] = position
    return matrix


def face_areas(vertices: NDArray[np.floating], faces: NDArray[np.integer]) -> NDArray[np.float64]:
    """Areas of triangles, shape (m,), in the square of the vertices' unit."""
    a, b, c = (vertices[faces[:, corner]].astype(np.float64) for corner in range(3))
    return np.asarray(0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1), np.float64)


def transformed(mesh: Mesh, matrix: NDArray[np.float64]) -> Mesh:
    """The mesh under an affine map of shape (4, 4); rest positions move along, mirrored faces keep their outside.

    Positions are computed and left in double precision: coordinates in the millions lose no millimetres on their way.
    """
    linear, offset = matrix[:3, :3], matrix[:3, 3]
    mirrored = np.linalg.det(linear) < 0.0
    normals = mesh.normals
    if normals is not None:
        # The cofactor matrix: the inverse transpose up to a factor, and defined for flattened objects as well.
        cofactors = np.stack([np.cross(linear[i - 2], linear[i - 1]) for i in range(3)])
        normals = unit(normals @ (cofactors * (-1.0 if mirrored else 1.0)).T)
    return replace(
        mesh,
        vertices=mesh.vertices.astype(np.float64) @ linear.T + offset,
        faces=np.ascontiguousarray(mesh.faces[:, ::-1]) if mirrored else mesh.faces,
        normals=normals,
        rest=None if mesh.rest is None else mesh.rest.astype(np.float64) @ linear.T + offset,
    )


def bent(
    matrices: NDArray[np.float64], positions: NDArray[np.float64], normals: NDArray[np.floating] | None
) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]:
    """Positions and normals, each under an affine map of its own.

    Args:
        matrices: shape (n, 3, 4).
        positions: shape (n, 3).
        normals: shape (n, 3), if any.
    """
    linear = matrices[:, :, :3]
    moved = np.einsum("nij,nj->ni", linear, positions) + matrices[:, :, 3]
    if normals is None:
        return moved, None
    cofactors = np.stack([np.cross(linear[:, i - 2], linear[:, i - 1]) for i in range(3)], axis=1)
    turned = np.einsum("nij,nj->ni", cofactors, normals) * np.where(np.linalg.det(linear) < 0.0, -1.0, 1.0)[:, None]
    return moved, unit(turned).astype(np.float64)


def placed(mesh: Mesh, matrix: NDArray[np.float64]) -> Mesh:
    """The mesh in the world, in single precision, under an affine map of shape (4, 4).

    Raises:
        ValueError: it stands so far from the world's origin that single precision cannot hold its shape, or flat.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        exact = transformed(mesh, matrix)
        vertices = exact.vertices.astype(np.float32)
    reach, size = float(np.abs(vertices).max()), float(np.ptp(exact.vertices, axis=0).max())
    step = float(np.spacing(np.float32(reach)))
    if not np.isfinite(step) or step > COARSEST_STEP * size:
        raise ValueError(
            f"it reaches {reach:.6g} m from the world's origin, where positions have steps of {step:.2g} m, too coarse "
            f"for its size of {size:.3g} m; give it a position that brings it near the origin"
        )
    solid = face_areas(vertices, exact.faces) > 0.0
    if not solid.any():
        raise ValueError("no triangle of it has an area where it stands; mind its scale")
    return replace(
        exact,
        vertices=vertices,
        faces=exact.faces if solid.all() else exact.faces[solid],
        rest=None if exact.rest is None else exact.rest.astype(np.float32),
    )


def expanded(mesh: Mesh, places: NDArray[np.float64]) -> Mesh:
    """One mesh of a mesh at several places, in single precision.

    Args:
        mesh: without rest positions.
        places: affine maps, shape (k, 4, 4), of determinants above 0.
    """
    count, linear = len(places), places[:, :3, :3]
    vertices = np.empty((count, len(mesh.vertices), 3), np.float32)
    normals = None if mesh.normals is None else np.empty_like(vertices)
    step = max(1, EXPANDED_AT_ONCE // len(mesh.vertices))
    for start in range(0, count, step):
        part = slice(start, start + step)
        vertices[part] = np.einsum("kij,nj->kni", linear[part], mesh.vertices) + places[part, None, :3, 3]
        if normals is not None and mesh.normals is not None:
            cofactors = np.stack([np.cross(linear[part, i - 2], linear[part, i - 1]) for i in range(3)], axis=1)
            normals[part] = unit(np.einsum("kij,nj->kni", cofactors, mesh.normals))
    first = len(mesh.vertices) * np.arange(count, dtype=np.int64)[:, None, None]

    def repeated(values: NDArray[np.float32] | None) -> NDArray[np.float32] | None:
        return None if values is None else np.tile(values, (count, 1))

    return Mesh(
        vertices.reshape(-1, 3),
        (mesh.faces + first).reshape(-1, 3).astype(np.int32),
        None if normals is None else normals.reshape(-1, 3),
        repeated(mesh.texture_coordinates),
        repeated(mesh.colors),
    )


def unit(vectors: NDArray[np.floating]) -> NDArray[np.float32]:
    """Vectors of shape (n, 3) scaled to length 1; zero vectors stay."""
    lengths = np.linalg.norm(vectors.astype(np.float64), axis=-1, keepdims=True)
    return (vectors / np.where(lengths > 0.0, lengths, 1.0)).astype(np.float32)


def merged(meshes: Sequence[Mesh]) -> Mesh:
    """One mesh of several, positions, faces and rest positions only.

    Where some have rest positions, the others rest where they are.
    """
    starts = np.cumsum([0] + [len(mesh.vertices) for mesh in meshes[:-1]])
    rests = [mesh.vertices if mesh.rest is None else mesh.rest for mesh in meshes]
    return Mesh(
        vertices=np.concatenate([mesh.vertices for mesh in meshes]),
        faces=np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=True)]).astype(np.int32),
        rest=np.concatenate(rests) if any(mesh.rest is not None for mesh in meshes) else None,
    )


def checked(mesh: Mesh, keep_flat: bool = False) -> Mesh:
    """The mesh, without triangles that have no area unless they are to be kept.

    Raises:
        ValueError: vertices that are not finite or absurdly far, faces that name no vertex, or nothing left.
    """
    for name in ("vertices", "normals", "texture_coordinates", "rest"):
        values = getattr(mesh, name)
        if values is not None and (bad := ~np.isfinite(values).all(axis=1)).any():
            what = name.replace("_", " ")
            raise ValueError(f"{what}: {bad.sum()} of {len(bad)} are not finite, the first is vertex {bad.argmax()}")
        if values is not None and (far := (np.abs(values) > FARTHEST).any(axis=1)).any():
            what = name.replace("_", " ")
            raise ValueError(
                f"{what}: {far.sum()} of {len(far)} are beyond {FARTHEST:g}, the first is vertex {far.argmax()}"
            )
    for name in ("normals", "texture_coordinates", "colors", "rest"):
        values = getattr(mesh, name)
        if values is not None and len(values) != len(mesh.vertices):
            raise ValueError(f"{name.replace('_', ' ')}: there are {len(values)}, but {len(mesh.vertices)} vertices")
    if len(mesh.faces) == 0:
        raise ValueError("the mesh has no triangles")
    outside = (mesh.faces < 0) | (mesh.faces >= len(mesh.vertices))
    if outside.any():
        face = int(outside.any(axis=1).argmax())
        raise ValueError(
            f"face {face} refers to vertices {mesh.faces[face].tolist()}, but there are {len(mesh.vertices)}"
        )
    solid = face_areas(mesh.vertices, mesh.faces) > 0.0
    if not solid.any() and not keep_flat:
        raise ValueError(f"all {len(solid)} triangles are degenerate (without area)")
    if mesh.normals is not None:
        mesh = replace(mesh, normals=_complete_normals(mesh, mesh.normals))
    return mesh if solid.all() or keep_flat else replace(mesh, faces=mesh.faces[solid])


def _complete_normals(mesh: Mesh, normals: NDArray[np.float32]) -> NDArray[np.float32]:
    """Normals of unit length; where a file has zeros, the mean of the faces around the vertex."""
    found = unit(normals)
    if (missing := ~found.any(axis=1)).any():
        around = np.zeros((len(found), 3))
        a, b, c = (mesh.vertices[mesh.faces[:, corner]].astype(np.float64) for corner in range(3))
        for corner in range(3):
            np.add.at(around, mesh.faces[:, corner], np.cross(b - a, c - a))
        around[~around.any(axis=1)] = (0.0, 0.0, 1.0)  # No face is there to be shaded.
        found[missing] = unit(around)[missing]
    return found


def is_closed(mesh: Mesh) -> bool:
    """Whether the mesh encloses a volume: every edge belongs to two faces, vertices at the same place being one."""
    _, index = unique_rows(mesh.vertices)
    faces = index[mesh.faces]
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    _, counts = np.unique(edges[edges[:, 0] != edges[:, 1]], axis=0, return_counts=True)
    return bool(len(counts) > 0 and (counts == 2).all())


def face_normals(vertices: NDArray[np.float32], faces: NDArray[np.int32]) -> NDArray[np.float32]:
    """Unit normals of triangles, shape (m, 3), float32; zero for degenerate ones."""
    a, b, c = (vertices[faces[:, i]].astype(np.float64) for i in range(3))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1, keepdims=True)
    return np.divide(normal, length, out=np.zeros_like(normal), where=length > 0).astype(np.float32)
