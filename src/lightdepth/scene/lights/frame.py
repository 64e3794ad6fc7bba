"""The plane across a sun's direction, in which its shadow map and its mask lie."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray


def sun_axes(direction: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Unit vectors across a unit direction of shape (3,), world: to the right, which is level, and up."""
    axis = np.asarray(direction, np.float64)
    right = np.cross([0.0, 0.0, 1.0], axis)
    if np.linalg.norm(right) < 1e-6:  # A sun at the zenith.
        right = np.array([1.0, 0.0, 0.0])
    right /= np.linalg.norm(right)
    return right, np.cross(axis, right)


def sun_direction(azimuth: float, elevation: float) -> NDArray[np.float64]:
    """Unit vector toward a sun, world, shape (3,).

    Args:
        azimuth: degrees, clockwise from +y as seen from above.
        elevation: degrees above the horizon.
    """
    around, above = math.radians(azimuth), math.radians(elevation)
    return np.array([math.sin(around) * math.cos(above), math.cos(around) * math.cos(above), math.sin(above)])


def azimuth_and_elevation(direction: ArrayLike) -> tuple[float, float]:
    """The inverse of :func:`sun_direction`: degrees, the azimuth in [0, 360)."""
    x, y, z = (float(value) for value in np.asarray(direction) / np.linalg.norm(direction))
    return math.degrees(math.atan2(x, y)) % 360.0, math.degrees(math.asin(max(-1.0, min(1.0, z))))
