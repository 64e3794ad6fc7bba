"""The mask that the user gives with a panorama: which of its pixels count."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.images.panorama_file import read_panorama


def read_mask(path: Path) -> NDArray[np.float32]:
    """Read a mask: white where the panorama counts, black where it does not, such as where someone walked.

    Returns:
        Share to which each pixel counts, in [0, 1], shape (h, w), float32.

    Raises:
        InputError: the file is missing, unreadable, holds values outside of [0, 1], or masks everything.
    """
    image = read_panorama(path).radiance
    mask = np.ascontiguousarray(image.mean(axis=2), np.float32)
    if not (np.isfinite(mask).all() and mask.min() >= 0.0 and mask.max() <= 1.0 + 1e-6):
        raise InputError(
            f"{path}: a mask is white (1) where the panorama counts and black (0) where it does not, but this one has "
            f"values from {mask.min():.3g} to {mask.max():.3g}"
        )
    if mask.max() == 0.0:
        raise InputError(f"{path}: is black everywhere, so that nothing of the panorama would count")
    return np.minimum(mask, 1.0)
