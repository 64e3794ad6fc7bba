"""Wavefront OBJ, with the materials of its .mtl file carried over roughly."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from trimesh.exchange.obj import load_obj
from trimesh.resolvers import FilePathResolver

from lightdepth.scene.materials import Principled
from lightdepth.scene.materials.image import Content, texture_of
from lightdepth.scene.meshes.part import MeshPart
from lightdepth.scene.model import Mesh


def read_obj(path: Path, with_materials: bool) -> list[MeshPart]:
    """Read an OBJ file: one part for each material.

    Raises:
        ValueError: the file names a material file that is not there.
    """
    text = path.read_text(encoding="utf-8", errors="replace")
    if with_materials:
        for line in text.splitlines():
            if line.startswith("mtllib ") and not (path.parent / line[7:].strip()).is_file():
                raise ValueError(f"its material file {path.parent / line[7:].strip()} does not exist")
    with path.open("rb") as file:
        content = load_obj(file, resolver=FilePathResolver(path), skip_materials=not with_materials)
    solids = list(content["geometry"].values()) if "geometry" in content else [content]
    return [_one_solid(solid) for solid in solids if len(solid.get("faces", ()))]


def _one_solid(solid: dict[str, Any]) -> MeshPart:
    visual = solid.get("visual")
    uv = getattr(visual, "uv", None)
    normals = solid.get("vertex_normals")
    mesh = Mesh(
        vertices=np.asarray(solid["vertices"], dtype=np.float32),
        faces=np.asarray(solid["faces"], dtype=np.int32),
        normals=None if normals is None else np.asarray(normals, dtype=np.float32),
        texture_coordinates=None if uv is None else np.asarray(uv, dtype=np.float32),
    )
    material = getattr(visual, "material", None)
    statements = dict(getattr(material, "kwargs", {}))
    image = getattr(material, "image", None)
    if not statements and image is None:
        return MeshPart(mesh)
    return MeshPart(mesh, _material(statements, image, uv is not None))


def _material(statements: dict[str, Any], image: Any, has_texture_coordinates: bool) -> Principled:
    """The principled material nearest to the statements of an .mtl file.

    Phong's exponent ``Ns`` becomes roughness by the usual match of lobes, ``alpha^2 = 2 / (Ns + 2)``; the extension
    ``Pr`` and ``Pm`` say roughness and metalness themselves.
    """

    def numbers(key: str, default: list[float]) -> list[float]:
        try:
            return [float(v) for v in np.atleast_1d(statements[key])]
        except (KeyError, ValueError):
            return default

    base = numbers("kd", [0.8, 0.8, 0.8])
    shininess = max(numbers("ns", [0.0])[0], 0.0)
    roughness = numbers("pr", [float((2.0 / (shininess + 2.0)) ** 0.25)])[0]
    opacity = numbers("d", [1.0 - numbers("tr", [0.0])[0]])[0]
    specular = numbers("ks", [0.5, 0.5, 0.5])
    base_color: Any = tuple(np.clip(base, 0.0, 1.0))
    if image is not None and has_texture_coordinates:
        base_color = texture_of(np.asarray(image.convert("RGB")), Content.COLOUR)
    return Principled(
        base_color=base_color,
        metallic=float(np.clip(numbers("pm", [0.0])[0], 0.0, 1.0)),
        roughness=float(np.clip(roughness, 0.0, 1.0)),
        specular=float(np.clip(np.mean(specular), 0.0, 1.0)),
        emission=tuple(np.maximum(numbers("ke", [0.0, 0.0, 0.0]), 0.0)),
        opacity=float(np.clip(opacity, 0.0, 1.0)),
    )
