"""Clicks on a panorama, as a person writes them, to directions of light space."""

from __future__ import annotations

import re

import numpy as np

from lightdepth.directions import FloatArray, latlong_to_direction
from lightdepth.errors import InputError


def read_clicks(text: str, size: tuple[int, int] | None, option: str, count: int | None = None) -> FloatArray:
    """Read clicks written as ``"x,y x,y ..."``; spaces or semicolons part them.

    Args:
        text: pixels, x to the right and y down from the picture's upper left corner, so that the first pixel's centre
            is at 0.5,0.5 and an x beyond the left or right edge continues on the other side; or, without a size,
            degrees to the right of the panorama's centre column and above its middle row.
        size: height and width of the panorama in pixels; ``None`` for angles.
        option: the command-line option that the text belongs to, for messages.
        count: how many clicks there must be; ``None`` allows any number.

    Returns:
        Unit vectors in light space, shape (n, 3), float64.

    Raises:
        InputError: another number of clicks, something that is not two finite numbers, or a click that is not on the
            panorama.
    """
    words = re.split(r"[\s;]+", re.sub(r"\s*,\s*", ",", text.strip()))
    clicks = []
    for word in filter(None, words):
        try:
            x, y = (float(number) for number in word.split(","))
        except ValueError:
            raise InputError(
                f"{option}: '{word}' is not a point; write each one as x,y with spaces between them"
            ) from None
        clicks.append((x, y))
    if count is not None and len(clicks) != count:
        raise InputError(f"{option}: {len(clicks)} points, {count} {'is' if count == 1 else 'are'} needed")
    across, along = np.array(clicks, dtype=np.float64).reshape(-1, 2).T
    if size is None:
        low, high, unit = (-360, -90), (360, 90), "degrees"
        u, v = across / 360.0 + 0.5, 0.5 - along / 180.0
    else:
        height, width = size
        low, high, unit = (-width, 0), (2 * width, height), f"pixels in this panorama of {width} x {height}"
        u, v = across / width, along / height
    for number, (x, y) in enumerate(clicks, start=1):
        if not (low[0] <= x <= high[0] and low[1] <= y <= high[1]):  # Nor is it where a number is not finite.
            raise InputError(
                f"{option}: point {number} is {x:g},{y:g}; allowed are x from {low[0]} to {high[0]} and y from "
                f"{low[1]} to {high[1]} {unit}"
            )
    return latlong_to_direction(u, v)
