"""Fewer triangles: what is flat needs few.

Garland and Heckbert, Surface Simplification Using Quadric Error Metrics, 1997.
"""

from __future__ import annotations

import meshoptimizer
import numpy as np

from lightdepth.parameters.reconstruction import DEFAULT
from lightdepth.scene.model import Mesh


def simplified(mesh: Mesh, most_faces: int, error: float = DEFAULT.depth.unseen_error) -> Mesh:
    """Take out vertices while the surface moves by less than an error, then as many as are too many.

    Args:
        mesh: world, metres; vertices that are at the same place are one vertex.
        most_faces: that are left.
        error: distance by which the surface may move in any case, metres.

    Returns:
        A mesh of some of the vertices, which stay where they are: what lies in a plane still does.
    """
    faces = _collapsed(mesh.vertices, mesh.faces, 0, error)
    if len(faces) > most_faces:
        faces = _collapsed(mesh.vertices, faces, most_faces, np.inf)
    used, compact = np.unique(faces, return_inverse=True)
    return Mesh(mesh.vertices[used], compact.reshape(-1, 3).astype(np.int32))


def _collapsed(vertices: np.ndarray, faces: np.ndarray, most_faces: int, error: float) -> np.ndarray:
    if len(faces) <= most_faces or len(faces) == 0:
        return faces
    source = np.ascontiguousarray(faces, dtype=np.uint32).reshape(-1)
    target = np.zeros_like(source)
    count = meshoptimizer.simplify(
        target,
        source,
        np.ascontiguousarray(vertices, dtype=np.float32),
        target_index_count=3 * most_faces,
        target_error=float(min(error, 1e6)),
        options=meshoptimizer.SIMPLIFY_ERROR_ABSOLUTE,
    )
    return target[:count].reshape(-1, 3)
