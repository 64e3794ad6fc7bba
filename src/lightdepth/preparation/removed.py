"""What is removed from the picture, as a shape that lets all light pass: where paths meet it, they know that it is gone.

Theory, section 11.
"""

from __future__ import annotations

from collections.abc import Sequence

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.kernel.loading import load
from lightdepth.kernel.shapes import mesh_shape
from lightdepth.parameters.place import PlaceParameters
from lightdepth.place.object_bounds import Sphere
from lightdepth.scene.meshes.geometry import face_normals, merged
from lightdepth.scene.model import Mesh, Panorama, Scene


def removed_shape(scene: Scene) -> tuple[mi.Shape | None, list[Sphere]]:
    """The removed surfaces of a scene, within others that are a little larger: pixels at their edges show some of them.

    The larger ones may reach through walls, behind which no path from within them would arrive: the others are met in any
    case.

    Returns:
        The shape, ``None`` where nothing is removed, and a sphere around each surface.
    """
    removed = [surface.mesh for surface in scene.real if surface.removed]
    if not removed:
        return None, []
    tuned = scene.render.parameters.place
    larger, spheres = [_larger(mesh, scene.panoramas, tuned) for mesh in removed], []
    for mesh in larger:
        centre = 0.5 * (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)).astype(np.float64)
        spheres.append((centre, float(np.linalg.norm(mesh.vertices - centre, axis=1).max())))
    return mesh_shape(merged([*removed, *larger]), load({"type": "null"})), spheres


def _larger(mesh: Mesh, panoramas: Sequence[Panorama], tuned: PlaceParameters) -> Mesh:
    """A mesh whose vertices are moved outward by the panoramas' pixels that show its edge."""
    corners, index = np.unique(mesh.vertices, axis=0, return_inverse=True)
    faces = index.reshape(-1)[mesh.faces]
    first, second, third = np.moveaxis(corners[faces].astype(np.float64), 1, 0)
    inside_out = np.einsum("ij,ij->", first - corners.mean(axis=0), np.cross(second - first, third - first)) < 0.0
    normals = face_normals(corners, faces) * (-1.0 if inside_out else 1.0)
    outward, slants, counts = np.zeros(corners.shape), np.zeros(len(corners)), np.zeros(len(corners))
    for corner in faces.T:
        np.add.at(outward, corner, normals)
    outward /= np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-9)
    for corner in faces.T:
        np.add.at(slants, corner, np.einsum("ij,ij->i", outward[corner], normals))
        np.add.at(counts, corner, 1.0)
    # So far that the faces, and not the edges between them, are moved by the rim.
    length = _rim(corners, panoramas, tuned) / np.maximum(slants / np.maximum(counts, 1.0), tuned.removed_slant)
    return Mesh((corners + length[:, None] * outward).astype(np.float32), faces.astype(np.int32))


def _rim(points: NDArray[np.floating], panoramas: Sequence[Panorama], tuned: PlaceParameters) -> NDArray[np.float64]:
    """Metres that the rim of pixels around what is removed covers at points, in the panorama that shows most of it."""
    rims = [
        (tuned.removed_rim + 0.5) * np.pi / len(each.radiance) * np.linalg.norm(points - each.position, axis=1)
        for each in panoramas
    ]
    return np.asarray(np.max(rims, axis=0), np.float64)
