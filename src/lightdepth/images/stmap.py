"""ST maps: for each pixel of a picture, where in another picture it is to be read, as compositing programs have it.

Red is the position across and green that along the other picture, in shares of its width and height from the *lower*
left corner; the middle of the first pixel is at half a pixel, ``0.5 / width``. So Nuke's ``STMap`` node reads them.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.images.exr import ExrPart, read_exr, write_exr


def write_stmap(path: Path, film: NDArray[np.float64]) -> None:
    """Write an ST map as an OpenEXR file of 32 bits a channel.

    Args:
        path: where to write; an existing file is replaced.
        film: positions in the other picture in shares of its size, x to the right, y *down*, shape (height, width, 2).

    Raises:
        InputError: the file cannot be written.
    """
    red, green = film[..., 0], 1.0 - film[..., 1]
    pixels = np.stack([red, green, np.zeros_like(red)], axis=-1).astype(np.float32)
    write_exr(path, [ExrPart({"RGB": pixels})])


def read_stmap(path: Path) -> NDArray[np.float64]:
    """Read an ST map.

    Returns:
        Positions as :func:`write_stmap` takes them, float64.

    Raises:
        InputError: no readable OpenEXR file, without channels R and G, not finite, or of 16 bits a channel, which are
            too coarse from some 1000 pixels on.
    """
    if path.suffix.lower() != ".exr":
        raise InputError(f"{path}: an ST map is an OpenEXR file (.exr)")
    part = read_exr(path)[0]
    missing = [name for name in "RG" if name not in part.channels]
    if missing:
        found = ", ".join(part.channels) or "none"
        raise InputError(f"{path}: an ST map has channels R and G; found are {found}")
    red, green = part.channels["R"], part.channels["G"]
    if red.dtype != np.float32 or green.dtype != np.float32:
        raise InputError(f"{path}: holds 16 bits a channel, too coarse for an ST map; save it with 32 bits (float)")
    if not (np.isfinite(red).all() and np.isfinite(green).all()):
        raise InputError(f"{path}: holds values that are not finite")
    return np.stack([red, 1.0 - green.astype(np.float64)], axis=-1).astype(np.float64)
