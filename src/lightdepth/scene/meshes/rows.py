"""Equal rows of tables."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def unique_rows(table: NDArray[np.generic]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Different rows of a table, in ascending order by its columns from the left.

    Does what ``np.unique`` does along an axis, in a fraction of the time.

    Args:
        table: shape (n, k), numbers.

    Returns:
        Where each different row stands first, shape (m,), and which of these each row is, shape (n,).
    """
    rank = np.zeros(len(table), np.int64)
    for column in table.T:
        values, position = np.unique(column, return_inverse=True)
        _, rank = np.unique(rank * max(len(values), 1) + position, return_inverse=True)
    first = np.full(int(rank.max(initial=-1)) + 1, len(table), np.int64)
    np.minimum.at(first, rank, np.arange(len(table)))
    return first, rank
