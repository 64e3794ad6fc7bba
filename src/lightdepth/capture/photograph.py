"""Photographs as the camera wrote them: JPEG, PNG, TIFF and camera RAW."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.packages import optional_package

Codes = NDArray[np.uint8] | NDArray[np.uint16]
"""Camera readings: RGB, shape (height, width, 3), 0 is black and the type's largest value is white."""

DEVELOPED = (".jpg", ".jpeg", ".png", ".tif", ".tiff")
RAW = (".arw", ".cr2", ".cr3", ".crw", ".dng", ".nef", ".nrw", ".orf", ".pef", ".raf", ".raw", ".rw2", ".srw", ".x3f")
PHOTOGRAPHS = DEVELOPED + RAW
"""File name extensions of photographs."""

_TURNS = {3: cv2.ROTATE_180, 6: cv2.ROTATE_90_CLOCKWISE, 8: cv2.ROTATE_90_COUNTERCLOCKWISE}


def is_raw(path: Path) -> bool:
    """Whether a file is camera RAW by its name; its readings are then linear."""
    return path.suffix.lower() in RAW


def read_photograph(path: Path, orientation: int = 1) -> Codes:
    """Read a photograph as the sensor saw it.

    Args:
        path: the file. RAW is developed linearly by LibRaw, with the camera's white balance, to Rec.709 primaries.
        orientation: EXIF orientation to undo (1: leave as the sensor saw it; mirrored ones are left too).

    Returns:
        Camera readings, RGB, 8 or 16 bits.

    Raises:
        InputError: the file is missing, is no readable photograph, or has a type that has no white.
        SetupError: it is RAW and the package that reads it is not installed.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    if path.suffix.lower() not in PHOTOGRAPHS:
        raise InputError(f"{path}: '{path.suffix}' is not a photograph; allowed are {', '.join(PHOTOGRAPHS)}")
    codes = _read_raw(path) if is_raw(path) else _read_developed(path)
    turn = _TURNS.get(orientation)
    return codes if turn is None else cv2.rotate(codes, turn)


def _read_developed(path: Path) -> Codes:
    flags = cv2.IMREAD_COLOR | cv2.IMREAD_ANYDEPTH | cv2.IMREAD_IGNORE_ORIENTATION
    pixels = cv2.imread(str(path), flags)
    if pixels is None:
        raise InputError(f"{path}: not a readable image")
    if pixels.dtype not in (np.uint8, np.uint16):
        raise InputError(f"{path}: has {pixels.dtype} values; photographs have 8 or 16 bits")
    return np.ascontiguousarray(pixels[:, :, ::-1])


def _read_raw(path: Path) -> Codes:
    rawpy = optional_package("rawpy", "capture")
    try:
        with rawpy.imread(str(path)) as raw:
            return raw.postprocess(
                gamma=(1, 1),
                no_auto_bright=True,
                output_bps=16,
                use_camera_wb=True,
                user_flip=0,
                output_color=rawpy.ColorSpace.sRGB,
            )
    except rawpy.LibRawError as error:
        raise InputError(f"{path}: LibRaw cannot read it ({error})") from error
