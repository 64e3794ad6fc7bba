"""The panorama's pose, and where clicked directions meet the horizontal planes that they lie on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import direction_to_latlong
from lightdepth.errors import InputError
from lightdepth.parameters.reconstruction import DEFAULT, ClickParameters

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Pose:
    """Where the panorama was taken.

    Attributes:
        position: capture point, world, metres, shape (3,), float64.
        rotation: light space to world, shape (3, 3), float64.
    """

    position: FloatArray
    rotation: FloatArray

    def to_world(self, directions: FloatArray) -> FloatArray:
        """Directions of light space turned into the world, shape (..., 3)."""
        return directions @ self.rotation.T

    def to_panorama(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Panorama coordinates (u, v) in [0, 1] at which world points of shape (..., 3) are seen."""
        return direction_to_latlong((points - self.position) @ self.rotation)


def on_level(
    directions: FloatArray, pose: Pose, height: float, what: str, tuned: ClickParameters = DEFAULT.clicks
) -> FloatArray:
    """Where clicked directions meet a horizontal plane.

    Args:
        directions: light space, shape (n, 3).
        pose: of the panorama.
        height: of the plane, world z, metres.
        what: the option, for messages.
        tuned: how far from the horizon clicks must lie.

    Returns:
        World x and y, metres, shape (n, 2).

    Raises:
        InputError: a direction does not meet the plane.
    """
    world = pose.to_world(directions)
    rise = height - pose.position[2]
    elevation = np.degrees(np.arcsin(np.clip(world[:, 2], -1.0, 1.0)))
    for i, angle in enumerate(elevation):
        if angle * np.sign(rise) < tuned.horizon:
            side = "below" if rise < 0 else "above"
            raise InputError(
                f"{what}: click {i + 1} looks {angle:+.1f} degrees from the horizon, but the plane at height "
                f"{height:g} m lies {side} the capture point (height {pose.position[2]:g} m); it must be clicked "
                f"{side} the horizon"
            )
    return pose.position[:2] + world[:, :2] * (rise / world[:, 2])[:, None]
