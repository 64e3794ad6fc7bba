"""Straight edges of the real place, found in a panorama."""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.calibration.arcs import Arcs
from lightdepth.directions import FloatArray, direction_to_latlong, euler_rotation
from lightdepth.images.tonemapping import LUMINANCE
from lightdepth.parameters.calibration import DEFAULT, CalibrationParameters

VIEW_DEGREES = 80.0
VIEWS = tuple(
    euler_rotation([0, 0, azimuth]) @ euler_rotation([elevation, 0, 0])
    for elevation, count in ((0, 8), (45, 8), (-45, 8), (90, 1), (-90, 1))
    for azimuth in np.arange(count) * (360.0 / count)
)
"""Rotations, camera to light space, of the tangent views; each looks along its second column."""

LAPLACIAN = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32) / 6.0
"""Answers to noise with its own standard deviation, and neither to slopes nor to straight edges along rows or columns."""
QUARTILE = 0.3186
"""Of the absolute value of a normal distribution of standard deviation 1."""


def detect_arcs(
    radiance: NDArray[np.float32],
    progress: Callable[[float], None] = lambda share: None,
    tuned: CalibrationParameters = DEFAULT,
) -> Arcs:
    """Find straight edges with OpenCV's line segment detector (von Gioi et al. 2010) in overlapping tangent views.

    Straight lines stay straight in a gnomonic (tangent plane) view, which they do not in the panorama itself. An edge
    that several views see is kept from the one whose centre is nearest to it.

    Args:
        radiance: the panorama, linear RGB, finite, shape (height, 2 height, 3), float32.
        progress: is called with the share done, in [0, 1].
        tuned: how they are found.

    Returns:
        The edges as arcs of great circles in light space.
    """
    largest = tuned.edge_largest_width
    if radiance.shape[1] > largest:
        radiance = cv2.resize(radiance, (largest, largest // 2), interpolation=cv2.INTER_AREA)
    brightness = _without_noise(display_brightness(radiance), tuned)
    half_width = np.tan(np.radians(VIEW_DEGREES / 2))
    size = round(tuned.edge_fineness * 2 * half_width * brightness.shape[1] / (2 * np.pi))
    tangent = ((np.arange(size) + 0.5) / size * 2 - 1) * half_width
    rays = np.stack(np.broadcast_arrays(tangent[None, :], 1.0, -tangent[:, None]), axis=-1)
    centres = np.array([view[:, 1] for view in VIEWS])
    detector = cv2.createLineSegmentDetector(cv2.LSD_REFINE_ADV)
    ends = [np.empty((0, 2, 3))]
    for index, view in enumerate(VIEWS):
        picture = sample_panorama(brightness, rays @ view.T)
        found = detector.detect(np.clip(picture * 255, 0, 255).astype(np.uint8))[0]
        if found is not None:
            # The detector counts from the first pixel's centre.
            plane = ((found.reshape(-1, 2, 2).astype(np.float64) + 0.5) / size * 2 - 1) * half_width
            directions = np.stack([plane[..., 0], np.ones(plane.shape[:2]), -plane[..., 1]], axis=-1) @ view.T
            directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
            ends.append(directions[np.argmax(directions.sum(axis=1) @ centres.T, axis=1) == index])
        progress((index + 1) / len(VIEWS))
    arcs = Arcs(np.concatenate(ends))
    return arcs.take(arcs.length > np.radians(tuned.edge_shortest))


def display_brightness(radiance: NDArray[np.float32]) -> NDArray[np.float32]:
    """Logarithm of luminance, scaled so that the picture's darkest and brightest parts are at 0 and 1, float32."""
    luminance = radiance @ LUMINANCE
    lit = luminance[luminance > 0]
    if lit.size == 0:
        return np.zeros(luminance.shape, dtype=np.float32)
    low, high = np.log2(np.percentile(lit, [2.0, 99.5]))
    low = max(low, high - 10.0)  # Ten stops: what is darker holds noise, not edges.
    brightness = (np.log2(np.maximum(luminance, 1e-30)) - low) / max(high - low, 1e-6)
    return np.clip(brightness, 0.0, 1.0).astype(np.float32)


def _without_noise(brightness: NDArray[np.float32], tuned: CalibrationParameters) -> NDArray[np.float32]:
    """A panorama's brightness in [0, 1], with non-local means (Buades et al. 2011) where there is much noise."""
    # The calmest quarter of the picture: what is left of texture and edges there is least (Immerkaer 1996).
    noise = 255.0 * float(np.percentile(np.abs(cv2.filter2D(brightness, -1, LAPLACIAN)), 25.0)) / QUARTILE
    if noise <= tuned.edge_noisy:
        return brightness
    margin = 16
    around = np.pad(np.rint(brightness * 255.0).astype(np.uint8), ((0, 0), (margin, margin)), mode="wrap")
    clean = cv2.fastNlMeansDenoising(around, None, tuned.edge_denoising * noise, 5, 21)
    return np.divide(clean[:, margin:-margin], np.float32(255.0), dtype=np.float32)


def sample_panorama(image: NDArray[np.float32], directions: FloatArray) -> NDArray[np.float32]:
    """Bicubic lookup of a panorama with one channel, shape of ``directions`` without its last axis."""
    height, width = image.shape
    u, v = direction_to_latlong(directions)
    margin = 4  # The panorama goes on beyond its left and right edges.
    padded = np.concatenate([image[:, -margin:], image, image[:, :margin]], axis=1)
    column = (u * width - 0.5 + margin).astype(np.float32)
    row = (v * height - 0.5).astype(np.float32)
    return cv2.remap(padded, column, row, cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
