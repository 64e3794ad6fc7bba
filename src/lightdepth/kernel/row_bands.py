"""Going through an image in bands of rows, few enough pixels at once for memory and enough for speed."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

PIXELS_AT_ONCE = 1 << 20


@dataclass(frozen=True)
class Band:
    """Some rows of an image.

    Attributes:
        rows: which rows of the image.
        shape: (number of rows, width).
        column: of each pixel, row by row.
        row: of each pixel, counted in the image.
    """

    rows: slice
    shape: tuple[int, int]
    column: mi.Float
    row: mi.Float


def bands(width: int, height: int) -> Iterator[Band]:
    """All pixels of an image of a width and height; the bands share their kernels."""
    most = max(1, PIXELS_AT_ONCE // width)
    for first in range(0, height, most):
        count = min(most, height - first)
        lane, columns = dr.arange(mi.UInt32, width * count), dr.opaque(mi.UInt32, width)
        column, row = mi.Float(lane % columns), mi.Float(lane // columns + dr.opaque(mi.UInt32, first))
        yield Band(slice(first, first + count), (count, width), column, row)
