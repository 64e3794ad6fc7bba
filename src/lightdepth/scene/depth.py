"""Depth that the user gives with the panorama."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.images.distances import check_kind, read_distances, warn_of_sky, warn_of_unit


def read_depth(path: Path) -> NDArray[np.float32]:
    """Read distances from the capture point; see :func:`lightdepth.images.distances.read_distances`.

    Returns:
        Distances along the rays in metres, inf for sky, shape (h, 2 h), float32.

    Raises:
        InputError: the file is missing, unreadable, not twice as wide as high, holds whole numbers, or has distances that
            are not positive or not along the rays.
    """
    depth, whole = read_distances(path)
    if whole:
        raise InputError(
            f"{path}: holds whole numbers, whose unit is not known; save metres as floating-point numbers, or make meshes "
            "of it by 'lightdepth reconstruct from-depth --scale'"
        )
    check_kind(path, depth)
    bad = ~(depth > 0.0)
    if bad.any():
        row, column = np.unravel_index(bad.argmax(), bad.shape)
        raise InputError(
            f"{path}: {bad.sum()} of {bad.size} distances are not positive, the first, {depth[row, column]}, in row "
            f"{row}, column {column}; allowed are metres above 0, and inf for sky"
        )
    warn_of_sky(path, depth)
    warn_of_unit(path, depth)
    return np.ascontiguousarray(depth, dtype=np.float32)
