"""Stanford PLY: triangles and quads with normals, texture coordinates, colours and rest positions per vertex."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from trimesh.exchange.ply import load_ply
from trimesh.geometry import triangulate_quads

from lightdepth.scene.materials import Principled, VertexColors
from lightdepth.scene.materials.texture import decode_srgb
from lightdepth.scene.meshes.part import MeshPart
from lightdepth.scene.model import Mesh

TEXTURE_COORDINATE_NAMES = (("s", "t"), ("u", "v"), ("texture_u", "texture_v"))
REST_NAMES = ("rest_x", "rest_y", "rest_z")
"""Environment texture coordinates: three float properties of each vertex, in the coordinates of the file."""


def read_ply(path: Path, with_materials: bool) -> list[MeshPart]:
    """Read a PLY file, ASCII or binary. Colours are 8-bit sRGB."""
    with path.open("rb") as file:
        content = load_ply(file, fix_texture=False)
    vertex = content["metadata"]["_ply_raw"]["vertex"]["data"]
    found = [_columns(vertex, names) for names in TEXTURE_COORDINATE_NAMES]
    colors = _columns(vertex, ("red", "green", "blue")) if with_materials else None
    mesh = Mesh(
        vertices=np.asarray(content["vertices"], dtype=np.float32),
        faces=triangulate_quads(content.get("faces", np.zeros((0, 3)))).astype(np.int32),
        normals=_as_floats(_columns(vertex, ("nx", "ny", "nz"))),
        texture_coordinates=_as_floats(next((uv for uv in found if uv is not None), None)),
        colors=None if colors is None else decode_srgb(colors.astype(np.uint8)).astype(np.float32),
        rest=_as_floats(_columns(vertex, REST_NAMES)),
    )
    return [MeshPart(mesh, None if colors is None else Principled(base_color=VertexColors()))]


def _columns(vertex: Any, names: Sequence[str]) -> np.ndarray | None:
    """Properties of the vertices side by side, shape (n, len(names)), or ``None`` where the file lacks one."""
    known = vertex.keys() if isinstance(vertex, dict) else vertex.dtype.names
    if any(name not in known for name in names):
        return None
    return np.column_stack([np.asarray(vertex[name]).reshape(-1) for name in names])


def _as_floats(values: np.ndarray | None) -> np.ndarray | None:
    return None if values is None else values.astype(np.float32)
