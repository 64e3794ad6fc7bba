"""Indoors or in the open? Judged by the colour and the smoothness of what is above."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import FloatArray, direction_to_latlong, pixel_directions, pixel_solid_angles
from lightdepth.images.tonemapping import LUMINANCE
from lightdepth.parameters.quickstart import DEFAULT, QuickstartParameters


def open_sky_evidence(
    radiance: NDArray[np.float32], rotation: FloatArray, tuned: QuickstartParameters = DEFAULT
) -> float:
    """Share of the directions above the horizon whose light is as blue as that of the sky, in [0, 1].

    Args:
        radiance: the panorama, linear RGB, shape (height, 2 height, 3).
        rotation: light space to a level world, shape (3, 3).
        tuned: what counts as blue.
    """
    small, weight = _levelled(radiance, rotation, tuned.sky_rows)
    blue = np.log(np.maximum(small[..., 2], 1e-6) / np.maximum(small[..., 0], 1e-6)) > tuned.blue
    above = weight * (np.arange(tuned.sky_rows) < tuned.sky_rows // 2)[:, None]
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
    small, weight = _levelled(radiance, rotation, tuned.sky_rows)
    luminance = np.log(np.maximum(small @ LUMINANCE, 1e-6))
    rows, window = tuned.sky_rows, (tuned.smooth_window, tuned.smooth_window)
    mean, square = cv2.blur(luminance, window), cv2.blur(luminance**2, window)
    spread = np.sqrt(np.maximum(square - mean**2, 0.0))
    zenith, ground = slice(0, rows // 4), slice(9 * rows // 16, rows)
    smooth = float(np.average(spread[zenith] < tuned.smooth, weights=weight[zenith]))
    brighter = np.average(luminance[zenith], weights=weight[zenith]) - np.average(
        luminance[ground], weights=weight[ground]
    )
    return bool(smooth > tuned.smooth_share and brighter > np.log(tuned.grey_sky))


def _levelled(
    radiance: NDArray[np.float32], rotation: FloatArray, height: int
) -> tuple[NDArray[np.float32], FloatArray]:
    """The panorama turned level, small, and the solid angles of its pixels."""
    small = np.maximum(cv2.resize(radiance, (2 * height, height), interpolation=cv2.INTER_AREA), 0.0)
    u, v = direction_to_latlong(pixel_directions(height, 2 * height) @ rotation)
    rows = (v * height).astype(int).clip(0, height - 1)
    columns = (u * 2 * height).astype(int) % (2 * height)
    return small[rows, columns], np.repeat(pixel_solid_angles(height, 2 * height)[:, None], 2 * height, axis=1)
