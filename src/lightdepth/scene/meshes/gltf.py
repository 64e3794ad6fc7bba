"""glTF 2.0, .gltf and .glb: meshes of all nodes with their materials, turned from y up to z up."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.scene.meshes.geometry import is_closed, transformed
from lightdepth.scene.meshes.gltf_accessors import GltfAccessors
from lightdepth.scene.meshes.gltf_animation import GltfAnimation
from lightdepth.scene.meshes.gltf_extensions import left_out_extensions
from lightdepth.scene.meshes.gltf_file import GltfFile
from lightdepth.scene.meshes.gltf_material import GltfMaterials
from lightdepth.scene.meshes.gltf_nodes import GltfNodes, instance_matrices
from lightdepth.scene.meshes.gltf_primitive import FAN, STRIP, TRIANGLES, Decoded, GltfPrimitive
from lightdepth.scene.meshes.gltf_skin import skinned
from lightdepth.scene.meshes.part import MeshPart, Note
from lightdepth.scene.model import Mesh

Y_UP_TO_Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, -1.0, 0], [0, 1.0, 0, 0], [0, 0, 0, 1.0]])
"""(x, y, z) becomes (x, -z, y)."""
_MOST_VERTICES = 1 << 27
"""Of all instances of a primitive."""


def read_gltf(path: Path, with_materials: bool, note: Note) -> list[MeshPart]:
    """Read a glTF file: one part for each primitive of each node that shows it.

    Skins are posed by their joints and morph targets by their weights, without animation; points and lines are left
    out. Without materials, texture coordinates are those of ``TEXCOORD_0``.

    Raises:
        InputError: the file is broken, incomplete, or needs an extension that is not supported.
    """
    return GltfReader(path, with_materials, note).parts()


class GltfReader:
    """Reads one file, in one pose after the other; what does not move is decoded once.

    Args:
        path: the file.
        with_materials: read the materials, too.
        note: called with what is left out.

    Raises:
        InputError: as for :func:`read_gltf`.
    """

    def __init__(self, path: Path, with_materials: bool, note: Note) -> None:
        self._file = GltfFile(path)
        self._note = note
        self._accessors = GltfAccessors(self._file)
        self._nodes = GltfNodes(self._file)
        self._materials = GltfMaterials(self._file, note) if with_materials else None
        self._primitives: dict[tuple[int, int], GltfPrimitive] = {}
        self._animations: dict[str, GltfAnimation] = {}

    def parts(self, animation: str | None = None, time: float = 0.0, loop: bool = False) -> list[MeshPart]:
        """All that is shown.

        Args:
            animation: name of the animation, or its number; ``None`` for the pose without.
            time: in the animation, seconds.
            loop: begin the animation again where it ends.

        Raises:
            InputError: the file is broken, or has no such animation.
        """
        header = self._file.header
        used = dict.fromkeys([*header.extensions_used, *self._file.extensions])
        for message in left_out_extensions(used if self._materials is not None else ()):
            self._note(message)
        doubled = [number for number, node in enumerate(header.nodes) if node.is_placed_twice]
        if doubled:
            self._note(f"node {doubled[0]} has a matrix and a translation, rotation or scale; only the matrix counts")
        if animation is not None:
            if animation not in self._animations:
                self._animations[animation] = GltfAnimation(self._file, self._accessors, animation, self._note)
            self._nodes = GltfNodes(self._file, self._animations[animation].nodes_at(time, loop))
        elif header.animations:
            self._note("its animation is left out; the pose is the one without it")
        if len(header.scenes) > 1:
            self._note(f"has {len(header.scenes)} scenes, of which number {header.scene or 0} is shown")
        parts = []
        for number, world in self._nodes.shown.items():
            node = self._nodes.entries[number]
            if node.mesh is None:
                continue
            mesh = self._file.entry(header.meshes, node.mesh, "mesh")
            weights = node.weights or mesh.weights or []
            self._check_targets(node.mesh, weights)
            for position, description in enumerate(mesh.primitives):
                if description.mode not in (TRIANGLES, STRIP, FAN):
                    if not 0 <= description.mode < TRIANGLES:
                        raise InputError(
                            f"{self._file.path}: meshes[{node.mesh}].primitives[{position}] has mode "
                            f"{description.mode}; allowed are 0 to 6"
                        )
                    self._note("points and lines are left out")
                    continue
                primitive = self._primitive(node.mesh, position)
                base = primitive.decoded(weights)
                if not len(base.faces):
                    continue
                if node.skin is not None:
                    if node.extensions.EXT_mesh_gpu_instancing is not None:
                        self._note(
                            f"node {number} has a skin and instances; its mesh is shown once, where the skin puts it"
                        )
                    posed = skinned(self._file, self._accessors, self._nodes, node.skin, primitive, base)
                    placed = transformed(_mesh(posed), Y_UP_TO_Z_UP)
                else:
                    placed = self._instances(number, world, base)
                parts.append(self._part(primitive, placed, len(base.positions)))
        return parts

    def _check_targets(self, mesh: int, weights: Sequence[float]) -> None:
        """Name what morph targets say and what is not carried."""
        targets = [primitive.targets for primitive in self._file.header.meshes[mesh].primitives]
        if any(len(each) != len(weights) for each in targets) and any(weights):
            counts = " or ".join(str(count) for count in sorted({*map(len, targets)}))
            self._note(
                f"mesh {mesh} has {len(weights)} weights and {counts} morph targets; what has no counterpart is left out"
            )
        moved = {name for each in targets for target in each for name in target} - {"POSITION", "NORMAL", "TANGENT"}
        if moved and any(weights):
            self._note(f"mesh {mesh}: its morph targets of {', '.join(sorted(moved))[:60]} are left out")

    def _primitive(self, mesh: int, position: int) -> GltfPrimitive:
        key = (mesh, position)
        if key not in self._primitives:
            description = self._file.header.meshes[mesh].primitives[position]
            place = f"meshes[{mesh}].primitives[{position}]"
            self._primitives[key] = GltfPrimitive(self._file, self._accessors, description, place)
        return self._primitives[key]

    def _instances(self, number: int, world: NDArray[np.float64], base: Decoded) -> Mesh:
        """A primitive in its node's place, or in all those of its instances, as one mesh."""
        instances = instance_matrices(self._file, self._accessors, self._nodes.entries[number])
        mesh = _mesh(base)
        if instances is None:
            return transformed(mesh, Y_UP_TO_Z_UP @ world)
        count = len(instances)
        if count * max(len(mesh.vertices), len(mesh.faces)) > _MOST_VERTICES:
            raise InputError(
                f"{self._file.path}: node {number} has {count} instances of {len(mesh.vertices)} vertices, too many"
            )
        placed = [transformed(mesh, Y_UP_TO_Z_UP @ world @ matrix) for matrix in instances]
        if not placed:
            return replace(mesh, faces=mesh.faces[:0])
        return Mesh(
            vertices=np.concatenate([m.vertices for m in placed]),
            faces=np.concatenate([m.faces + i * len(mesh.vertices) for i, m in enumerate(placed)]).astype(np.int32),
            normals=None
            if mesh.normals is None
            else np.concatenate([m.normals for m in placed if m.normals is not None]),
        )

    def _part(self, primitive: GltfPrimitive, mesh: Mesh, count: int) -> MeshPart:
        """A placed primitive with its texture coordinates, colours and material.

        Args:
            primitive: where these come from.
            mesh: the placed one, with as many vertices or a multiple of them.
            count: how many vertices the primitive has.
        """
        times = len(mesh.vertices) // max(count, 1)
        index, materials = primitive.description.material, self._materials
        if materials is None:
            return MeshPart(replace(mesh, texture_coordinates=_repeated(_texture_coordinates(primitive, 0), times)))
        uv = _texture_coordinates(primitive, materials.texture_coordinate_set(index))
        colors = self._colors(primitive, materials.base_color_factor(index)[:3], materials.shows_alpha(index))
        mesh = replace(mesh, texture_coordinates=_repeated(uv, times), colors=_repeated(colors, times))
        closed = materials.transmits(index) and is_closed(mesh)
        material = materials.principled(index, uv is not None, colors is not None, closed)
        return MeshPart(mesh, material, materials.name(index))

    def _colors(
        self, primitive: GltfPrimitive, factor: NDArray[np.float64], with_alpha: bool
    ) -> NDArray[np.float32] | None:
        """Vertex colours times a factor for each channel, or ``None``. Their alpha is left out."""
        values = primitive.attribute("COLOR_0")
        if values is None:
            return None
        if with_alpha and values.shape[1] == 4 and (values[:, 3] < 1.0).any():
            self._note("the alpha of its vertex colours is left out")
        if not np.isfinite(values).all():
            raise InputError(f"{self._file.path}: {primitive.place}: COLOR_0 has values that are not finite")
        if (values[:, :3] > 1.0).any():
            self._note(f"vertex colours above 1 are cut off there ({primitive.place})")
        return np.asarray(np.clip(values[:, :3], 0.0, 1.0) * factor, np.float32)


def _mesh(base: Decoded) -> Mesh:
    return Mesh(
        vertices=base.positions,
        faces=base.faces.astype(np.int32),
        normals=None if base.normals is None else base.normals.astype(np.float32),
    )


def _repeated(values: NDArray[np.float32] | None, times: int) -> NDArray[np.float32] | None:
    return values if values is None or times == 1 else np.tile(values, (times, 1))


def _texture_coordinates(primitive: GltfPrimitive, number: int) -> NDArray[np.float32] | None:
    """A set of texture coordinates, v upward, or ``None``."""
    uv = primitive.attribute(f"TEXCOORD_{number}")
    return None if uv is None else np.stack([uv[:, 0], 1.0 - uv[:, 1]], axis=1).astype(np.float32)
