"""Points that two panoramas share, found by features (SIFT) in undistorted views all around."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import FloatArray, direction_to_latlong, euler_rotation
from lightdepth.parameters.calibration import DEFAULT, CalibrationParameters

VIEWS = ((0.0, 0.0, 6), (45.0, 0.0, 5), (-45.0, 36.0, 5))
"""Pitch, first yaw, and number of views around, degrees."""
FIELD = 80.0
"""Of view, degrees."""


def shared_features(
    first: NDArray[np.float32], second: NDArray[np.float32], tuned: CalibrationParameters = DEFAULT
) -> tuple[FloatArray, FloatArray]:
    """Directions, unit, light space of each panorama, shape (n, 3), of features that look alike.

    Args:
        first: linear RGB, shape (height, 2 height, 3).
        second: the same, of another size and exposure perhaps.
        tuned: how they are found.
    """
    directions, descriptions = zip(*(_features(radiance, tuned) for radiance in (first, second)), strict=True)
    if min(len(each) for each in descriptions) < 2:
        return np.zeros((0, 3)), np.zeros((0, 3))
    there = cv2.BFMatcher(cv2.NORM_L2).knnMatch(descriptions[0], descriptions[1], k=2)
    back = cv2.BFMatcher(cv2.NORM_L2).match(descriptions[1], descriptions[0])
    answer = {match.queryIdx: match.trainIdx for match in back}
    good = sorted(
        (pair[0] for pair in there if len(pair) == 2 and pair[0].distance < tuned.feature_ratio * pair[1].distance),
        key=lambda match: match.distance,
    )
    same = np.cos(np.radians(tuned.feature_same))
    found: list[tuple[FloatArray, FloatArray]] = []
    for match in good:
        one, other = directions[0][match.queryIdx], directions[1][match.trainIdx]
        # The same feature in two views of one panorama is as good an answer.
        returned = directions[0][answer[match.trainIdx]]
        if one @ returned < same:
            continue
        if not any(one @ a > same and other @ b > same for a, b in found):
            found.append((one, other))
    pairs = np.array(found, np.float64).reshape(-1, 2, 3)
    return pairs[:, 0], pairs[:, 1]


def _features(radiance: NDArray[np.float32], tuned: CalibrationParameters) -> tuple[FloatArray, NDArray[np.float32]]:
    """Directions and descriptions."""
    light = radiance.mean(axis=2)
    tones = np.log(np.maximum(light, 0.0) + 0.02 * float(np.median(light)) + 1e-9).astype(np.float32)
    low, high = np.percentile(tones, [1.0, 99.0])
    grey = np.clip(255.0 * (tones - low) / max(float(high - low), 1e-6), 0.0, 255.0).astype(np.uint8)
    height, width = grey.shape
    wrapped = np.concatenate([grey, grey[:, :1]], axis=1)
    side = int(np.clip(width * FIELD / 360.0, 64, tuned.feature_side))
    reach = 0.5 * side / np.tan(np.radians(0.5 * FIELD))
    y, x = np.mgrid[:side, :side] + 0.5
    rays = np.stack([x - 0.5 * side, np.full_like(x, reach), 0.5 * side - y], axis=-1)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    sift: Any = cv2.SIFT_create(nfeatures=tuned.features, contrastThreshold=tuned.feature_contrast)
    directions, descriptions = [np.zeros((0, 3))], [np.zeros((0, 128), np.float32)]
    for pitch, start, count in VIEWS:
        for number in range(count):
            yaw = start + 360.0 / count * number
            turn = euler_rotation([0.0, 0.0, -yaw]) @ euler_rotation([pitch, 0.0, 0.0])
            u, v = direction_to_latlong(rays @ turn.T)
            maps = ((u * width - 0.5) % width).astype(np.float32), (v * height - 0.5).astype(np.float32)
            view = cv2.remap(wrapped, *maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
            points, described = sift.detectAndCompute(view, None)
            if described is None:
                continue
            # OpenCV counts from the middle of the first pixel.
            at = np.array([point.pt for point in points]) + 0.5
            local = np.stack([at[:, 0] - 0.5 * side, np.full(len(at), reach), 0.5 * side - at[:, 1]], axis=-1)
            directions.append(local / np.linalg.norm(local, axis=1, keepdims=True) @ turn.T)
            descriptions.append(described)
    return np.concatenate(directions), np.concatenate(descriptions)
