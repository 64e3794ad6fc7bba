"""Scene-referred radiance from and to image files: OpenEXR and Radiance HDR."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError, warn
from lightdepth.images.beauty import read_beauty
from lightdepth.images.exr import ExrPart, write_exr
from lightdepth.images.rgbe import read_rgbe, write_rgbe

OPAQUE = 0.98
"""Alpha from which on a pixel hides what is behind it."""


def _from_exr(path: Path) -> NDArray[np.float32]:
    picture = read_beauty(path)
    if picture.alpha is not None:
        unknown = (picture.alpha <= 0.0) & (picture.radiance == 0.0).all(axis=2)
        if unknown.any():
            warn(f"{path}: {100.0 * unknown.mean():.3g} % of its pixels are transparent; they are black here")
        partly = (picture.alpha > 0.0) & (picture.alpha < OPAQUE)
        if partly.any():
            warn(
                f"{path}: {100.0 * partly.mean():.3g} % of its pixels are partly transparent; nothing is put behind them"
            )
    return picture.radiance


def _to_exr(path: Path, radiance: NDArray[np.float32]) -> None:
    write_exr(path, [ExrPart({"RGB": radiance})])


READERS: dict[str, Callable[[Path], NDArray[np.float32]]] = {".exr": _from_exr, ".hdr": read_rgbe}
"""Readers by file name extension. A new format is one function and one line here."""
WRITERS: dict[str, Callable[[Path, NDArray[np.float32]], None]] = {".exr": _to_exr, ".hdr": write_rgbe}
"""Writers by file name extension."""
_STARTS = {b"\x76\x2f\x31\x01": ".exr", b"#?": ".hdr"}
_OTHERS = {
    b"\xff\xd8\xff": "a JPEG image",
    b"\x89PNG": "a PNG image",
    b"II*\0": "a TIFF image",
    b"MM\0*": "a TIFF image",
    b"PF\n": "a PFM image",
    b"SIMPLE": "a FITS image",
    b"<": "a text, perhaps an error page of the site that it came from",
    b"version https://git-lfs": "a Git LFS pointer to the image; 'git lfs pull' fetches it",
}


def holds_radiance(path: Path) -> bool:
    """Whether :func:`read_radiance` is to read a file, by its name or by its content."""
    if path.suffix.lower() in READERS:
        return True
    try:
        with path.open("rb") as file:
            start = file.read(4)
    except OSError:
        return False
    return start.startswith(tuple(_STARTS))


def read_radiance(path: Path) -> NDArray[np.float32]:
    """Read an image's radiance as it is in the file, unchecked, but in Rec.709.

    What a file is, its content decides; an extension that says otherwise is warned of.

    Returns:
        Linear Rec.709, shape (height, width, 3), float32.

    Raises:
        InputError: the file is missing, unreadable, of another format, or lacks a colour channel.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    suffix = path.suffix.lower()
    try:
        with path.open("rb") as file:
            start = file.read(32)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    content = next((kind for sign, kind in _STARTS.items() if start.startswith(sign)), None)
    if content is not None and content != suffix:
        warn(f"{path}: is read as {content}, which it is by its content, though it is named '{suffix}'")
    if content is None and suffix in READERS:
        other = next((kind for sign, kind in _OTHERS.items() if start.startswith(sign)), None)
        if other is not None:
            raise InputError(f"{path}: is {other}; formats for radiance are {', '.join(READERS)}")
    reader = READERS.get(content or suffix)
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
