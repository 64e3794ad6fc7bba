"""The picture of an ordinary camera as linear radiance, from files of every kind that a panorama may have."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.images.photograph import EXTENSIONS, read_flat_photograph
from lightdepth.images.radiance import READERS, holds_radiance, read_radiance


def read_plate(path: Path) -> NDArray[np.float32]:
    """Read a plate: OpenEXR, Radiance HDR, and what cameras save.

    Returns:
        Linear Rec.709, shape (height, width, 3), float32, finite. It may be negative, as the noise of black is in raw
        photographs.

    Raises:
        InputError: the file is missing, unreadable, of another format, or holds impossible radiance.
        SetupError: HEIC, and the package that reads it is not installed.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    suffix = path.suffix.lower()
    has_radiance = holds_radiance(path)
    if not has_radiance and suffix not in EXTENSIONS:
        raise InputError(
            f"{path}: '{path.suffix}' is not a format for a plate; allowed are {', '.join((*READERS, *EXTENSIONS))}"
        )
    radiance = read_radiance(path) if has_radiance else read_flat_photograph(path)
    impossible = ~np.isfinite(radiance).all(axis=2)
    if impossible.any():
        row, column = divmod(int(np.argmax(impossible)), impossible.shape[1])
        raise InputError(
            f"{path}: {np.count_nonzero(impossible)} of its pixels are NaN or infinite, the first at row {row}, column "
            f"{column}"
        )
    return np.ascontiguousarray(radiance)
