"""Files of the places at which instances of an object stand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lightdepth.array_file import read_array
from lightdepth.errors import InputError
from lightdepth.quantities import FARTHEST
from lightdepth.scene.meshes.geometry import COARSEST_STEP

MOST_INSTANCES = 50_000_000
FLATTEST = 1e-6
"""Smallest volume that an instance gives to a cube of its size."""


def read_instances(path: Path) -> NDArray[np.float64]:
    """Matrices from an object's coordinates to where its instances stand.

    Args:
        path: NumPy's format (.npy), an array of shape (n, 3, 4) or (n, 4, 4) of single or double precision.

    Returns:
        Shape (n, 4, 4), float64.

    Raises:
        InputError: the file is no such array, is empty, or has matrices that are not finite, too far or flat.
    """
    found = read_array(path)
    if (
        found.ndim != 3
        or found.shape[1:] not in ((3, 4), (4, 4))
        or found.dtype.kind != "f"
        or found.itemsize not in (4, 8)
    ):
        raise InputError(
            f"{path}: is an array of {found.dtype} of shape {found.shape}; instances are matrices of shape (n, 3, 4) or "
            "(n, 4, 4), float32 or float64"
        )
    if not 0 < len(found) <= MOST_INSTANCES:
        raise InputError(f"{path}: has {len(found)} instances; allowed are 1 to {MOST_INSTANCES}")
    matrices = np.tile(np.eye(4), (len(found), 1, 1))
    with np.errstate(invalid="ignore"):  # signalling NaN
        matrices[:, : found.shape[1]] = found
    _refuse(path, ~np.isfinite(matrices).all(axis=(1, 2)), "not finite")
    _refuse(path, (np.abs(matrices) > FARTHEST).any(axis=(1, 2)), f"beyond {FARTHEST:g}")
    _refuse(path, (matrices[:, 3] != [0.0, 0.0, 0.0, 1.0]).any(axis=1), "no affine maps: the last row must be 0 0 0 1")
    linear = matrices[:, :3, :3]
    size = np.sqrt((linear**2).sum(axis=(1, 2)))
    _refuse(path, np.abs(np.linalg.det(linear)) <= FLATTEST * size**3, "flat: an instance of them has no volume")
    return matrices


def check_precision(
    path: Path, places: NDArray[np.float64], low: NDArray[np.floating], high: NDArray[np.floating]
) -> None:
    """Refuse instances that stand so far out that single precision cannot hold their shape.

    Args:
        path: for messages.
        places: matrices to the world, shape (n, 4, 4).
        low: smallest coordinates of what stands there, shape (3,).
        high: the largest.

    Raises:
        InputError: some do.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        size = (np.abs(places[:, :3, :3]) @ (high - low)).max(axis=1)
        reach = np.abs(places[:, :3, :3] @ (0.5 * (low + high)) + places[:, :3, 3]).max(axis=1) + 0.5 * size
        step = np.spacing(reach.astype(np.float32)).astype(np.float64)
    _refuse(
        path,
        ~np.isfinite(step) | (step > COARSEST_STEP * size),
        "so far from the world's origin that positions there are too coarse for their size",
    )


def _refuse(path: Path, where: ArrayLike, what: str) -> None:
    wrong = np.asarray(where)
    if wrong.any():
        raise InputError(
            f"{path}: {wrong.sum()} of {len(wrong)} instances are {what}; the first is {int(wrong.argmax())}"
        )
