"""OpenEXR files, several parts to a file.

They are read by OpenImageIO, which reports what is wrong with a file instead of printing it, and written by the format's
own Python binding, which keeps every type of pixel and attribute.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR
import OpenImageIO

from lightdepth.errors import InputError, warn
from lightdepth.images.writing import whole_file

_MOST_COMPRESSED, _MOST_COMPRESSED_BY_WAVES = 2000, 200_000
"""No lossless compression of the format makes a picture smaller than this, and none that keeps cosines or wavelets
smaller than that; a header that says so is damaged."""
_SMALL = 2**26
_ENVMAPS = {"LatLong Environment": "latlong", "CubeFace Environment": "cube"}
_ENVMAP_MARKS = {"latlong": OpenEXR.ENVMAP_LATLONG, "cube": OpenEXR.ENVMAP_CUBE}


@dataclass(frozen=True)
class ExrPart:
    """One part of an OpenEXR file.

    Attributes:
        channels: arrays by channel name; float16, float32 or uint32. The shape is (height, width) of the display window;
            the names ``RGB`` and ``RGBA`` mean three or four channels at once in one array of shape (height, width, 3 or
            4).
        name: the part's name, unique in its file; may be empty in a file of one part.
        header: further header attributes by name: numbers, text, lists of text, arrays; ``envmap`` is ``latlong`` or
            ``cube``.
    """

    channels: Mapping[str, np.ndarray]
    name: str = ""
    header: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class ExrHeader:
    """What the header of one part says.

    Attributes:
        index: of the part in its file, from 0.
        name: of the part; may be empty in a file of one part.
        channels: names, R, G, B and A of a layer one after the other.
        types: of the channels' pixels, in the same order.
        attributes: see :attr:`ExrPart.header`.
        data_window: left, top, width and height in pixels.
        display_window: likewise.
    """

    index: int
    name: str
    channels: tuple[str, ...]
    types: tuple[str, ...]
    attributes: Mapping[str, Any]
    data_window: tuple[int, int, int, int]
    display_window: tuple[int, int, int, int]


class ExrReader:
    """An open OpenEXR file. Use it as a context manager, in one thread at a time."""

    def __init__(self, path: Path) -> None:
        """Open a file and read its headers.

        Raises:
            InputError: the file is missing, is not a readable OpenEXR file, or is of a kind that is not read.
        """
        if not path.is_file():
            raise InputError(f"{path}: no such file")
        self._path = path
        self._input: Any = OpenImageIO.ImageInput.open(str(path))
        if self._input is None:
            raise _unreadable(path, _pending_error())
        try:
            if self._input.format_name() != "openexr":
                raise _unreadable(path, "it is of another format")
            self.headers = list(self._headers())
        except BaseException:
            self.close()
            raise

    def __enter__(self) -> ExrReader:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the file."""
        _pending_error(self._input)  # OpenImageIO prints what nobody asked for.
        self._input.close()

    def read(self, part: ExrHeader, names: Sequence[str]) -> np.ndarray:
        """Read channels of one type, in the display window.

        What lies outside the data window is 0.

        Args:
            part: one of ``headers``.
            names: of its channels.

        Returns:
            Shape (height, width, len(names)), C-contiguous; float16, float32 or uint32.

        Raises:
            InputError: the pixels are damaged or cut off.
        """
        wanted = [part.channels.index(name) for name in names]
        first = wanted[0]
        if wanted == list(range(first, first + len(wanted))) and len({part.types[i] for i in wanted}) == 1:
            return self._in_display_window(part, self._pixels(part, first, first + len(wanted)))
        planes = [self._pixels(part, channel, channel + 1) for channel in wanted]
        return self._in_display_window(part, np.concatenate(planes, axis=2))

    def is_whole(self) -> bool:
        """Whether the end of every part can be read; one that is cut off lacks it."""
        for part in self.headers:
            end = part.data_window[1] + part.data_window[3]
            if self._input.read_scanlines(part.index, 0, end - 1, end, 0, 0, 1, part.types[0]) is None:
                _pending_error(self._input)
                return False
        return True

    def _headers(self) -> Iterator[ExrHeader]:
        index = 0
        while self._input.seek_subimage(index, 0):
            try:
                yield self._header(index)
            except UnicodeDecodeError as error:
                raise _unreadable(self._path, "its header is damaged") from error
            index += 1
        _pending_error(self._input)  # There is no further part.
        if index == 0:
            raise _unreadable(self._path, "it has no parts")

    def _header(self, index: int) -> ExrHeader:
        spec = self._input.spec()
        name = str(spec.getattribute("oiio:subimagename") or "")
        where = f"{self._path}: part '{name}'" if name else f"{self._path}"
        if spec.deep:
            raise InputError(
                f"{where}: holds deep pixels (several samples each); flat ones are needed: flatten it first"
            )
        sizes = (spec.full_width, spec.full_height), (spec.width, spec.height)
        stored = sum(_bytes(str(kind)) for kind in _types(spec)) * spec.width * spec.height
        largest = max(stored, 4 * spec.full_width * spec.full_height)
        waves = str(spec.getattribute("compression")).startswith(("dwa", "ht", "b44"))
        most = _MOST_COMPRESSED_BY_WAVES if waves else _MOST_COMPRESSED
        if largest > max(_SMALL, most * self._path.stat().st_size) or min(map(min, sizes)) < 1:
            raise _unreadable(
                self._path, f"its header claims {spec.width} x {spec.height} pixels, which it cannot hold"
            )
        return ExrHeader(
            index,
            name,
            tuple(spec.channelnames),
            _types(spec),
            _attributes(spec),
            (spec.x, spec.y, spec.width, spec.height),
            (spec.full_x, spec.full_y, spec.full_width, spec.full_height),
        )

    def _pixels(self, part: ExrHeader, first: int, stop: int) -> np.ndarray:
        pixels = self._input.read_image(part.index, 0, first, stop, part.types[first])
        if pixels is None:
            _pending_error(self._input)
            raise _unreadable(self._path, "its pixels are damaged or cut off")
        return np.asarray(pixels).reshape(part.data_window[3], part.data_window[2], stop - first)

    def _in_display_window(self, part: ExrHeader, pixels: np.ndarray) -> np.ndarray:
        if part.data_window == part.display_window:
            return pixels
        left, top, width, height = part.display_window
        x, y = part.data_window[0] - left, part.data_window[1] - top
        result = np.zeros((height, width, pixels.shape[2]), pixels.dtype)
        rows = slice(max(y, 0), max(min(y + pixels.shape[0], height), 0))
        columns = slice(max(x, 0), max(min(x + pixels.shape[1], width), 0))
        result[rows, columns] = pixels[rows.start - y : rows.stop - y, columns.start - x : columns.stop - x]
        covered = max(rows.stop - rows.start, 0) * max(columns.stop - columns.start, 0)
        if covered < height * width:
            name = f" of part '{part.name}'" if part.name else ""
            warn(
                f"{self._path}: the data window{name} covers {100.0 * covered / (height * width):.3g} % of the display "
                "window; the rest is black, or not measured"
            )
        return result


