"""Rays against plain meshes, for NumPy code: what is hit first, how far away."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from lightdepth.kernel.start import start
from lightdepth.scene.meshes.geometry import face_normals
from lightdepth.scene.model import Mesh

if TYPE_CHECKING:
    import mitsuba as mi

RAYS_AT_ONCE = 2**20


@dataclass(frozen=True)
class Hits:
    """What rays hit first.

    Attributes:
        distance: along the ray in units of its direction's length, shape (n,), float32; inf where nothing is hit.
        mesh: index of the mesh, shape (n,), int32; -1 where nothing is hit.
        face: index of the face in that mesh, shape (n,), int32; -1 where nothing is hit.
        normal: unit normal of the face as it is wound, shape (n, 3), float32, world; 0 where nothing is hit.
    """

    distance: NDArray[np.float32]
    mesh: NDArray[np.int32]
    face: NDArray[np.int32]
    normal: NDArray[np.float32]


class RayCaster:
    """Finds the first of some meshes along rays; faces are hit from both sides.

    Args:
        meshes: in world space; none at all is allowed, then nothing is ever hit.
    """

    def __init__(self, meshes: Sequence[Mesh]) -> None:
        self._face_offsets = np.cumsum([0, *(len(mesh.faces) for mesh in meshes)])
        self._scene: mi.Scene | None = None
        if self._face_offsets[-1] == 0:
            return
        vertex_offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
        vertices = np.concatenate([np.asarray(mesh.vertices, dtype=np.float32) for mesh in meshes])
        faces = np.concatenate([mesh.faces + first for mesh, first in zip(meshes, vertex_offsets, strict=False)])
        self._normals = face_normals(vertices, faces)
        start()
        from lightdepth.kernel.loading import load
        from lightdepth.kernel.shapes import mesh_shape

        mesh = mesh_shape(Mesh(vertices, faces.astype(np.int32)))
        # By default, rays that pass exactly through a vertex or an edge may slip through the mesh.
        settings = {"type": "scene", "embree_use_robust_intersections": True}
        self._scene = load({**settings, "mesh": mesh})

    def cast(self, origins: NDArray[np.floating], directions: NDArray[np.floating]) -> Hits:
        """Find what rays hit first.

        Args:
            origins: world, metres, shape (n, 3), or (3,) for all rays the same.
            directions: world, shape (n, 3); of unit length where distances are to be in metres.
        """
        count = len(directions)
        origins = np.broadcast_to(origins, (count, 3))
        distance = np.full(count, np.inf, np.float32)
        primitive = np.full(count, -1, np.int32)
        if self._scene is not None:
            for first in range(0, count, RAYS_AT_ONCE):
                part = slice(first, first + RAYS_AT_ONCE)
                distance[part], primitive[part] = _cast(self._scene, origins[part], directions[part])
        hit = primitive >= 0
        mesh, face, normal = (
            np.full(count, -1, np.int32),
            np.full(count, -1, np.int32),
            np.zeros((count, 3), np.float32),
        )
        mesh[hit] = np.searchsorted(self._face_offsets, primitive[hit], side="right") - 1
        face[hit] = primitive[hit] - self._face_offsets[mesh[hit]]
        if hit.any():
            normal[hit] = self._normals[primitive[hit]]
        return Hits(distance, mesh, face, normal)


def _cast(
    scene: mi.Scene, origins: NDArray[np.floating], directions: NDArray[np.floating]
) -> tuple[NDArray[np.float32], NDArray[np.int32]]:
    """Distances and face numbers of few enough rays, inf and -1 where nothing is hit."""
    import drjit as dr
    import mitsuba as mi

    from lightdepth.kernel.tracing import first_hit
    from lightdepth.kernel.variables import as_vectors

    ray = mi.Ray3f(
        mi.Point3f(as_vectors(origins)),
        as_vectors(directions),
    )
    found = first_hit(scene, ray, coherent=True)
    valid = found.is_valid()
    face = dr.select(valid, mi.Int32(found.prim_index), -1)
    distance = dr.select(valid, found.t, dr.inf)
    dr.eval(face, distance)
    return distance.numpy(), face.numpy()
