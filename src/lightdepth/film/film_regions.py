"""Which part of the film rectangles cover: where two of them meet, and what none of them has."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from lightdepth.film.schedule import Region


def common(one: Region, other: Region) -> Region | None:
    """What two regions have in common; ``None`` where that is nothing."""
    left, top, right, bottom = (
        max(one[0], other[0]),
        max(one[1], other[1]),
        min(one[2], other[2]),
        min(one[3], other[3]),
    )
    return (left, top, right, bottom) if left < right and top < bottom else None


def gaps(regions: Sequence[Region], size: tuple[int, int]) -> list[Region]:
    """What regions leave of the film, in rectangles from the top, none of which meets another.

    Args:
        regions: that are covered.
        size: width and height of the film.
    """
    rows = sorted({0, size[1], *(row for region in regions for row in (region[1], region[3]))})
    found: list[Region] = []
    for top, bottom in pairwise(rows):
        covered = sorted((region[0], region[2]) for region in regions if region[1] <= top and bottom <= region[3])
        left = 0
        for first, beyond in [*covered, (size[0], size[0])]:
            if first > left:
                _append(found, (left, top, first, bottom))
            left = max(left, beyond)
    return found


def _append(found: list[Region], region: Region) -> None:
    """Append a rectangle, or lengthen the one of the same columns that ends where it begins."""
    for index, (left, top, right, bottom) in enumerate(found):
        if (left, right, bottom) == (region[0], region[2], region[1]):
            found[index] = (left, top, right, region[3])
            return
    found.append(region)
