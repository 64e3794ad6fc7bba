"""Scene-referred radiance from image files: OpenEXR and Radiance HDR."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.images.exr import read_exr


def _from_exr(path: Path) -> NDArray[np.float32]:
    channels = read_exr(path)[0].channels
    missing = [name for name in "RGB" if name not in channels]
    if missing:
        raise InputError(
            f"{path}: has channels {', '.join(sorted(channels))}; R, G and B are needed, missing: {', '.join(missing)}"
        )
    return np.stack([channels[name].astype(np.float32) for name in "RGB"], axis=-1)


def _from_hdr(path: Path) -> NDArray[np.float32]:
    pixels = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if pixels is None or pixels.ndim != 3:
        raise InputError(f"{path}: not a readable Radiance HDR file")
    return np.ascontiguousarray(pixels[:, :, ::-1], dtype=np.float32)


READERS: dict[str, Callable[[Path], NDArray[np.float32]]] = {".exr": _from_exr, ".hdr": _from_hdr}
"""Readers by file name extension. A new format is one function and one line here."""


def read_radiance(path: Path) -> NDArray[np.float32]:
    """Read an image's radiance as it is in the file, unchecked.

    Returns:
        Linear RGB, shape (height, width, 3), float32.

    Raises:
        InputError: the file is missing, unreadable, of another format, or lacks a colour channel.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: '{path.suffix}' is not a format for radiance; allowed are {', '.join(READERS)}")
    return reader(path)
