"""The pixels of an image file as they are stored."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO

from lightdepth.errors import InputError


def read_pixels(path: Path, kind: str) -> np.ndarray:
    """Read an image file of one picture.

    Args:
        path: the file.
        kind: what it should be, for messages, such as "PNG file".

    Returns:
        Shape (height, width, channels) in the file's own type; alpha is not multiplied in, orientation not applied.

    Raises:
        InputError: the file is missing, is no image, or is damaged or cut off.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    settings = OpenImageIO.ImageSpec()
    settings["oiio:UnassociatedAlpha"] = 1
    image: Any = OpenImageIO.ImageInput.open(str(path), settings)
    if image is None:
        OpenImageIO.geterror()  # It would be printed at the end of the process.
        raise InputError(f"{path}: not a readable {kind}")
    spec = image.spec()
    pixels = image.read_image(0, 0, 0, spec.nchannels, str(spec.format))
    trouble = image.geterror()
    image.close()
    if pixels is None or trouble:  # A photograph that is cut off is grey where it ends, and there is an error.
        raise InputError(f"{path}: not a readable {kind}: its pixels are damaged or cut off")
    return np.asarray(pixels).reshape(spec.height, spec.width, spec.nchannels)
