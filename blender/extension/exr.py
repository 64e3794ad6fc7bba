"""Reading the renderer's OpenEXR results with what Blender's Python has.

Blender's own readers give either the first part alone or a compositing image whose pixels Python cannot see, and its
OpenImageIO module is not in every build; the renderer writes plain scan lines with ZIP compression, which numpy and
zlib read. Layout: OpenEXR's "OpenEXR File Layout" document.
"""

import struct
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

_MAGIC = 20000630
_MULTIPART, _UNREADABLE = 0x1000, 0x0A00  # unreadable: tiles, deep data
_TYPES = {0: np.dtype("<u4"), 1: np.dtype("<f2"), 2: np.dtype("<f4")}
_LINES = {0: 1, 2: 1, 3: 16}  # scan lines in a chunk: uncompressed, ZIPS, ZIP


class ExrError(Exception):
    """The file is not an OpenEXR file of the kind that the renderer writes."""


@dataclass
class _Part:
    name: str
    channels: list[tuple[str, np.dtype]]
    compression: int
    width: int
    height: int
    top: int

    @property
    def chunk_count(self) -> int:
        return -(-self.height // _LINES[self.compression])


def read(path: Path) -> dict[str, dict[str, np.ndarray]]:
    """Every part of a file, by name.

    Returns:
        Channels by name, each of shape (height, width), the first row at the top; a part without a name is ``""``.

    Raises:
        ExrError: the file is damaged or of another kind.
        OSError: the file cannot be read.
    """
    data = Path(path).read_bytes()
    try:
        return _read(data)
    except (struct.error, zlib.error, KeyError, ValueError, IndexError) as error:
        raise ExrError(f"{path}: not a readable OpenEXR file ({error})") from error


def _read(data: bytes) -> dict[str, dict[str, np.ndarray]]:
    magic, version = struct.unpack_from("<II", data)
    if magic != _MAGIC or version & _UNREADABLE:
        raise ValueError("no OpenEXR file of scan lines")
    position, parts = 8, []
    while True:
        attributes, position = _header(data, position)
        parts.append(_part(attributes))
        if not version & _MULTIPART:
            break
        if data[position] == 0:  # an empty header ends the list
            position += 1
            break
    pixels = [{name: np.empty((part.height, part.width), kind) for name, kind in part.channels} for part in parts]
    for index, part in enumerate(parts):
        offsets = struct.unpack_from(f"<{part.chunk_count}Q", data, position)
        position += 8 * part.chunk_count
        for offset in offsets:
            start = offset + 4 if version & _MULTIPART else offset
            _chunk(data, start, part, pixels[index])
    return {part.name: channels for part, channels in zip(parts, pixels, strict=True)}


def _header(data: bytes, position: int) -> tuple[dict[str, bytes], int]:
    attributes = {}
    while data[position] != 0:
        name, position = _text(data, position)
        _, position = _text(data, position)  # the attribute's type, which its name tells
        (size,) = struct.unpack_from("<I", data, position)
        attributes[name] = data[position + 4 : position + 4 + size]
        position += 4 + size
    return attributes, position + 1


def _text(data: bytes, position: int) -> tuple[str, int]:
    end = data.index(0, position)
    return data[position:end].decode(), end + 1


def _part(attributes: dict[str, bytes]) -> _Part:
    channels, position = [], 0
    listing = attributes["channels"]
    while listing[position] != 0:
        name, position = _text(listing, position)
        channels.append((name, _TYPES[struct.unpack_from("<I", listing, position)[0]]))
        position += 16
    left, top, right, bottom = struct.unpack("<4i", attributes["dataWindow"])
    compression = attributes["compression"][0]
    if compression not in _LINES:
        raise ValueError(f"compression {compression} is not read here")
    name = attributes.get("name", b"").decode()
    return _Part(name, channels, compression, right - left + 1, bottom - top + 1, top)


def _chunk(data: bytes, start: int, part: _Part, pixels: dict[str, np.ndarray]) -> None:
    line, size = struct.unpack_from("<iI", data, start)
    first = line - part.top
    count = min(_LINES[part.compression], part.height - first)
    row_bytes = part.width * sum(kind.itemsize for _, kind in part.channels)
    raw = data[start + 8 : start + 8 + size]
    if size != count * row_bytes:  # what does not shrink is stored as it is
        raw = _inflate(raw)
    rows = np.frombuffer(raw, np.uint8).reshape(count, row_bytes)
    column = 0
    for name, kind in part.channels:
        width = part.width * kind.itemsize
        pixels[name][first : first + count] = np.ascontiguousarray(rows[:, column : column + width]).view(kind)
        column += width


def _inflate(compressed: bytes) -> bytes:
    """ZIP as OpenEXR means it: deflate, differences of bytes, even and odd bytes apart."""
    differences = np.frombuffer(zlib.decompress(compressed), np.uint8).copy()
    differences[1:] -= 128  # modulo 256, as all sums here
    split = np.cumsum(differences, dtype=np.uint8)
    half = (split.size + 1) // 2
    joined = np.empty_like(split)
    joined[0::2], joined[1::2] = split[:half], split[half:]
    return joined.tobytes()
