"""Large layers of which little is not 0."""

from __future__ import annotations

import math
import mmap
from contextlib import suppress

import numpy as np
from numpy.typing import DTypeLike, NDArray

LARGE = 1 << 24
"""Bytes from which on it matters."""


def sparse_zeros(shape: tuple[int, ...], dtype: DTypeLike) -> NDArray:
    """Zeros that take memory only where something else is written, in pages of some kilobytes.

    NumPy asks the system for pages of megabytes, of which a single pixel makes a whole one resident: the layers of an
    image of 8192 x 8192 pixels, a tenth of which is new, then take several times what they hold.
    """
    size = math.prod(shape) * np.dtype(dtype).itemsize
    if size < LARGE or not hasattr(mmap, "MADV_NOHUGEPAGE"):
        return np.zeros(shape, dtype)
    memory = mmap.mmap(-1, size, flags=mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    with suppress(OSError):  # A kernel without huge pages has none to switch off.
        memory.madvise(mmap.MADV_NOHUGEPAGE)
    return np.frombuffer(memory, dtype).reshape(shape)
