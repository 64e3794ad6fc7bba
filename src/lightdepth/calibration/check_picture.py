"""The picture by which a person judges a calibration: the world's grid and axes drawn over the panorama."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.calibration.room_frame import RoomFrame
from lightdepth.calibration.solve import Calibration
from lightdepth.directions import FloatArray, direction_to_latlong, pixel_directions
from lightdepth.images.tonemapping import auto_exposure, tone_map

Picture = NDArray[np.uint8]

AXIS_COLOURS = ((235, 70, 60), (90, 200, 70), (80, 140, 255))
"""Red, green and blue for x, y and z, as everywhere."""
CLICK_COLOUR = (255, 210, 40)
ASSUMED_HEIGHT = 1.6
"""Metres of the camera above the floor, for the grid only, where no cue gives it."""
FARTHEST = 12.0
"""Metres to which the grid is drawn."""


def draw_check_picture(
    radiance: NDArray[np.float32],
    calibration: Calibration,
    room: RoomFrame | None = None,
    clicks: Sequence[FloatArray] = (),
) -> Picture:
    """Draw the world over the panorama.

    On the floor a grid of one metre (every fifth line stronger), at the world's origin its axes of one metre (x red,
    y green, z blue), the horizon as a line with the directions of the axes, a thin plumb line at each of them; the
    floor rectangle as solved, the clicks as rings; where it was found automatically, the room's edges in the colour of
    their axis.

    Args:
        radiance: the panorama, linear RGB, shape (height, 2 height, 3).
        calibration: the pose to draw.
        room: the edges to draw.
        clicks: for each cue its clicked directions in light space, shape (n, 3).

    Returns:
        sRGB, between 1024 and 4096 pixels wide.
    """
    width = int(np.clip(radiance.shape[1], 1024, 4096))
    if radiance.shape[1] != width:
        method = cv2.INTER_AREA if radiance.shape[1] > width else cv2.INTER_CUBIC
        radiance = np.maximum(cv2.resize(radiance, (width, width // 2), interpolation=method), 0.0)
    # A little darker than usual, so that the lines stand out.
    picture = tone_map(radiance, auto_exposure(radiance) - 0.5)
    pen = _Pen(picture, calibration.rotation, max(1, width // 1200))
    position = calibration.position if calibration.position is not None else np.array([0.0, 0.0, ASSUMED_HEIGHT])
    _blend_floor_grid(picture, calibration.rotation, position)
    if room is not None:
        for ends, axis in zip(room.arcs.ends, room.axis, strict=True):
            if axis >= 0:
                pen.arc(ends @ calibration.rotation.T, AXIS_COLOURS[axis], 1)
    _draw_horizon(pen)
    if calibration.corners is not None:
        corners = calibration.corners - position
        for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
            pen.arc(np.stack([start, end]), CLICK_COLOUR, 1)
    origin = -position
    for axis, (name, colour) in enumerate(zip("xyz", AXIS_COLOURS, strict=True)):
        tip = origin + np.eye(3)[axis]
        pen.arc(np.stack([origin, tip]), colour, 2)
        pen.text(tip + 0.08 * np.eye(3)[axis], name, colour)
    for cue in clicks:
        for direction in cue @ calibration.rotation.T:
            pen.ring(direction, CLICK_COLOUR)
    return picture


class _Pen:
    """Draws in world directions from the camera, across the panorama's edges."""

    def __init__(self, picture: Picture, rotation: FloatArray, thickness: int):
        self.picture = picture
        self.rotation = rotation
        self.thickness = thickness

    def pixels(self, directions: FloatArray) -> FloatArray:
        """Positions in the picture, shape (..., 2), of directions from the camera in world axes."""
        height, width = self.picture.shape[:2]
        u, v = direction_to_latlong(directions @ self.rotation)
        return np.stack([u * width - 0.5, v * height - 0.5], axis=-1)

    def arc(self, ends: FloatArray, colour: tuple[int, int, int], weight: int) -> None:
        """A straight edge between two points, shape (2, 3), seen from the camera."""
        points = self.pixels(ends[0] + np.linspace(0.0, 1.0, 97)[:, None] * (ends[1] - ends[0]))
        width = self.picture.shape[1]
        # What crosses the left or right edge is drawn beyond it, and again a picture's width further.
        points[:, 0] = np.unwrap(points[:, 0], period=width)
        for shift in (-width, 0, width):
            fixed = np.round((points + np.array([shift, 0])) * 16).astype(np.int32)
            cv2.polylines(self.picture, [fixed], False, colour, self.thickness * weight, cv2.LINE_AA, 4)

    def ring(self, direction: FloatArray, colour: tuple[int, int, int]) -> None:
        """A ring around a click."""
        centre = np.round(self.pixels(direction) * 16).astype(int)
        cv2.circle(self.picture, centre, 16 * 6 * self.thickness, colour, self.thickness, cv2.LINE_AA, 4)

    def text(self, direction: FloatArray, words: str, colour: tuple[int, int, int]) -> None:
        """Words around a direction, with a dark edge."""
        size = 0.5 * self.thickness
        (across, high), _ = cv2.getTextSize(words, cv2.FONT_HERSHEY_SIMPLEX, size, self.thickness)
        x, y = np.round(self.pixels(direction) + np.array([-across / 2, high / 2])).astype(int)
        for pen_colour, extra in (((20, 20, 20), 3 * self.thickness), (colour, self.thickness)):
            cv2.putText(
                self.picture, words, (int(x), int(y)), cv2.FONT_HERSHEY_SIMPLEX, size, pen_colour, extra, cv2.LINE_AA
            )


def _blend_floor_grid(picture: Picture, rotation: FloatArray, position: FloatArray) -> None:
    """Blend lines of a few pixels where the floor's x or y is a whole number of metres; they fade with distance."""
    height, width = picture.shape[:2]
    directions = pixel_directions(height, width) @ rotation.T
    distance = position[2] / np.maximum(-directions[..., 2], 1e-3)
    cover = np.zeros((height, width))
    for axis in (0, 1):
        metres = position[axis] + distance * directions[..., axis]
        pixel = np.hypot(*np.gradient(metres))  # How much a step of one pixel changes it.
        for spacing, strength in ((1.0, 0.4), (5.0, 0.8)):
            off = np.abs(metres - spacing * np.round(metres / spacing))
            line = np.clip(0.5 + width / 2048 - off / np.maximum(pixel, 1e-9), 0.0, 1.0)
            cover = np.maximum(cover, strength * line)
    cover *= np.clip(1.5 * (1.0 - distance / FARTHEST), 0.0, 1.0)
    under = picture.astype(np.float64)
    picture[:] = np.rint(under + cover[..., None] * (255.0 - under))


def _draw_horizon(pen: _Pen) -> None:
    """The horizon, plumb lines at the four directions of the axes, and their names."""
    angles = np.radians(np.arange(0.0, 361.0, 10.0))
    circle = np.stack([np.cos(angles), np.sin(angles), np.zeros_like(angles)], axis=-1)
    for start, end in pairwise(circle):
        pen.arc(np.stack([start, end]), (255, 255, 255), 1)
    for axis, sign, name in ((0, 1, "+x"), (0, -1, "-x"), (1, 1, "+y"), (1, -1, "-y")):
        direction = sign * np.eye(3)[axis]
        up = np.array([0.0, 0.0, 1.0])
        pen.arc(np.stack([direction - up, direction + up]), (255, 255, 255), 1)
        pen.text(direction + 0.05 * up, name, AXIS_COLOURS[axis])
