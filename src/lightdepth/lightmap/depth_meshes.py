"""Real surfaces from the depth images of several panoramas: what each of them sees, once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import direction_to_latlong
from lightdepth.lightmap.depth_mesh import mesh_from_depth
from lightdepth.parameters.place import DEFAULT, PlaceParameters
from lightdepth.scene.meshes.geometry import face_normals
from lightdepth.scene.model import Mesh, Panorama


def meshes_from_depth(panoramas: Sequence[Panorama], tuned: PlaceParameters = DEFAULT) -> list[Mesh]:
    """A mesh for each panorama with depth; later ones without the faces that an earlier one sees.

    Two measurements of a surface would lie one before the other, and the one behind would be in the dark.

    Args:
        panoramas: some of them with depth.
        tuned: what is one surface.
    """
    measured = [panorama for panorama in panoramas if panorama.depth is not None]
    meshes = []
    for index, panorama in enumerate(measured):
        assert panorama.depth is not None
        mesh = mesh_from_depth(panorama.depth, panorama.position, panorama.rotation, tuned=tuned)
        centres = mesh.vertices[mesh.faces].mean(axis=1, dtype=np.float64)
        known = np.zeros(len(mesh.faces), bool)
        for earlier in measured[:index]:
            known |= _shown(centres, face_normals(mesh.vertices, mesh.faces), earlier, tuned)
        faces = mesh.faces[~known]
        used, renumbered = np.unique(faces, return_inverse=True)
        meshes.append(Mesh(mesh.vertices[used], renumbered.reshape(-1, 3).astype(np.int32)))
    return [mesh for mesh in meshes if len(mesh.faces)]


def _shown(
    points: NDArray[np.float64], normals: NDArray[np.float32], panorama: Panorama, tuned: PlaceParameters
) -> NDArray[np.bool_]:
    """Which points the depth image of a panorama shows from the side of their normals, shape (n,)."""
    assert panorama.depth is not None
    offset = points - panorama.position
    distance = np.linalg.norm(offset, axis=1)
    u, v = direction_to_latlong(offset @ panorama.rotation)
    height, width = panorama.depth.shape
    row = np.clip((v * height).astype(int), 0, height - 1)
    column = np.clip((u * width).astype(int), 0, width - 1)
    depth = panorama.depth[row, column]
    cosine = -np.einsum("ij,ij->i", normals, offset) / np.maximum(distance, 1e-12)
    tolerance = tuned.depth_same + np.pi / height / np.maximum(cosine, tuned.grazing)
    near = np.abs(distance - depth) <= tolerance * np.where(np.isfinite(depth), depth, 0.0)
    return np.asarray(near & (cosine > 0.0))
