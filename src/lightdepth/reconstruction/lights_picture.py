"""Sources of light drawn over the panorama."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.images.tonemapping import auto_exposure, tone_map
from lightdepth.reconstruction.lights import Source

COLOUR = (255, 80, 60)


def draw_sources(radiance: NDArray[np.float32], sources: Sequence[Source]) -> NDArray[np.uint8]:
    """Outline the sources' cores and write beside each its number, from 1, its distance and its share of the light.

    Args:
        radiance: the panorama, linear RGB, shape (height, 2 height, 3).
        sources: strongest first.

    Returns:
        sRGB, 1024 to 2048 pixels wide.
    """
    width = int(np.clip(radiance.shape[1], 1024, 2048))
    height = width // 2
    method = cv2.INTER_AREA if radiance.shape[1] > width else cv2.INTER_LINEAR
    resized = np.maximum(cv2.resize(radiance, (width, height), interpolation=method), 0.0)
    picture = tone_map(resized, auto_exposure(resized) - 1.5)  # Dark, so that lamps differ from white walls.
    written: list[tuple[int, int, int]] = []
    for number, source in enumerate(sources, start=1):
        core = cv2.resize(source.pixels.astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST)
        outlines, _ = cv2.findContours(core, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
        cv2.drawContours(picture, outlines, -1, COLOUR, 1, cv2.LINE_AA)
        x, y = source.u * width, source.v * height
        cv2.circle(picture, (round(x), round(y)), 9 * width // 1024, COLOUR, 1 + width // 2048, cv2.LINE_AA)
        where = "sky" if source.position is None else f"{source.distance:.2f} m"
        _write(picture, f"{number}: {where}, {100 * source.share:.1f} %", x + 14 * width / 1024, y, written)
    return picture


def _write(picture: NDArray[np.uint8], words: str, x: float, y: float, written: list[tuple[int, int, int]]) -> None:
    """Words with a dark edge, kept inside the picture and below words that are there: left, baseline and width each."""
    height, width = picture.shape[:2]
    size = 0.45 * width / 1024
    (across, high), _ = cv2.getTextSize(words, cv2.FONT_HERSHEY_SIMPLEX, size, 1)
    left, line = int(np.clip(x, 2, width - across - 2)), int(np.clip(y + high / 2, high + 2, height - 4))
    for other_left, other_line, other_across in sorted(written, key=lambda other: other[1]):
        if left < other_left + other_across and other_left < left + across and abs(line - other_line) < high + 4:
            line = min(other_line + high + 4, height - 4)
    written.append((left, line, across))
    for colour, thickness in (((20, 20, 20), 4), ((255, 225, 120), 1)):
        cv2.putText(picture, words, (left, line), cv2.FONT_HERSHEY_SIMPLEX, size, colour, thickness, cv2.LINE_AA)