def read_exr(path: Path, interleaved: bool = False) -> list[ExrPart]:
    """Read every part of an OpenEXR file, in its display window.

    Args:
        path: the file.
        interleaved: give the channels R, G, B (and A) as one array named ``RGB`` (``RGBA``) instead of one by one;
            of a large image that saves a copy.

    Raises:
        InputError: the file is missing or is not a readable OpenEXR file.
    """
    with ExrReader(path) as reader:
        return [ExrPart(_channels(reader, part, interleaved), part.name, part.attributes) for part in reader.headers]


def _channels(reader: ExrReader, part: ExrHeader, interleaved: bool) -> dict[str, np.ndarray]:
    colour = [name for name in "RGBA" if name in part.channels]
    together = interleaved and colour[:3] == ["R", "G", "B"] and len({_type(part, name) for name in colour}) == 1
    alone = [name for name in part.channels if not (together and name in colour)]
    channels = {"".join(colour): reader.read(part, colour)} if together else {}
    if together or not alone:
        return channels | {name: reader.read(part, [name])[:, :, 0] for name in alone}
    # Every read decompresses all channels, so channels of one type are read at once.
    for kind in dict.fromkeys(part.types):
        names = [name for name in alone if _type(part, name) == kind]
        planes = reader.read(part, names)
        channels |= {name: np.ascontiguousarray(planes[:, :, i]) for i, name in enumerate(names)}
    return channels


