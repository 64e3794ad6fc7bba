"""OpenEXR files by the format's own Python binding, several parts to a file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
        channels: arrays by channel name; float16, float32 or uint32. The shape is (height, width); for writing, the
            names ``RGB`` and ``RGBA``, also behind a prefix as in ``glow.RGB``, take three or four channels at once
            in one array of shape (height, width, 3 or 4).
        name: the part's name, unique in its file; may be empty in a file of one part.
        header: further header attributes by name, in the types of the OpenEXR binding.
    """

    channels: Mapping[str, np.ndarray]
    name: str = ""
    header: Mapping[str, Any] = field(default_factory=dict)


def read_exr(path: Path) -> list[ExrPart]:
    """Read every part of an OpenEXR file, each channel as its own array of shape (height, width).

    Raises:
        InputError: the file is missing or is not a readable OpenEXR file.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    try:
        with OpenEXR.File(str(path), separate_channels=True) as file:
            return [_part(part) for part in file.parts]
    except (RuntimeError, ValueError, OSError) as error:
        raise InputError(f"{path}: not a readable OpenEXR file ({error})") from error


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
    exr_parts = []
    for part in parts:
        header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage, **part.header}
        channels = {name: np.ascontiguousarray(pixels) for name, pixels in part.channels.items()}
        exr_parts.append(OpenEXR.Part(header, channels, part.name))
    with whole_file(path) as temporary, OpenEXR.File(exr_parts) as file:
        file.write(str(temporary))
