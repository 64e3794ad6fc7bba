"""Primitives of glTF: triangles with their attributes, morphed, in the coordinates of their mesh."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.scene.meshes.geometry import unit
from lightdepth.scene.meshes.gltf_accessors import GltfAccessors
from lightdepth.scene.meshes.gltf_draco import DracoPrimitive
from lightdepth.scene.meshes.gltf_file import GltfFile
from lightdepth.scene.meshes.gltf_schema import Primitive
from lightdepth.scene.meshes.strips import strip_triangles

TRIANGLES, STRIP, FAN = 4, 5, 6
_WIDTHS = {"POSITION": (3,), "NORMAL": (3,), "TEXCOORD": (2,), "COLOR": (3, 4), "JOINTS": (4,), "WEIGHTS": (4,)}


@dataclass(frozen=True)
class Decoded:
    """A primitive's numbers.

    Attributes:
        positions: shape (n, 3), float64.
        faces: shape (m, 3), int64.
        normals: shape (n, 3), float64, or ``None``.
    """

    positions: NDArray[np.float64]
    faces: NDArray[np.int64]
    normals: NDArray[np.float64] | None


class GltfPrimitive:
    """One primitive of a file; what it has is decoded when it is asked for."""

    def __init__(self, file: GltfFile, accessors: GltfAccessors, primitive: Primitive, place: str) -> None:
        """Look at a primitive.

        Args:
            file: its file.
            accessors: those of the file.
            primitive: as the file describes it.
            place: of it in the file, for messages.

        Raises:
            InputError: it has no positions, or attributes of different lengths.
        """
        self._file = file
        self._accessors = accessors
        self.description = primitive
        self.place = place
        if "POSITION" not in primitive.attributes:
            raise InputError(f"{file.path}: {place} has no POSITION")
        count = accessors.count(primitive.attributes["POSITION"])
        for name, index in primitive.attributes.items():
            if accessors.count(index) != count:
                raise InputError(
                    f"{file.path}: {place}: {name[:40]} has {accessors.count(index)} elements, but POSITION has {count}"
                )
        how = primitive.extensions.KHR_draco_mesh_compression
        self._draco = None if how is None else DracoPrimitive(file, how, place)
        positions = None if self._draco is None else self._draco.attribute("POSITION")
        self._count = count if positions is None else len(positions)

    def attribute(self, name: str) -> NDArray[np.float64] | None:
        """An attribute as floats, shape (n, k), or ``None``."""
        index = self.description.attributes.get(name)
        if index is None:
            return None
        widths = _WIDTHS[name.partition("_")[0]]
        if self._draco is not None and (found := self._draco.attribute(name)) is not None:
            if found.shape[1] not in widths:
                raise InputError(f"{self._file.path}: {self.place}: {name} has {found.shape[1]} numbers per element")
            values = self._accessors.as_described(index, found)
        else:
            # Colours are shares; some programs write them as whole numbers without saying so.
            values = self._accessors.floats(index, *widths, shares=name.startswith("COLOR"))
        if len(values) != self._count:
            raise InputError(
                f"{self._file.path}: {self.place}: {name} has {len(values)} elements, but POSITION has {self._count}"
            )
        return values

    def joints(self, name: str) -> NDArray[np.int64] | None:
        """``JOINTS_n`` as whole numbers, shape (n, 4), or ``None``."""
        index = self.description.attributes.get(name)
        if index is None:
            return None
        if self._draco is not None and (found := self._draco.attribute(name)) is not None:
            return found.astype(np.int64)
        return self._accessors.integers(index, 4)

    def decoded(self, weights: Sequence[float]) -> Decoded:
        """Positions, faces and normals, with morph targets at some weights.

        Raises:
            InputError: faces are incomplete.
        """
        positions = self.attribute("POSITION")
        assert positions is not None
        normals = self.attribute("NORMAL")
        targets = self.description.targets
        for weight, target in zip(weights, targets, strict=False):
            if weight == 0.0:
                continue
            positions = positions + weight * self._moved(target, "POSITION", positions)
            if normals is not None:
                normals = normals + weight * self._moved(target, "NORMAL", normals)
        if normals is not None and any(weights):
            normals = unit(normals).astype(np.float64)
        faces = self._faces(len(positions))
        outside = (faces < 0) | (faces >= len(positions))
        if outside.any():
            face = int(outside.any(axis=1).argmax())
            raise InputError(
                f"{self._file.path}: {self.place}: face {face} refers to vertices {faces[face].tolist()}, but there are "
                f"{len(positions)}"
            )
        return Decoded(positions, faces, normals)

    def _moved(self, target: dict[str, int], name: str, base: NDArray[np.float64]) -> NDArray[Any]:
        if name not in target:
            return np.zeros_like(base)
        moved = self._accessors.floats(target[name], 3)
        if len(moved) != len(base):
            raise InputError(
                f"{self._file.path}: {self.place}: a morph target moves {len(moved)} of {len(base)} elements of {name}"
            )
        return moved

    def _faces(self, count: int) -> NDArray[np.int64]:
        if self._draco is not None:
            return self._draco.faces
        index = self.description.indices
        indices = np.arange(count) if index is None else self._accessors.integers(index)[:, 0]
        if self.description.mode == STRIP:
            return strip_triangles(indices, np.array([len(indices)]))
        if self.description.mode == FAN:
            middle = np.full(max(len(indices) - 2, 0), indices[0] if len(indices) else 0)
            return np.stack([middle, indices[1:-1], indices[2:]], axis=1) if len(indices) > 2 else np.zeros((0, 3), int)
        if len(indices) % 3:
            raise InputError(
                f"{self._file.path}: {self.place}: {len(indices)} indices, which is not a multiple of three"
            )
        return indices.reshape(-1, 3)
