"""Triangle strips."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def strip_triangles(indices: NDArray[np.int64], lengths: NDArray[np.int64]) -> NDArray[np.int64]:
    """Triangles of strips, shape (m, 3), all facing as the first of their strip.

    Args:
        indices: the vertices of all strips, one after the other; -1 begins a new strip within one.
        lengths: of each strip.
    """
    if not len(indices):
        return np.zeros((0, 3), np.int64)
    # Each strip's end is a break as well.
    places = np.cumsum(lengths)
    with_breaks = np.insert(indices, places, -1)
    breaks = with_breaks < 0
    last_break = np.maximum.accumulate(np.where(breaks, np.arange(len(with_breaks)), -1))
    number = np.arange(len(with_breaks)) - last_break - 1  # of each vertex within its strip
    corners = np.stack([with_breaks[:-2], with_breaks[1:-1], with_breaks[2:]], axis=1)
    inside = (corners >= 0).all(axis=1)
    odd = number[:-2] % 2 == 1
    corners[odd] = corners[odd][:, [1, 0, 2]]
    return corners[inside]
