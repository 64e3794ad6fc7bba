"""A panorama for the screen with a grid of pixels and degrees, to read points off in any viewer."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.images.tonemapping import auto_exposure, tone_map

Picture = NDArray[np.uint8]

PIXELS = (255, 220, 60)
DEGREES = (90, 220, 255)
UNKNOWN = (230, 70, 220)
DEGREE_STEP = 30


def draw_grid(radiance: NDArray[np.float32], unknown: NDArray[np.bool_] | None = None) -> Picture:
    """Draw a grid over a panorama.

    Yellow lines and numbers are pixels, x along the upper edge and y along the left one; blue ones are degrees, to the
    right of the centre column along the lower edge and above the horizon along the right one.

    Args:
        radiance: the panorama, linear RGB, shape (height, 2 height, 3).
        unknown: pixels to hatch, shape (height, 2 height).

    Returns:
        sRGB, of the panorama's size, so that a viewer's coordinates are the panorama's own.
    """
    height, width = radiance.shape[:2]
    picture = tone_map(radiance, auto_exposure(radiance))
    if unknown is not None:
        hatched = unknown & (
            np.add.outer(np.arange(height), np.arange(width)) % max(8, width // 64) < max(2, width // 400)
        )
        picture[hatched] = UNKNOWN
    step = _round_step(width / 10)
    columns = np.arange(step, width, step)
    rows = np.arange(step, height, step)
    under = picture.astype(np.float32)
    thickness = max(1, width // 2048)
    for x in columns:
        _blend(picture, under, (slice(None), slice(x, x + thickness)), PIXELS, 0.3)
    for y in rows:
        _blend(picture, under, (slice(y, y + thickness), slice(None)), PIXELS, 0.3)
    azimuths = np.arange(-180 + DEGREE_STEP, 180, DEGREE_STEP)
    elevations = np.arange(-90 + DEGREE_STEP, 90, DEGREE_STEP)
    xs = np.rint((azimuths / 360.0 + 0.5) * width).astype(int)
    ys = np.rint((0.5 - elevations / 180.0) * height).astype(int)
    for x, angle in zip(xs, azimuths, strict=True):
        _blend(picture, under, (slice(None), slice(x, x + thickness)), DEGREES, 0.6 if angle == 0 else 0.3)
    for y, angle in zip(ys, elevations, strict=True):
        _blend(picture, under, (slice(y, y + thickness), slice(None)), DEGREES, 0.6 if angle == 0 else 0.3)
    size = max(0.3, 0.38 * width / 1024)
    gap = round(4 * width / 1024) + 1
    for x in columns:
        _write(picture, str(x), (x + gap, gap), size, PIXELS, left=True, top=True)
    for y in rows[rows < height - 8 * gap]:
        _write(picture, str(y), (gap, y + gap), size, PIXELS, left=True, top=True)
    for x, angle in zip(xs, azimuths, strict=True):
        _write(picture, f"{angle:+d} deg" if angle else "0 deg", (x + gap, height - gap), size, DEGREES, True, False)
    for y, angle in zip(ys, elevations, strict=True):
        _write(picture, f"{angle:+d} deg" if angle else "0 deg", (width - gap, y - gap), size, DEGREES, False, False)
    return picture


def _round_step(step: float) -> int:
    """The nearest of 1, 2, 5, 10, 20, 50 ..."""
    power = 10.0 ** np.floor(np.log10(max(step, 1.0)))
    return int(min((power * k for k in (1, 2, 5, 10)), key=lambda round_: abs(np.log(round_ / max(step, 1.0)))))


def _blend(
    picture: Picture, under: NDArray[np.float32], where: tuple[slice, slice], colour: tuple[int, int, int], share: float
) -> None:
    picture[where] = np.rint(under[where] * (1.0 - share) + share * np.array(colour, np.float32)).astype(np.uint8)


def _write(
    picture: Picture,
    words: str,
    corner: tuple[int, int],
    size: float,
    colour: tuple[int, int, int],
    left: bool,
    top: bool,
) -> None:
    """Words with a dark edge, of which one corner is given; kept inside the picture."""
    thickness = max(1, round(size * 1.5))
    (across, high), _ = cv2.getTextSize(words, cv2.FONT_HERSHEY_SIMPLEX, size, thickness)
    x = int(np.clip(corner[0] if left else corner[0] - across, 0, max(0, picture.shape[1] - across)))
    y = int(corner[1] + high if top else corner[1])
    for pen, extra in (((20, 20, 20), 3 * thickness), (colour, thickness)):
        cv2.putText(picture, words, (x, y), cv2.FONT_HERSHEY_SIMPLEX, size, pen, extra, cv2.LINE_AA)
