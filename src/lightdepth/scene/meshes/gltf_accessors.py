"""Accessors of glTF 2.0: typed numbers out of buffer views."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.scene.meshes.gltf_file import GltfFile
from lightdepth.scene.meshes.gltf_schema import Accessor

_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_LARGEST = 1 << 26
"""Numbers of an accessor without data of its own, which are zeros."""


class GltfAccessors:
    """Decodes the accessors of one file."""

    def __init__(self, file: GltfFile) -> None:
        self._file = file
        self._decoded: dict[int, NDArray[Any]] = {}

    def entry(self, index: int) -> Accessor:
        """An accessor as the file describes it."""
        return self._file.entry(self._file.header.accessors, index, "accessor")

    def count(self, index: int) -> int:
        """How many elements an accessor has."""
        return self.entry(index).count

    def integers(self, index: int, width: int = 1) -> NDArray[np.int64]:
        """Whole numbers as they are stored, shape (n, width).

        Raises:
            InputError: the accessor is broken, or of another type.
        """
        values = self._values(index)
        if values.dtype.kind == "f" or values.shape[1] != width:
            raise self._wrong(index, f"whole numbers, {width} in each element")
        return values.astype(np.int64)

    def floats(self, index: int, *widths: int, shares: bool = False) -> NDArray[np.float64]:
        """Numbers as they are meant, shape (n, one of the widths); normalised integers as shares, all with ``shares``.

        Raises:
            InputError: the accessor is broken, or of another type.
        """
        values = self._values(index)
        if values.shape[1] not in widths:
            raise self._wrong(index, f"{' or '.join(map(str, widths))} numbers in each element")
        return _as_shares(values, shares or self.entry(index).normalized)

    def as_described(self, index: int, values: NDArray[Any]) -> NDArray[np.float64]:
        """Numbers that were stored elsewhere, perhaps in a wider type, as the accessor's would be meant."""
        kind = _COMPONENTS.get(self.entry(index).component_type, "<f4")
        stored = values if values.dtype.kind == "f" else values.astype(kind)
        return _as_shares(stored, self.entry(index).normalized)

    def _wrong(self, index: int, needed: str) -> InputError:
        accessor = self.entry(index)
        return InputError(
            f"{self._file.path}: accessor {index} is {accessor.type[:10]} of type {accessor.component_type}; {needed} "
            "are needed where it is used"
        )

    def _values(self, index: int) -> NDArray[Any]:
        if index not in self._decoded:
            self._decoded[index] = self._decode(index)
        return self._decoded[index]

    def _decode(self, index: int) -> NDArray[Any]:
        accessor = self.entry(index)
        if accessor.component_type not in _COMPONENTS or accessor.type not in _WIDTHS:
            raise InputError(
                f"{self._file.path}: accessor {index} is {accessor.type[:10]} of type {accessor.component_type}; "
                f"allowed are {', '.join(_WIDTHS)} of {', '.join(map(str, _COMPONENTS))}"
            )
        kind, width = np.dtype(_COMPONENTS[accessor.component_type]), _WIDTHS[accessor.type]
        if accessor.type.startswith("MAT") and kind.itemsize < 4:
            raise InputError(
                f"{self._file.path}: accessor {index} has matrices of 8-bit or 16-bit values, which are not supported"
            )
        if accessor.buffer_view is None:
            if accessor.count * width > _LARGEST:
                raise InputError(f"{self._file.path}: accessor {index} has {accessor.count} elements and no data")
            values: NDArray[Any] = np.zeros((accessor.count, width), kind)
        else:
            values = self._strided(index, accessor.buffer_view, accessor.byte_offset, accessor.count, kind, width)
        if accessor.sparse is not None:
            values = self._replaced(index, accessor, values)
        return values

    def _strided(self, index: int, view: int, offset: int, count: int, kind: np.dtype[Any], width: int) -> NDArray[Any]:
        """Elements at equal distances."""
        data = self._file.view(view)
        size = kind.itemsize * width
        stride = self._file.header.buffer_views[view].byte_stride or size
        if stride < size:
            raise InputError(
                f"{self._file.path}: buffer view {view} has elements every {stride} bytes (byteStride), but those of "
                f"accessor {index} have {size}"
            )
        needed = offset + (count - 1) * stride + size if count else 0
        if needed > len(data):
            raise InputError(
                f"{self._file.path}: accessor {index} reads {needed} bytes of buffer view {view}, which has {len(data)}"
            )
        if not count:
            return np.zeros((0, width), kind)
        return np.ndarray((count, width), kind, data, offset, (stride, kind.itemsize))

    def _replaced(self, index: int, accessor: Accessor, values: NDArray[Any]) -> NDArray[Any]:
        """The elements with those that ``sparse`` replaces."""
        sparse = accessor.sparse
        assert sparse is not None
        if sparse.indices.component_type not in (5121, 5123, 5125):
            raise InputError(f"{self._file.path}: accessor {index}: its sparse indices are not integers")
        kind = np.dtype(_COMPONENTS[sparse.indices.component_type])
        where = self._strided(
            index, sparse.indices.buffer_view, sparse.indices.byte_offset, sparse.count, kind, 1
        ).astype(np.int64)[:, 0]
        width = values.shape[1]
        what = self._strided(
            index, sparse.values.buffer_view, sparse.values.byte_offset, sparse.count, values.dtype, width
        )
        if len(where) and where.max() >= len(values):
            raise InputError(
                f"{self._file.path}: accessor {index} replaces element {where.max()}, but has {len(values)}"
            )
        replaced = values.copy()
        replaced[where] = what
        return replaced


def _as_shares(values: NDArray[Any], normalized: bool) -> NDArray[np.float64]:
    """Numbers in double precision; normalised integers are divided by the largest of their type."""
    found = values.astype(np.float64)
    if normalized and values.dtype.kind in "iu":
        return np.maximum(found / float(np.iinfo(values.dtype).max), -1.0)
    return found
