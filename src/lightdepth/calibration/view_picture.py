"""The picture by which a person judges the calibration of a photograph: world and clicks drawn over it."""

from __future__ import annotations

from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.calibration.check_picture import ASSUMED_HEIGHT, AXIS_COLOURS, CLICK_COLOUR, FARTHEST, Picture
from lightdepth.calibration.view_cues import ViewCues
from lightdepth.calibration.view_solve import ViewCalibration
from lightdepth.directions import FloatArray

_SAMPLES = 2049
_NEAREST = 0.05


def draw_view_picture(pixels: NDArray[np.uint8], result: ViewCalibration, cues: ViewCues) -> Picture:
    """Draw the world over a photograph, bent as its lens bends it.

    A grid of one metre on the floor, the world's axes of one metre at its origin, the horizon; every clicked line in the
    colour of its axis with the line that the solution has there drawn on beyond it, rings at clicks and crosses where the
    solution has the points.

    Args:
        pixels: the photograph, sRGB, shape (height, width, 3).
        result: the camera.
        cues: what was clicked.

    Returns:
        sRGB, of the photograph's size.
    """
    picture = np.ascontiguousarray((pixels * 0.75).astype(np.uint8))
    position = result.position if result.position is not None else np.array([0.0, 0.0, ASSUMED_HEIGHT])
    pen = _Pen(picture, result, position)
    under = position * [1.0, 1.0, 0.0]
    low, high = np.floor(under - FARTHEST), np.ceil(under + FARTHEST)
    for axis in (0, 1):
        for metre in np.arange(low[axis], high[axis] + 1.0):
            ends = np.zeros((2, 3))
            ends[:, axis], ends[0, 1 - axis], ends[1, 1 - axis] = metre, low[1 - axis], high[1 - axis]
            pen.line(ends, (225, 225, 225), 1)
    turns = np.radians(np.linspace(0.0, 360.0, 37))
    ring = position + 1e4 * np.stack([np.cos(turns), np.sin(turns), np.zeros_like(turns)], axis=1)
    for start, end in pairwise(ring):
        pen.line(np.stack([start, end]), (255, 255, 255), 1)
    for axis, colour in enumerate(AXIS_COLOURS):
        pen.line(np.stack([np.zeros(3), np.eye(3)[axis]]), colour, 4)
    for line in cues.lines:
        middle = result.camera.directions_of(line.clicks.mean(axis=0) / cues.size) @ result.rotation.T
        point = position + 3.0 * middle
        along = np.eye(3)[line.axis]
        pen.line(np.stack([point - 12.0 * along, point + 12.0 * along]), AXIS_COLOURS[line.axis], 1)
        for click in line.clicks:
            pen.ring(click, AXIS_COLOURS[line.axis])
    for cue in cues.points:
        pen.ring(cue.click, CLICK_COLOUR)
        pen.cross(cue.world, CLICK_COLOUR)
    for distance in cues.distances:
        for click in distance.clicks:
            pen.ring(click, CLICK_COLOUR)
    return picture


class _Pen:
    def __init__(self, picture: Picture, result: ViewCalibration, position: FloatArray) -> None:
        self.picture, self.result, self.position = picture, result, position
        self.weight = max(1, picture.shape[1] // 1200)

    def pixels(self, world: FloatArray) -> tuple[FloatArray, NDArray[np.bool_]]:
        """Positions in the picture, and whether they are near it, so that they can be drawn."""
        local = (world - self.position) @ self.result.rotation
        film, ahead = self.result.camera.film_of(local)
        near = ahead & (local[..., 1] > _NEAREST) & ((film > -1.0) & (film < 2.0)).all(axis=-1)
        height, width = self.picture.shape[:2]
        return film * [width, height] - 0.5, near

    def line(self, ends: FloatArray, colour: tuple[int, int, int], weight: int) -> None:
        """A straight edge between two world points, shape (2, 3), where it is in front of the camera."""
        local = (ends - self.position) @ self.result.rotation
        depth = local[:, 1]
        if depth.max() <= _NEAREST:
            return
        if depth.min() < _NEAREST:  # Cut what is behind the camera.
            share = (_NEAREST * 1.01 - depth[0]) / (depth[1] - depth[0])
            ends = ends.copy()
            ends[int(np.argmin(depth))] = ends[0] + share * (ends[1] - ends[0])
            depth = ((ends - self.position) @ self.result.rotation)[:, 1]
        # Even steps in the picture, not in the world.
        steps = np.linspace(0.0, 1.0, _SAMPLES)[:, None]
        shares = steps * depth[0] / (steps * depth[0] + (1.0 - steps) * depth[1])
        points, near = self.pixels(ends[0] + shares * (ends[1] - ends[0]))
        for part in np.split(np.arange(_SAMPLES), np.flatnonzero(~near)):
            part = part[near[part]]
            if len(part) > 1:
                fixed = np.round(points[part] * 16).astype(np.int32)
                cv2.polylines(self.picture, [fixed], False, colour, self.weight * weight, cv2.LINE_AA, 4)

    def ring(self, click: FloatArray, colour: tuple[int, int, int]) -> None:
        """A ring around a click, pixels."""
        centre = np.round((click - 0.5) * 16).astype(int)
        for tone, extra in (((20, 20, 20), 2), (colour, 0)):
            cv2.circle(self.picture, centre, 16 * 7 * self.weight, tone, self.weight * (1 + extra), cv2.LINE_AA, 4)

    def cross(self, world: FloatArray, colour: tuple[int, int, int]) -> None:
        """A cross where the solution has a world point."""
        at, near = self.pixels(world)
        if near:
            x, y = np.round(at).astype(int)
            cv2.drawMarker(
                self.picture, (int(x), int(y)), colour, cv2.MARKER_TILTED_CROSS, 12 * self.weight, self.weight
            )
