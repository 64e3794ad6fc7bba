"""Single arrays in NumPy's format."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lightdepth.errors import InputError


def read_array(path: Path) -> np.ndarray:
    """The array of a ``.npy`` file.

    Raises:
        InputError: it is none, damaged, or holds Python objects.
        OSError: it cannot be read.
    """
    with path.open("rb") as file:
        start = file.read(6)
    if start[:4] == b"PK\x03\x04":
        raise InputError(
            f"{path}: is an archive of arrays (.npz), though it is named .npy; save one array with numpy.save"
        )
    if start != b"\x93NUMPY":
        raise InputError(f"{path}: not a readable .npy file: it does not start like one")
    try:
        values: np.ndarray = np.load(path, allow_pickle=False)
    except Exception as error:  # A damaged header surfaces as whatever the parser met.
        raise InputError(
            f"{path}: not a readable .npy file: it is damaged, cut off, or holds Python objects"
        ) from error
    return values
