"""From the frames' radiance to display values: exposure, and a tone curve or a view of OpenColorIO."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from lightdepth.delivery.frames import Frames, read_radiance
from lightdepth.delivery.video import REC709, REC2100_PQ, ColourTags
from lightdepth.errors import InputError
from lightdepth.images.look import Look
from lightdepth.images.tonemapping import auto_exposure

_BAND = 2**20
"""Pixels that are graded at once."""


@dataclass(frozen=True)
class Grade:
    """How a shot is graded, alike in all of its frames.

    Attributes:
        look: the curve or view.
        stops: exposure.
    """

    look: Look
    stops: float

    def pixels(self, file: Path, bits: Literal[8, 16]) -> NDArray[Any]:
        """A frame's picture for the display, R, G, B, shape (height, width, 3), uint8 or uint16."""
        radiance = read_radiance(file)
        most = np.float32(2**bits - 1)
        result = np.empty(radiance.shape, np.uint8 if bits == 8 else np.uint16)
        for rows in _bands(*radiance.shape[:2]):
            result[rows] = np.rint(self.look(radiance[rows], self.stops) * most)
        return result

    def tags(self, bits: int) -> ColourTags:
        """How a video's numbers are meant.

        Raises:
            InputError: the display is none of a video, or needs more bits.
        """
        display = self.look.display
        if "2100-PQ" in display:
            if bits < 10:
                raise InputError(f"--display '{display}': needs 10 bits; use the codec hevc, av1 or prores")
            return REC2100_PQ
        if any(name in display for name in ("P3", "HLG", "2020", "DCI", "XYZ")):
            raise InputError(
                f"--display '{display}': is not a display for video; choose an sRGB, Rec.709 or Rec.2100-PQ display"
            )
        return REC709


def grade(frames: Frames, look: Look, exposure: float) -> Grade:
    """The grade of a shot.

    Args:
        frames: the shot. Its exposure is that of the whole panorama, as for the PNGs beside the frames.
        look: the curve or view.
        exposure: stops by which it is lighter than that.
    """
    known = frames.exposure
    base = auto_exposure(read_radiance(frames.first)) if known is None else known
    return Grade(look, base + exposure)


def _bands(height: int, width: int) -> Iterator[slice]:
    rows = max(1, _BAND // max(1, width))
    for top in range(0, height, rows):
        yield slice(top, top + rows)
