"""Points that a person clicked on the panorama, and the horizontal planes that they lie on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import direction_to_latlong, latlong_to_direction
from lightdepth.errors import InputError

FloatArray = NDArray[np.float64]

HORIZON = 0.5
"""A click on the floor lies at least this many degrees below the horizon, one on the ceiling as many above."""


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


def parse_clicks(text: str, size: tuple[int, int] | None, what: str) -> FloatArray:
    """Read clicks written as ``x,y x,y ...``.

    Args:
        text: pixels, x to the right and y down from the picture's upper left corner, so that the first pixel's centre
            is at 0.5,0.5; or, without a size, degrees to the right of the panorama's centre and above its horizon.
        size: height and width of the panorama in pixels; ``None`` for angles.
        what: the option, for messages.

    Returns:
        Unit vectors in light space, shape (n, 3).

    Raises:
        InputError: something else is written there, or a click lies outside the panorama.
    """
    clicks = []
    for word in text.split():
        try:
            x, y = (float(number) for number in word.split(","))
        except ValueError as error:
            raise InputError(f"{what}: '{word}' is no click; write each as x,y with a space between clicks") from error
        clicks.append((x, y))
    across, down = np.array(clicks, dtype=np.float64).reshape(-1, 2).T
    if size is None:
        low, high, unit = np.array([-360.0, -90.0]), np.array([360.0, 90.0]), "degrees"
        u, v = across / 360.0 + 0.5, 0.5 - down / 180.0
    else:
        low, high, unit = np.zeros(2), np.array([size[1], size[0]], dtype=np.float64), "pixels"
        u, v = across / size[1], down / size[0]
    for i, click in enumerate(clicks):
        if not np.all((np.array(click) >= low) & (np.array(click) <= high)):
            raise InputError(
                f"{what}: click {i + 1} is {click[0]:g},{click[1]:g}; allowed are x from {low[0]:g} to {high[0]:g} and "
                f"y from {low[1]:g} to {high[1]:g} {unit}"
            )
    return latlong_to_direction(u, v)


def on_level(directions: FloatArray, pose: Pose, height: float, what: str) -> FloatArray:
    """Where clicked directions meet a horizontal plane.

    Args:
        directions: light space, shape (n, 3).
        pose: of the panorama.
        height: of the plane, world z, metres.
        what: the option, for messages.

    Returns:
        World x and y, metres, shape (n, 2).

    Raises:
        InputError: a direction does not meet the plane.
    """
    world = pose.to_world(directions)
    rise = height - pose.position[2]
    elevation = np.degrees(np.arcsin(np.clip(world[:, 2], -1.0, 1.0)))
    for i, angle in enumerate(elevation):
        if angle * np.sign(rise) < HORIZON:
            side = "below" if rise < 0 else "above"
            raise InputError(
                f"{what}: click {i + 1} looks {angle:+.1f} degrees from the horizon, but the plane at height "
                f"{height:g} m lies {side} the capture point (height {pose.position[2]:g} m); it must be clicked "
                f"{side} the horizon"
            )
    return pose.position[:2] + world[:, :2] * (rise / world[:, 2])[:, None]
