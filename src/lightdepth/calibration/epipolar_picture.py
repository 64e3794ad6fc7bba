"""The picture by which a person judges how two panoramas are related: shared points and their epipolar lines in both."""

from __future__ import annotations

import colorsys

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.calibration.relative_pose import RelativePose, SharedPoints
from lightdepth.directions import FloatArray, direction_to_latlong
from lightdepth.images.tonemapping import auto_exposure, tone_map

WIDTH = 1600
MOST = 40
"""Points that are drawn."""


def draw_epipolar_picture(
    first: NDArray[np.float32],
    second: NDArray[np.float32],
    first_rotation: FloatArray,
    points: SharedPoints,
    pose: RelativePose,
) -> NDArray[np.uint8]:
    """The first panorama above the second, each point a ring in both.

    The line through a ring is where the other panorama says that the point must be: it must pass through the ring's middle.
    The cross is the other capture point.

    Args:
        first: linear RGB, shape (height, 2 height, 3).
        second: the same.
        first_rotation: light space of the first to world, shape (3, 3).
        points: shared points.
        pose: of the second panorama.

    Returns:
        sRGB.
    """
    chosen = np.unique(np.linspace(0, len(points.names) - 1, min(MOST, len(points.names))).astype(int))
    toward = (pose.position - points.origin) / max(float(np.linalg.norm(pose.position - points.origin)), 1e-9)
    seen = points.second @ pose.rotation.T
    halves = []
    for radiance, rotation, own, other, pole in (
        (first, first_rotation, points.first, seen, toward),
        (second, pose.rotation, seen, points.first, -toward),
    ):
        small = np.maximum(cv2.resize(radiance, (WIDTH, WIDTH // 2), interpolation=cv2.INTER_AREA), 0.0)
        picture = np.ascontiguousarray(tone_map(small, auto_exposure(small) - 0.5))
        for place, number in enumerate(chosen):
            red, green, blue = colorsys.hsv_to_rgb(place / len(chosen), 0.75, 1.0)
            colour = (round(255 * red), round(255 * green), round(255 * blue))
            # Rays of the other panorama's point, from its capture point to infinity, seen from here.
            share = np.linspace(0.0, 1.0, 400)[:, None]
            _line(picture, ((1.0 - share) * pole + share * other[number]) @ rotation, colour)
            centre = np.round(16.0 * _pixels(own[number] @ rotation)).astype(int)
            cv2.circle(picture, centre, 16 * 7, (20, 20, 20), 4, cv2.LINE_AA, 4)
            cv2.circle(picture, centre, 16 * 7, colour, 2, cv2.LINE_AA, 4)
        x, y = np.round(_pixels(pole @ rotation)).astype(int)
        cv2.drawMarker(picture, (int(x), int(y)), (255, 255, 255), cv2.MARKER_CROSS, 24, 2)
        halves += [picture, np.full((6, WIDTH, 3), 255, np.uint8)]
    return np.asarray(np.concatenate(halves[:-1]), np.uint8)


def _pixels(directions: FloatArray) -> FloatArray:
    u, v = direction_to_latlong(directions)
    return np.stack([u * WIDTH - 0.5, v * WIDTH / 2.0 - 0.5], axis=-1)


def _line(picture: NDArray[np.uint8], directions: FloatArray, colour: tuple[int, int, int]) -> None:
    at = _pixels(directions)
    at[:, 0] = np.unwrap(at[:, 0], period=WIDTH)
    for shift in (-WIDTH, 0, WIDTH):
        fixed = np.round(16.0 * (at + [shift, 0.0])).astype(np.int32)
        cv2.polylines(picture, [fixed], False, colour, 1, cv2.LINE_AA, 4)
