"""STL: bare triangles, flat-shaded."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from trimesh.exchange.stl import load_stl

from lightdepth.scene.meshes.part import MeshPart
from lightdepth.scene.model import Mesh


def read_stl(path: Path, with_materials: bool) -> list[MeshPart]:
    """Read an STL file, ASCII or binary; corners at the same place become one vertex. It has no materials."""
    with path.open("rb") as file:
        content = load_stl(file)
    solids = list(content["geometry"].values()) if "geometry" in content else [content]
    return [_one_solid(solid["vertices"], solid["faces"]) for solid in solids]


def _one_solid(vertices: np.ndarray, faces: np.ndarray) -> MeshPart:
    unique, index = np.unique(np.asarray(vertices, dtype=np.float32), axis=0, return_inverse=True)
    return MeshPart(Mesh(vertices=unique, faces=index.reshape(-1)[np.asarray(faces)].astype(np.int32)))
