"""PNG and TIFF files of 8 or 16 bits a channel, lossless."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.images.writing import whole_file

SUFFIXES = (".png", ".tif", ".tiff")


def write_raster(path: Path, pixels: NDArray[np.uint8] | NDArray[np.uint16]) -> None:
    """Write an image for display; the file appears whole or not at all.

    Args:
        path: where to write, with one of ``SUFFIXES``; an existing file is replaced.
        pixels: R, G, B, uint8 or uint16, shape (height, width, 3).

    Raises:
        InputError: the file cannot be written (folder missing, no permission, disk full).
    """
    encoded, data = cv2.imencode(path.suffix, cv2.cvtColor(np.ascontiguousarray(pixels), cv2.COLOR_RGB2BGR))
    if not encoded:
        raise InputError(f"{path}: cannot be encoded")
    with whole_file(path) as temporary:  # By us: OpenCV and OpenImageIO do not notice a full disk.
        temporary.write_bytes(data)
