"""Scene-referred radiance from and to image files: OpenEXR and Radiance HDR."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.images.exr import ExrPart, read_exr, write_exr
from lightdepth.images.rgbe import read_header
from lightdepth.images.writing import whole_file


def _from_exr(path: Path) -> NDArray[np.float32]:
    channels = read_exr(path, interleaved=True)[0].channels
    for name in ("RGB", "RGBA"):
        if name in channels:
            return np.ascontiguousarray(channels[name][:, :, :3], dtype=np.float32)
    raise InputError(f"{path}: has channels {', '.join(sorted(channels))}; R, G and B are needed")


def _from_hdr(path: Path) -> NDArray[np.float32]:
    header = read_header(path)
    with _quiet_opencv():
        try:
            pixels = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
        except cv2.error as error:
            raise InputError(f"{path}: not a readable Radiance HDR file ({error.err})") from error
    if pixels is None or pixels.shape != (header.height, header.width, 3):
        raise InputError(f"{path}: not a readable Radiance HDR file: its pixels are damaged or cut off")
    for row in pixels:  # In place, because the image may be large.
        row[:] = row[:, ::-1].copy()
    if header.exposure != 1.0:
        pixels /= np.float32(header.exposure)
    return pixels


def _to_exr(path: Path, radiance: NDArray[np.float32]) -> None:
    write_exr(path, [ExrPart({"RGB": radiance})])


def _to_hdr(path: Path, radiance: NDArray[np.float32]) -> None:
    # OpenCV cuts the mantissas off. Half a step of the brightest channel's 8 bits more makes that rounding to nearest.
    brightest = radiance.max(axis=2, keepdims=True)
    half_step = np.where(brightest > 0.0, np.ldexp(np.float32(0.5), np.frexp(brightest)[1] - 8), np.float32(0.0))
    with whole_file(path) as temporary, _quiet_opencv():
        try:
            written = cv2.imwrite(str(temporary), (radiance + half_step)[:, :, ::-1])
        except cv2.error as error:
            raise InputError(f"{path}: cannot be written ({error.err})") from error
        if not written:
            raise InputError(f"{path}: cannot be written (is the disk full?)")


@contextmanager
def _quiet_opencv() -> Iterator[None]:
    """Keep OpenCV from printing what becomes an error message here."""
    level = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)
    try:
        yield
    finally:
        cv2.utils.logging.setLogLevel(level)


READERS: dict[str, Callable[[Path], NDArray[np.float32]]] = {".exr": _from_exr, ".hdr": _from_hdr}
"""Readers by file name extension. A new format is one function and one line here."""
WRITERS: dict[str, Callable[[Path, NDArray[np.float32]], None]] = {".exr": _to_exr, ".hdr": _to_hdr}
"""Writers by file name extension."""


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


def write_radiance(path: Path, radiance: NDArray[np.float32]) -> None:
    """Write an image's radiance; the file appears whole or not at all.

    Args:
        path: where to write: ``.exr`` keeps float32 exactly, ``.hdr`` rounds to 8 bits and a shared exponent.
        radiance: linear RGB, shape (height, width, 3), float32; finite and not negative for ``.hdr``.

    Raises:
        InputError: another format, or the file cannot be written.
    """
    writer = WRITERS.get(path.suffix.lower())
    if writer is None:
        raise InputError(f"{path}: '{path.suffix}' is not a format for radiance; allowed are {', '.join(WRITERS)}")
    writer(path, radiance)
