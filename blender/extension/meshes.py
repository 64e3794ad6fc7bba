"""Mesh files of real surfaces: PLY in the world's coordinates, with rest positions where a mesh has them."""

from pathlib import Path

import bpy
import numpy as np

from .panorama import REST
from .rest import positions_in_world


def write_real(path: Path, mesh: bpy.types.Mesh, to_world) -> None:
    """Write a mesh as binary PLY of triangles.

    Args:
        path: the file.
        mesh: the mesh, modifiers applied.
        to_world: its matrix.
    """
    mesh.calc_loop_triangles()
    columns = ["x", "y", "z"]
    vertices = positions_in_world(mesh, to_world)
    rest = mesh.attributes.get(REST)
    if rest is not None and rest.domain == "POINT" and rest.data_type == "FLOAT_VECTOR":
        positions = np.empty(3 * len(mesh.vertices), np.float32)
        rest.data.foreach_get("vector", positions)
        vertices = np.hstack([vertices, positions.reshape(-1, 3)])
        columns += [f"{REST}_{axis}" for axis in "xyz"]
    triangles = np.empty(3 * len(mesh.loop_triangles), np.int32)
    mesh.loop_triangles.foreach_get("vertices", triangles)
    triangles = triangles.reshape(-1, 3)
    if to_world.determinant() < 0.0:
        triangles = triangles[:, ::-1]
    faces = np.empty(len(triangles), np.dtype([("count", "u1"), ("corners", "<i4", 3)]))
    faces["count"], faces["corners"] = 3, triangles
    header = [
        "ply",
        "format binary_little_endian 1.0",
        f"element vertex {len(vertices)}",
        *(f"property float {name}" for name in columns),
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header\n",
    ]
    path.write_bytes("\n".join(header).encode() + vertices.astype("<f4").tobytes() + faces.tobytes())
