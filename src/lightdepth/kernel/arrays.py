"""NumPy's arrays for Dr.Jit, which takes their memory as it is where it can.

Kernels are compiled for the alignment of what they read. NumPy's memory begins wherever the allocator happens to put it,
so that the same rendering would be compiled again in every other process; from here it begins where Dr.Jit's own does.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

ALIGNMENT = 64
"""Bytes."""


def aligned_empty(shape: int | tuple[int, ...], dtype: DTypeLike = np.float32) -> NDArray:
    """An array without contents whose memory is aligned."""
    kind = np.dtype(dtype)
    size = int(np.prod(shape)) * kind.itemsize
    memory = np.empty(size + ALIGNMENT, np.uint8)
    first = -memory.ctypes.data % ALIGNMENT
    return memory[first : first + size].view(kind).reshape(shape)


def aligned(values: ArrayLike, dtype: DTypeLike = np.float32) -> NDArray:
    """A flat copy of values, in C order, whose memory is aligned."""
    array = np.asarray(values)
    result = aligned_empty(array.shape, dtype)
    result[...] = array
    return result.reshape(-1)


def aligned_columns(rows: NDArray) -> list[NDArray]:
    """The columns of an array of shape (n, k), each as :func:`aligned` gives it."""
    return [aligned(column) for column in rows.T]
