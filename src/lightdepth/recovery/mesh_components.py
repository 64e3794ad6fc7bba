"""Parts of the real surfaces made ready to carry values at their vertices, and put back."""

from __future__ import annotations

import operator
from dataclasses import replace
from functools import reduce

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from lightdepth.kernel.tracing import first_hit
from lightdepth.kernel.variables import as_point, as_vectors
from lightdepth.place.place import Place
from lightdepth.place.real_surfaces import RealSurfaces
from lightdepth.recovery.vertex_grids import Grids
from lightdepth.scene.meshes.geometry import face_areas, face_normals


def separate(surfaces: RealSurfaces, chosen: NDArray[np.bool_]) -> RealSurfaces:
    """The chosen faces alone; their corners share a vertex only where position and face normal agree."""
    faces = surfaces.faces[chosen]
    normals = face_normals(surfaces.rest, faces)
    corner = faces.reshape(-1)
    key = np.concatenate(
        [
            np.round(surfaces.vertices[corner] / 1e-5),
            np.round(surfaces.rest[corner] / 1e-5),
            np.round(np.repeat(normals, 3, axis=0) * 1e3),
        ],
        axis=1,
    ).astype(np.int64)
    _, first, inverse = np.unique(key, axis=0, return_index=True, return_inverse=True)
    kept = corner[first]
    return replace(
        surfaces,
        vertices=surfaces.vertices[kept],
        rest=surfaces.rest[kept],
        faces=inverse.reshape(-1, 3).astype(np.int32),
        kind=surfaces.kind[chosen],
        gloss=surfaces.gloss[chosen],
        divisions=surfaces.divisions[chosen],
        first_node=surfaces.first_node[chosen],
        unseen_albedo=surfaces.unseen_albedo[chosen],
    )


def wind_toward_capture(place: Place, surfaces: RealSurfaces) -> NDArray[np.int32]:
    """Wind every connected piece so that most of what the capture points see of it, where it rested, faces them.

    Pieces that touch where they are but not where they rested are apart: each may have been turned over by itself.
    """
    faces = surfaces.faces
    facing = reduce(operator.add, (_facing(place, surfaces, each.capture) for each in place.photograph.each))
    places = np.round(np.concatenate([surfaces.vertices, surfaces.rest], axis=1) / 1e-5).astype(np.int64)
    _, same_position = np.unique(places, axis=0, return_inverse=True)
    piece = connected(same_position.reshape(-1)[faces])
    flipped = np.bincount(piece, weights=facing)[piece] < 0.0
    return np.where(flipped[:, None], faces[:, ::-1], faces).astype(np.int32)


def connected(faces: NDArray[np.integer]) -> NDArray[np.int_]:
    """Which connected piece each face is of, by the vertices that faces share, shape (m,)."""
    count, ones = int(faces.max(initial=-1)) + 1, np.ones(len(faces))
    links = [coo_matrix((ones, (faces[:, 0], faces[:, k])), shape=(count, count)) for k in (1, 2)]
    _, piece_of_vertex = connected_components(links[0] + links[1], directed=False)
    return np.asarray(piece_of_vertex[faces[:, 0]])


def _facing(place: Place, surfaces: RealSurfaces, capture: NDArray[np.float64]) -> NDArray[np.float64]:
    """Area of each face, positive where it faces a capture point; next to nothing where this does not see it."""
    faces = surfaces.faces
    centre = surfaces.rest[faces].mean(axis=1)
    normal = face_normals(surfaces.rest, faces)
    offset = centre - capture.astype(np.float32)
    distance = np.linalg.norm(offset, axis=1)
    direction = as_vectors(offset / distance[:, None])
    ray = mi.Ray3f(as_point(capture), direction)
    free = first_hit(place.surfaces.real, ray).t.numpy() > 0.999 * distance
    return np.asarray(
        -np.sign((normal * offset).sum(axis=1)) * face_areas(surfaces.rest, faces) * np.where(free, 1.0, 1e-6)
    )


def with_refined(
    surfaces: RealSurfaces,
    replaced: NDArray[np.bool_],
    part: RealSurfaces,
    grids: Grids,
    irradiance: NDArray[np.float32],
) -> RealSurfaces:
    """The faces that are not ``replaced`` as they were, followed by a refined part.

    Args:
        surfaces: all of them.
        replaced: the faces that the refined part replaces, shape (m,).
        part: what was refined.
        grids: layout of the values at the vertices of the refined mesh.
        irradiance: at these vertices, shape (n, 3).
    """
    mesh = grids.mesh
    offset, nodes = len(surfaces.vertices), len(surfaces.irradiance)
    return replace(
        surfaces,
        vertices=np.concatenate([surfaces.vertices, mesh.vertices]),
        rest=np.concatenate([surfaces.rest, mesh.points]),
        divisions=np.concatenate([surfaces.divisions[~replaced], grids.divisions]),
        first_node=np.concatenate([surfaces.first_node[~replaced], grids.first_node + np.uint32(nodes)]),
        irradiance=np.concatenate([surfaces.irradiance, grids.at_nodes(irradiance)]),
        faces=np.concatenate([surfaces.faces[~replaced], mesh.faces + offset]),
        kind=np.concatenate([surfaces.kind[~replaced], part.kind[mesh.parent]]),
        gloss=np.concatenate([surfaces.gloss[~replaced], part.gloss[mesh.parent]]),
        unseen_albedo=np.concatenate([surfaces.unseen_albedo[~replaced], part.unseen_albedo[mesh.parent]]),
    )
