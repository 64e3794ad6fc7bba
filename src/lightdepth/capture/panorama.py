"""Photographs with known lens and pose to one equirectangular panorama, all in linear radiance."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.capture.lens import Lens
from lightdepth.capture.photometry import Photograph, Photometry, half_diagonals
from lightdepth.directions import pixel_directions
from lightdepth.parameters.capture import DEFAULT, CaptureParameters

BAND = 64
"""Rows of the panorama computed at a time, so that memory stays small."""


@dataclass(frozen=True)
class Panorama:
    """An equirectangular panorama.

    Attributes:
        radiance: linear RGB, shape (height, width, 3), float32, 0 where uncovered.
        covered: directions that some photograph shows, shape (height, width), bool.
    """

    radiance: NDArray[np.float32]
    covered: NDArray[np.bool_]


def natural_width(lenses: Sequence[Lens]) -> int:
    """Width of a panorama that has as many pixels to a degree as the photographs, a multiple of 64."""
    density = float(np.median([lens.focal_length for lens in lenses]))
    return max(64, round(2.0 * np.pi * density / 64.0) * 64)


def blend(
    photographs: Sequence[Photograph], photometry: Photometry, width: int, tuned: CaptureParameters = DEFAULT
) -> Panorama:
    """Remap photographs and blend them by weights that fall toward their edges.

    Args:
        photographs: with optimised lenses and poses.
        photometry: corrections to apply.
        width: of the panorama in pixels, even.
        tuned: how weights fall.
    """
    height = width // 2
    total = np.zeros((height, width, 3), dtype=np.float32)
    weights = np.zeros((height, width), dtype=np.float32)
    directions = pixel_directions(height, width).astype(np.float32)
    for index, photograph in enumerate(photographs):
        pixels = corrected(photograph, photometry, index)
        weight = blending_weight(photograph.seen, tuned)
        # Bilinear lookup in a photograph that is no finer than the panorama does not alias.
        shrink = min(1.0, width / (2.0 * np.pi) / photograph.lens.focal_length)
        if shrink < 0.9:
            pixels = cv2.resize(pixels, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)
            weight = cv2.resize(weight, (pixels.shape[1], pixels.shape[0]), interpolation=cv2.INTER_AREA)
        scale = np.array([pixels.shape[1] / photograph.lens.width, pixels.shape[0] / photograph.lens.height])
        for rows, maps in _maps(photograph.lens, directions, scale):
            share = cv2.remap(weight, *maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
            if share.any():
                seen = cv2.remap(pixels, *maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
                total[rows] += seen * share[..., None]
                weights[rows] += share
    covered = weights > 0.0
    np.divide(total, weights[..., None], out=total, where=covered[..., None])
    return Panorama(total, covered)


def corrected(photograph: Photograph, photometry: Photometry, index: int) -> NDArray[np.float32]:
    """Radiance of a photograph without vignetting and with its gain, shape (height, width, 3), float32."""
    lens = photograph.lens
    y, x = np.mgrid[: lens.height, : lens.width] + 0.5
    falloff = photometry.falloff(half_diagonals(lens, x, y))[..., None]
    return (photograph.radiance * (photometry.gains[index] / falloff)).astype(np.float32)


def blending_weight(seen: NDArray[np.float32], tuned: CaptureParameters = DEFAULT) -> NDArray[np.float32]:
    """Weight of each pixel: its trust, times its distance from the photograph's edge to the power ``blend_sharpness``.

    Args:
        seen: trust, 0 outside the picture, shape (height, width).
        tuned: the power.
    """
    inside = cv2.copyMakeBorder((seen > 0.0).astype(np.uint8), 1, 1, 1, 1, cv2.BORDER_CONSTANT)
    distance = cv2.distanceTransform(inside, cv2.DIST_L2, 5)[1:-1, 1:-1]
    # The outermost pixel is half black: it counts nothing.
    distance = np.maximum(distance - 1.5, 0.0)
    return (distance / max(distance.max(), 1.0)) ** tuned.blend_sharpness * seen


def _maps(
    lens: Lens, directions: NDArray[np.float32], scale: NDArray[np.float64]
) -> Iterator[tuple[slice, tuple[NDArray[np.float32], NDArray[np.float32]]]]:
    """Bands of the panorama with the pixel of a photograph, scaled by ``scale``, that shows each direction."""
    for start in range(0, directions.shape[0], BAND):
        rows = slice(start, start + BAND)
        x, y = lens.project(directions[rows])
        # OpenCV counts from pixel centres; far outside stands for "not shown".
        maps = [np.nan_to_num(axis * factor - 0.5, nan=-1e4) for axis, factor in zip((x, y), scale, strict=True)]
        yield rows, tuple(np.clip(axis, -1e4, 1e5).astype(np.float32) for axis in maps)
