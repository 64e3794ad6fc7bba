"""STL: bare triangles, flat-shaded."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.scene.meshes.part import MeshPart, Note
from lightdepth.scene.meshes.rows import unique_rows
from lightdepth.scene.model import Mesh

_HEAD, _ROW = 84, np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_NAME = re.compile(rb"^[ \t]*(end)?solid\b[^\r\n]*", re.IGNORECASE | re.MULTILINE)
_FIRST_WORD = re.compile(rb"^[ \t\xef\xbb\xbf]*([^\s]+)", re.MULTILINE)
_KEYWORDS = {"facet", "outer", "vertex", "endloop", "endfacet", "solid", "endsolid"}
_VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)


def read_stl(path: Path, with_materials: bool, note: Note) -> list[MeshPart]:
    """Read an STL file, ASCII or binary; corners at the same place become one vertex. It has no materials.

    Raises:
        InputError: the file is cut off or damaged.
    """
    content = path.read_bytes()
    corners = _ascii(path, content, note) if _is_ascii(content) else _binary(path, content, with_materials, note)
    if not len(corners):
        return []
    positions = corners.reshape(-1, 3)
    first, index = unique_rows(positions)
    return [MeshPart(Mesh(vertices=positions[first], faces=index.reshape(-1, 3).astype(np.int32)))]


def _is_ascii(content: bytes) -> bool:
    """Whether a file is text: binary ones begin with 'solid' at times, but have the size that they say."""
    if not content[:512].lstrip(b"\xef\xbb\xbf \t\r\n").lower().startswith(b"solid"):
        return False
    count = int.from_bytes(content[80:_HEAD], "little")
    if len(content) == _HEAD + count * _ROW.itemsize:
        return False
    return b"facet" in content.lower() or b"\0" not in content


def _binary(path: Path, content: bytes, with_materials: bool, note: Note) -> NDArray[np.float64]:
    """Corners, shape (m, 3, 3)."""
    if len(content) < _HEAD:
        raise InputError(f"{path}: not a readable STL file: the {len(content)} bytes have no triangles")
    count = int.from_bytes(content[80:_HEAD], "little")
    body = len(content) - _HEAD
    if count == 0 and body and body % _ROW.itemsize == 0:  # Written by a program that did not know the end.
        count = body // _ROW.itemsize
        note(f"says that it has no triangles, but has {count}; these are read")
    size = count * _ROW.itemsize
    if len(content) < _HEAD + size:
        raise InputError(
            f"{path}: not a readable STL file: it states {count} triangles, but has {(len(content) - _HEAD) // 50}; "
            "it is cut off or damaged"
        )
    if tail := len(content) - _HEAD - size:
        note(f"{tail} bytes behind its {count} triangles are left out")
    table = np.frombuffer(content, _ROW, count, _HEAD)
    if with_materials and (table["attribute"] != 0).any():
        note("colours, or other attributes, of its triangles are left out")
    return table["corners"].astype(np.float64)


def _ascii(path: Path, content: bytes, note: Note) -> NDArray[np.float64]:
    """Corners, shape (m, 3, 3)."""
    content = _NAME.sub(b"", content)
    words = [word for match in _VERTEX.finditer(content) for word in match.groups()]
    try:
        numbers = np.array([float(word) for word in words], np.float64)
    except ValueError:
        for match in _VERTEX.finditer(content):
            try:
                [float(word) for word in match.groups()]
            except ValueError:
                line = content.count(b"\n", 0, match.start()) + 1
                raise InputError(f"{path}: line {line}: a vertex needs three numbers") from None
        raise
    lower = content.lower()
    facets, vertices = lower.count(b"endfacet"), len(numbers) // 3
    mentioned = len(re.findall(rb"\bvertex\b", lower))
    if vertices != 3 * facets or mentioned != vertices:
        raise InputError(
            f"{path}: not a readable STL file: {facets} complete facets with {mentioned} vertices, each needs three; "
            "it is cut off or damaged"
        )
    strange = {word.lower().decode("latin-1") for word in _FIRST_WORD.findall(content)} - _KEYWORDS
    if strange:
        note(f"lines that begin with {', '.join(sorted(strange))[:100]} are left out")
    return numbers.reshape(-1, 3, 3)
