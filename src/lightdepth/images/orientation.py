"""How a camera was held: the orientation that EXIF metadata state, and pictures turned upright by it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

_QUARTERS = {3: 2, 6: 3, 8: 1}
"""Quarter turns to the left that make a picture upright."""
_MIRRORED = {2: 1, 4: 3, 5: 8, 7: 6}
"""What is left of an EXIF orientation once left and right are exchanged."""


def mirrored_back(orientation: int) -> tuple[int, int]:
    """Part an EXIF orientation into a mirroring and a turn.

    Returns:
        ``(mirroring, turn)``: 2 where left and right must be exchanged first, else 1; and the orientation without that,
        one of 1, 3, 6 and 8.
    """
    return (2, _MIRRORED[orientation]) if orientation in _MIRRORED else (1, orientation)


def upright(pixels: NDArray, orientation: int) -> NDArray:
    """Pixels, shape (height, width, ...), turned upright by their EXIF orientation; unknown ones change nothing."""
    mirroring, turn = mirrored_back(orientation)
    if mirroring == 2:
        pixels = pixels[:, ::-1]
    return np.ascontiguousarray(np.rot90(pixels, _QUARTERS.get(turn, 0)))
