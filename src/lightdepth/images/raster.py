"""PNG and TIFF files of 8 or 16 bits a channel, lossless."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO
from numpy.typing import NDArray

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
    height, width, channels = pixels.shape
    spec = OpenImageIO.ImageSpec(width, height, channels, pixels.dtype.name)
    spec["compression"] = "zip"
    with whole_file(path) as temporary:
        output: Any = OpenImageIO.ImageOutput.create(str(temporary))
        if not (output.open(str(temporary), spec) and output.write_image(np.ascontiguousarray(pixels))):
            raise RuntimeError(output.geterror())
        if not output.close():
            raise RuntimeError(output.geterror())
