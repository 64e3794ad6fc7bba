"""OpenEXR files by the format's own Python binding, several parts to a file."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import OpenEXR

from lightdepth.errors import InputError
from lightdepth.images.writing import whole_file


@dataclass(frozen=True)
class ExrPart:
    """One part of an OpenEXR file.

    Attributes:
        channels: arrays by channel name; float16, float32 or uint32. The shape is (height, width); the names ``RGB``
            and ``RGBA`` mean three or four channels at once in one array of shape (height, width, 3 or 4).
        name: the part's name, unique in its file; may be empty in a file of one part.
        header: further header attributes by name, in the types of the OpenEXR binding.
    """

    channels: Mapping[str, np.ndarray]
    name: str = ""
    header: Mapping[str, Any] = field(default_factory=dict)


def read_exr(path: Path, interleaved: bool = False) -> list[ExrPart]:
    """Read every part of an OpenEXR file.

    Args:
        path: the file.
        interleaved: give the channels R, G, B (and A) as one array named ``RGB`` (``RGBA``) instead of one by one;
            of a large image that saves a copy.

    Raises:
        InputError: the file is missing or is not a readable OpenEXR file.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    try:
        with _muted(), OpenEXR.File(str(path), header_only=True) as headers:
            expected = len(headers.parts)
        with _muted(), OpenEXR.File(str(path), separate_channels=not interleaved) as file:
            parts = [_part(part) for part in file.parts]
    except (RuntimeError, ValueError, OSError) as error:
        raise InputError(f"{path}: not a readable OpenEXR file ({error})") from error
    if len(parts) < expected:  # The binding leaves damaged parts out without an error.
        raise InputError(f"{path}: not a readable OpenEXR file: its pixels are damaged or cut off")
    return parts


@contextmanager
def _muted() -> Iterator[None]:
    """Keep the OpenEXR library from printing, in its own words, what becomes an error message here."""
    sys.stdout.flush()
    sys.stderr.flush()
    kept = [os.dup(1), os.dup(2)]
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 1)
        os.dup2(nowhere, 2)
        with redirect_stdout(None):
            yield
    finally:
        os.dup2(kept[0], 1)
        os.dup2(kept[1], 2)
        for descriptor in (*kept, nowhere):
            os.close(descriptor)


def _part(part: OpenEXR.Part) -> ExrPart:
    channels = {name: channel.pixels for name, channel in part.channels.items()}
    return ExrPart(channels, part.name(), dict(part.header))  # A copy: closing the file empties the binding's own.


def write_exr(path: Path, parts: Sequence[ExrPart]) -> None:
    """Write an OpenEXR file, ZIP-compressed; the file appears whole or not at all.

    Contiguous arrays are written from where they are, without a copy.

    Args:
        path: where to write; an existing file is replaced.
        parts: one part or more, each with channels of equal shape.

    Raises:
        InputError: the file cannot be written (folder missing, no permission, disk full).
    """
    OpenEXR.set_global_thread_count(os.cpu_count() or 1)
    exr_parts = []
    for part in parts:
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **part.header}
        channels = {name: np.ascontiguousarray(pixels) for name, pixels in part.channels.items()}
        exr_parts.append(OpenEXR.Part(header, channels, part.name))
    with whole_file(path) as temporary, OpenEXR.File(exr_parts) as file:
        file.write(str(temporary))
