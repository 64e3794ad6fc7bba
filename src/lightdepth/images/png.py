"""PNG files: the pictures for the screen."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lightdepth.images.writing import whole_file


def write_png(path: Path, pixels: NDArray[np.uint8]) -> None:
    """Write an image for display; the file appears whole or not at all.

    Args:
        path: where to write; an existing file is replaced.
        pixels: sRGB, uint8, shape (height, width, 3), or (height, width, 4) with straight (not premultiplied) alpha.

    Raises:
        InputError: the file cannot be written (folder missing, no permission, disk full).
    """
    with whole_file(path) as temporary:
        Image.fromarray(pixels).save(temporary, format="PNG", compress_level=4)