def _type(part: ExrHeader, name: str) -> str:
    return part.types[part.channels.index(name)]


def _types(spec: OpenImageIO.ImageSpec) -> tuple[str, ...]:
    """Pixel types of the channels by OpenImageIO's names: half, float or uint."""
    return tuple(str(kind) for kind in spec.channelformats or [spec.format] * spec.nchannels)


def _bytes(kind: str) -> int:
    return 2 if kind == "half" else 4


def _attributes(spec: OpenImageIO.ImageSpec) -> dict[str, Any]:
    """Header attributes by name, matrices and vectors as arrays, lists of text as lists."""
    found: dict[str, Any] = {}
    for attribute in spec.extra_attribs:
        value: Any = attribute.value
        if attribute.name == "textureformat":
            found["envmap"] = _ENVMAPS.get(value, value)
        elif attribute.name.startswith(("oiio:", "openexr:")):
            continue  # Of OpenImageIO's own making.
        elif str(attribute.type).startswith("matrix"):
            side = int(np.sqrt(len(value)))
            found[attribute.name] = np.array(value, np.float32).reshape(side, side)
        elif isinstance(value, tuple):
            found[attribute.name] = list(value) if value and isinstance(value[0], str) else np.array(value)
        else:
            found[attribute.name] = value
    return found


def _pending_error(source: OpenImageIO.ImageInput | None = None) -> str:
    """OpenImageIO's last error, of a file or of the attempt to open one."""
    try:
        return str(OpenImageIO.geterror() if source is None else source.geterror())
    except UnicodeDecodeError:  # It quotes what a damaged file holds.
        return "its header is damaged"


def _unreadable(path: Path, reason: str) -> InputError:
    known = {
        "Subsampled channels": "it holds luminance and subsampled chroma (Y, RY, BY); save it as R, G, B",
        "claims a": "its header claims more pixels than it can hold",
        "EXR_ERR_FILE_BAD_HEADER": "it does not start like one",
        "END_OF_FILE": "it is cut off",
        "End of file": "it is cut off",
        "EXR_ERR": "its header is damaged",
        "exception": "its header is damaged",
        "Exception": "its header is damaged",
    }
    words = next((words for sign, words in known.items() if sign in reason), reason)
    return InputError(f"{path}: not a readable OpenEXR file: {words}")


def write_exr(path: Path, parts: Sequence[ExrPart]) -> None:
    """Write an OpenEXR file, ZIP-compressed; the file appears whole or not at all.

    Contiguous arrays are written from where they are, without a copy.

    Args:
        path: where to write; an existing file is replaced.
        parts: one part or more, each with channels of equal shape.

    Raises:
        InputError: the file cannot be written (folder missing, no permission, disk full).
    """
    exr_parts = []
    for part in parts:
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **part.header}
        if header.get("envmap") in _ENVMAP_MARKS:
            header["envmap"] = _ENVMAP_MARKS[header["envmap"]]
        channels = {name: np.ascontiguousarray(pixels) for name, pixels in part.channels.items()}
        exr_parts.append(OpenEXR.Part(header, channels, part.name))
    with whole_file(path) as temporary, _writing_threads(), OpenEXR.File(exr_parts) as file:
        file.write(str(temporary))


_writers = 0
_threads_before = 0
_writers_lock = threading.Lock()


@contextmanager
def _writing_threads() -> Iterator[None]:
    """Let the OpenEXR library compress in all processors while something is written, and leave it as it was.

    The library knows one number of threads for the whole process only.
    """
    global _writers, _threads_before
    with _writers_lock:
        if _writers == 0:
            _threads_before = OpenEXR.global_thread_count()
            OpenEXR.set_global_thread_count(os.cpu_count() or 1)
        _writers += 1
    try:
        yield
    finally:
        with _writers_lock:
            _writers -= 1
            if _writers == 0:
                OpenEXR.set_global_thread_count(_threads_before)
