"""Depth that the user gives with the panorama."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.images.exr import read_exr


def read_depth(path: Path) -> NDArray[np.float32]:
    """Read distances from the capture point: the channel ``Z`` of an OpenEXR file, or a NumPy array in a .npy file.

    Returns:
        Distances along the rays in metres, inf for sky, shape (h, 2 h), float32.

    Raises:
        InputError: the file is missing, unreadable, not twice as wide as high, or has distances that are not positive.
    """
    suffix = path.suffix.lower()
    if suffix == ".exr":
        depth = _from_exr(path)
    elif suffix == ".npy":
        depth = _from_npy(path)
    else:
        raise InputError(f"{path}: '{path.suffix}' is not a format for depth; allowed are .exr (channel Z), .npy")
    if depth.ndim != 2 or depth.shape[1] != 2 * depth.shape[0] or depth.size == 0:
        raise InputError(f"{path}: depth has shape {depth.shape}; it must be twice as wide as high, as (512, 1024)")
    bad = ~(depth > 0.0)
    if bad.any():
        row, column = np.unravel_index(bad.argmax(), bad.shape)
        raise InputError(
            f"{path}: {bad.sum()} of {bad.size} distances are not positive, the first, {depth[row, column]}, in row "
            f"{row}, column {column}; allowed are metres above 0, and inf for sky"
        )
    return np.ascontiguousarray(depth, dtype=np.float32)


def _from_exr(path: Path) -> NDArray[np.floating]:
    parts = read_exr(path)
    for part in parts:
        if "Z" in part.channels:
            return part.channels["Z"]
    found = ", ".join(sorted(name for part in parts for name in part.channels))
    raise InputError(f"{path}: has no channel Z of distances, but {found}")


def _from_npy(path: Path) -> NDArray[np.floating]:
    try:
        depth = np.load(path, allow_pickle=False)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: not a readable .npy file ({error})") from error
    if not np.issubdtype(depth.dtype, np.number):
        raise InputError(f"{path}: holds {depth.dtype}, but distances are numbers")
    return depth
