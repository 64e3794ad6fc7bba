"""glTF 2.0, .gltf and .glb: meshes of all nodes with their materials, turned from y up to z up."""

from __future__ import annotations

import copy
import io
import json
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from trimesh.exchange.gltf import load_gltf
from trimesh.scene.transforms import SceneGraph

from lightdepth.scene.meshes.geometry import is_closed, transformed
from lightdepth.scene.meshes.gltf_file import GltfFile
from lightdepth.scene.meshes.gltf_material import GltfMaterials
from lightdepth.scene.meshes.part import MeshPart
from lightdepth.scene.model import Mesh

if TYPE_CHECKING:
    from pathlib import Path

Y_UP_TO_Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1.0, 0], [0, 1.0, 0, 0], [0, 0, 0, 1.0]])
"""(x, y, z) becomes (x, -z, y)."""
_TRIANGLES, _TRIANGLE_STRIP = 4, 5
_CUSTOM_ATTRIBUTES = ("TEXCOORD_0", "TEXCOORD_1", "COLOR_0")


def read_gltf(path: Path, with_materials: bool) -> list[MeshPart]:
    """Read a glTF file: one part for each primitive of each node that shows it.

    Skins and morph targets stay in their rest pose; points and lines are left out.

    Raises:
        InputError: the file is broken, incomplete, or needs an extension that is not supported.
    """
    file = GltfFile(path)
    primitives = _triangle_primitives(file.header)
    loaded = load_gltf(io.BytesIO(json.dumps(_for_trimesh(file.header)).encode()), _Buffers(file), skip_materials=True)
    geometry = {
        name: _Primitive(content, description, file.header)
        for (name, content), description in zip(loaded["geometry"].items(), primitives, strict=True)
    }
    graph = SceneGraph(base_frame=loaded["base_frame"])
    for edge in loaded["graph"]:
        graph.update(**edge)
    materials = GltfMaterials(file)
    parts = []
    for node in graph.nodes_geometry:
        matrix, name = graph.get(node)
        to_world = Y_UP_TO_Z_UP @ matrix
        if with_materials:
            parts.append(geometry[name].part(materials, to_world))
        else:
            parts.append(MeshPart(transformed(geometry[name].mesh(), to_world)))
    return parts


def _is_triangles(primitive: dict[str, Any]) -> bool:
    return primitive.get("mode", _TRIANGLES) in (_TRIANGLES, _TRIANGLE_STRIP)


def _triangle_primitives(header: dict[str, Any]) -> list[dict[str, Any]]:
    return [p for mesh in header.get("meshes", []) for p in mesh["primitives"] if _is_triangles(p)]


def _for_trimesh(header: dict[str, Any]) -> dict[str, Any]:
    """The header as trimesh is to see it.

    It keeps custom attributes (``_NAME``) but drops the second texture coordinates and, without materials, the first
    ones; so these come under custom names, untouched. Primitives that are no triangles go, so that its geometries
    and the file's triangle primitives are in the same order. Buffers go by number.
    """
    header = copy.deepcopy(header)
    for number, buffer in enumerate(header.get("buffers", [])):
        buffer["uri"] = str(number)
    for mesh in header.get("meshes", []):
        mesh["primitives"] = [p for p in mesh["primitives"] if _is_triangles(p)]
        for primitive in mesh["primitives"]:
            attributes = primitive["attributes"]
            for name in _CUSTOM_ATTRIBUTES:
                if name in attributes:
                    attributes[f"_{name}"] = attributes.pop(name)
    if "scenes" not in header:
        nodes = header.get("nodes", [])
        children = {child for node in nodes for child in node.get("children", [])}
        header["scenes"] = [{"nodes": [i for i in range(len(nodes)) if i not in children]}]
    return header


class _Buffers:
    """Gives trimesh the file's buffers by their numbers."""

    def __init__(self, file: GltfFile) -> None:
        self._file = file

    def __getitem__(self, uri: str) -> bytes:
        return self._file.buffer(int(uri))


class _Primitive:
    """Triangles of one material, as trimesh read them."""

    def __init__(self, content: dict[str, Any], description: dict[str, Any], header: dict[str, Any]) -> None:
        self._content = content
        self._description = description
        self._header = header

    def mesh(self) -> Mesh:
        """Positions, faces and normals in the coordinates of the node."""
        normals = self._content.get("vertex_normals")
        return Mesh(
            vertices=self._attribute("POSITION", self._content["vertices"]),
            faces=np.asarray(self._content["faces"], dtype=np.int32),
            normals=None if normals is None else self._attribute("NORMAL", normals),
        )

    def part(self, materials: GltfMaterials, to_world: NDArray[np.float64]) -> MeshPart:
        """The primitive with its material, placed."""
        index = self._description.get("material")
        mesh = replace(
            transformed(self.mesh(), to_world),
            texture_coordinates=self._texture_coordinates(materials.texture_coordinate_set(index)),
            colors=self._colors(materials.base_color_factor(index)[:3]),
        )
        has_uv, has_colors = mesh.texture_coordinates is not None, mesh.colors is not None
        closed = materials.transmits(index) and is_closed(mesh)
        return MeshPart(mesh, materials.principled(index, has_uv, has_colors, closed))

    def _texture_coordinates(self, number: int) -> NDArray[np.float32] | None:
        """A set of texture coordinates, v upward, or ``None``."""
        name = f"TEXCOORD_{number}"
        values = self._content.get("vertex_attributes", {}).get(f"_{name}")
        if values is None:
            return None
        uv = self._attribute(name, values)
        return np.stack([uv[:, 0], 1.0 - uv[:, 1]], axis=1)

    def _colors(self, factor: NDArray[np.float64]) -> NDArray[np.float32] | None:
        """Vertex colours times a factor for each channel, or ``None``. Their alpha is left out."""
        values = self._content.get("vertex_attributes", {}).get("_COLOR_0")
        if values is None:
            return None
        colors = np.clip(self._attribute("COLOR_0", values)[:, :3], 0.0, 1.0)
        return (colors * factor).astype(np.float32)

    def _attribute(self, name: str, values: Any) -> NDArray[np.float32]:
        """An attribute as floats; normalised integers are what the accessor says they are."""
        values = np.asarray(values)
        accessor = self._header["accessors"][self._description["attributes"][name]]
        if accessor.get("normalized") and np.issubdtype(values.dtype, np.integer):
            return np.maximum(values / np.float32(np.iinfo(values.dtype).max), -1.0).astype(np.float32)
        return values.astype(np.float32)
