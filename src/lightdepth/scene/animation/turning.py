"""Rotations between keys: the short way from each to the next, and with no jolt at any."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicHermiteSpline
from scipy.spatial.transform import Rotation

FloatArray = NDArray[np.float64]


def turned_smoothly(frames: FloatArray, rotations: Rotation, frame: float) -> Rotation:
    """The rotation at a frame: at rest at both ends, of steady angular velocity, and still where two keys are alike.

    A spline of rotations that is as smooth as can be would swing beyond a key before it stands still. So, between two
    keys, the rotation vector from the first one is a cubic whose end velocities are limited as those of Fritsch and
    Carlson (1980) are for numbers, for each axis of the body.

    Args:
        frames: of the keys, strictly increasing, shape (n,), n >= 2.
        rotations: at the keys.
        frame: between the first key and the last.
    """
    ways = (rotations[:-1].inv() * rotations[1:]).as_rotvec()  # In the frame of either end: it is its own axis.
    spans = np.diff(frames)
    rates = np.zeros((len(frames), 3))
    rates[1:-1] = _limited(ways / spans[:, None], spans)
    here = int(np.clip(np.searchsorted(frames, frame, side="right") - 1, 0, len(spans) - 1))
    way = ways[here]
    slopes = np.stack([rates[here], _inverse_jacobian(way) @ rates[here + 1]])
    vector = CubicHermiteSpline(frames[here : here + 2], np.stack([np.zeros(3), way]), slopes)(frame)
    return rotations[here] * Rotation.from_rotvec(vector)


def _limited(rates: FloatArray, spans: FloatArray) -> FloatArray:
    """Rates at the inner keys out of those between the keys: weighted harmonic means, 0 where the direction turns."""
    before, after = rates[:-1], rates[1:]
    first, second = (2.0 * spans[1:] + spans[:-1])[:, None], (spans[1:] + 2.0 * spans[:-1])[:, None]
    together = before * after > 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        mean = (first + second) / (first / before + second / after)
    return np.where(together, mean, 0.0)


def _inverse_jacobian(way: FloatArray) -> FloatArray:
    """Turns an angular velocity of the body into the velocity of the rotation vector that is ``way``, shape (3, 3)."""
    angle = float(np.linalg.norm(way))
    x, y, z = way
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    if angle < 1e-4:
        return np.eye(3) + 0.5 * cross + cross @ cross / 12.0
    return np.eye(3) + 0.5 * cross + (1.0 / angle**2 - 0.5 / (angle * np.tan(0.5 * angle))) * (cross @ cross)
