"""Unseen sky: a wall occludes it from the capture point, and other points see it through a window.

The photograph shows the wall in that direction, which is no sky at all. What it does show of the sky at the same elevation
is the better guess.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

BANDS = 181
"""Elevations at which the sky's radiance is tabulated, from -90 to 90 degrees."""
HALF_BAND = 1.5
"""Degrees of elevation to each side from which it is taken."""
FEWEST = 8
"""Pixels of sky that this needs; with fewer, the nearest elevation that has them is taken."""
BRIGHTEST = 4.0
"""Pixels are clamped to this many times the median: bright clouds count, the sun does not."""


def sky_by_elevation(
    radiance: NDArray[np.float32], sky: NDArray[np.bool_], upward: NDArray[np.float64]
) -> NDArray[np.float32] | None:
    """The sky's mean radiance at each elevation: without the sun, which stands in one place only.

    Args:
        radiance: of the panorama, linear RGB, shape (height, 2 height, 3).
        sky: pixels in which the capture point sees no real surface, shape (height, 2 height).
        upward: world z of the pixels' directions, shape (height, 2 height).

    Returns:
        Linear RGB, shape (``BANDS``, 3), float32, by elevation from -90 to 90 degrees; ``None`` where hardly any sky is
        seen.
    """
    elevation = np.degrees(np.arcsin(np.clip(upward[sky], -1.0, 1.0)))
    order = np.argsort(elevation)
    elevation, colours = elevation[order], radiance[sky][order]
    bands = np.linspace(-90.0, 90.0, BANDS)
    first, last = np.searchsorted(elevation, bands - HALF_BAND), np.searchsorted(elevation, bands + HALF_BAND)
    valid = np.flatnonzero(last - first >= FEWEST)
    if not len(valid):
        return None
    table = np.array([_mean(colours[first[band] : last[band]]) for band in valid])
    nearest = valid[np.argmin(np.abs(valid[None, :] - np.arange(BANDS)[:, None]), axis=1)]
    return np.asarray(table[np.searchsorted(valid, nearest)], dtype=np.float32)


def _mean(colours: NDArray[np.float32]) -> NDArray[np.float32]:
    return np.asarray(np.minimum(colours, BRIGHTEST * np.median(colours, axis=0)).mean(axis=0))
