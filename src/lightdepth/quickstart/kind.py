"""Indoors or in the open? Judged by the colour and the smoothness of what is above."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import FloatArray, direction_to_latlong, pixel_directions, pixel_solid_angles
from lightdepth.images.tonemapping import LUMINANCE
from lightdepth.parameters.quickstart import DEFAULT, QuickstartParameters

HEIGHT = 256


def open_sky_evidence(
    radiance: NDArray[np.float32], rotation: FloatArray, tuned: QuickstartParameters = DEFAULT
) -> float:
    """Share of the directions above the horizon whose light is as blue as that of the sky, in [0, 1].

    Args:
        radiance: the panorama, linear RGB, shape (height, 2 height, 3).
        rotation: light space to a level world, shape (3, 3).
        tuned: what counts as blue.
    """
    small, weight = _levelled(radiance, rotation)
    blue = np.log(np.maximum(small[..., 2], 1e-6) / np.maximum(small[..., 0], 1e-6)) > tuned.blue
    above = weight * (np.arange(HEIGHT) < HEIGHT // 2)[:, None]
    return float((above * blue).sum() / above.sum())


def is_open(
    radiance: NDArray[np.float32], rotation: FloatArray, has_walls: bool, tuned: QuickstartParameters = DEFAULT
) -> bool:
    """Whether the place is in the open.

    Args:
        radiance: the panorama, linear RGB, shape (height, 2 height, 3).
        rotation: light space to a level world, shape (3, 3).
        has_walls: straight edges show the directions of walls.
        tuned: how it is guessed.
    """
    if open_sky_evidence(radiance, rotation, tuned) >= tuned.blue_share:
        return True
    if has_walls:
        return False
    small, weight = _levelled(radiance, rotation)
    luminance = np.log(np.maximum(small @ LUMINANCE, 1e-6))
    mean, square = cv2.blur(luminance, (9, 9)), cv2.blur(luminance**2, (9, 9))
    spread = np.sqrt(np.maximum(square - mean**2, 0.0))
    zenith, ground = slice(0, HEIGHT // 4), slice(9 * HEIGHT // 16, HEIGHT)
    smooth = float(np.average(spread[zenith] < tuned.smooth, weights=weight[zenith]))
    brighter = np.average(luminance[zenith], weights=weight[zenith]) - np.average(
        luminance[ground], weights=weight[ground]
    )
    return bool(smooth > 0.8 and brighter > np.log(tuned.grey_sky))


def _levelled(radiance: NDArray[np.float32], rotation: FloatArray) -> tuple[NDArray[np.float32], FloatArray]:
    """The panorama turned level, small, and the solid angles of its pixels."""
    small = np.maximum(cv2.resize(radiance, (2 * HEIGHT, HEIGHT), interpolation=cv2.INTER_AREA), 0.0)
    u, v = direction_to_latlong(pixel_directions(HEIGHT, 2 * HEIGHT) @ rotation)
    rows = (v * HEIGHT).astype(int).clip(0, HEIGHT - 1)
    columns = (u * 2 * HEIGHT).astype(int) % (2 * HEIGHT)
    return small[rows, columns], np.repeat(pixel_solid_angles(HEIGHT, 2 * HEIGHT)[:, None], 2 * HEIGHT, axis=1)
