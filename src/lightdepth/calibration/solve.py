"""The panorama's pose in the world, from all cues at once by weighted least squares."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from lightdepth.calibration.arcs import Arcs
from lightdepth.calibration.rectangle import (
    FloorRectangle,
    check_shape,
    fit_parallelogram,
    put_in_order,
    tangents,
)
from lightdepth.calibration.room_frame import RoomFrame
from lightdepth.directions import FloatArray, euler_rotation
from lightdepth.errors import InputError
from lightdepth.parameters.calibration import DEFAULT, CalibrationParameters

ORIGINS = ("corner", "centre", "camera")
"""Where the world's origin can be on the floor."""


@dataclass(frozen=True)
class Cues:
    """What a person knows about the panorama's pose.

    Attributes:
        rectangle: on the floor; its first side gives the world's x axis where no heading is given.
        verticals: plumb edges, as arcs.
        heading: a direction in light space that lies ``bearing`` degrees clockwise (seen from above) of +y, shape (3,).
        bearing: degrees.
        room: the room's directions, found automatically.
        camera_height: of the capture point above the floor, metres.
        click_error: standard deviation of a click along either axis, degrees.
    """

    rectangle: FloorRectangle | None = None
    verticals: Arcs | None = None
    heading: FloatArray | None = None
    bearing: float = 0.0
    room: RoomFrame | None = None
    camera_height: float | None = None
    click_error: float = 0.2


@dataclass(frozen=True)
class Calibration:
    """The panorama's pose.

    Attributes:
        rotation: light space to world, shape (3, 3).
        position: capture point, world, metres, shape (3,); ``None`` where no cue gives it.
        residual: root mean square of the angles by which the clicks (automatic: the edges) miss the solution, degrees.
        residuals: the same for each cue.
        expected_error: standard deviation of the rotation that the cues' errors lead to, degrees; ``None`` where the
            panorama was only taken as level.
        corners: the rectangle's corners on the floor, world, metres, shape (4, 3), counter-clockwise.
        warnings: what the person should look at.
        confidence: of the automatic part in [0, 1], where it was used.
    """

    rotation: FloatArray
    position: FloatArray | None
    residual: float
    residuals: Mapping[str, float]
    expected_error: float | None
    corners: FloatArray | None = None
    warnings: tuple[str, ...] = ()
    confidence: float | None = None

    @property
    def rectangle_size(self) -> tuple[float, float] | None:
        """Width and length of the floor rectangle, metres."""
        if self.corners is None:
            return None
        first, second, third = self.corners[:3]
        return float(np.linalg.norm(second - first)), float(np.linalg.norm(third - second))

    @property
    def tilt(self) -> float:
        """Angle between the panorama's zenith and the world's, degrees."""
        return float(np.degrees(np.arccos(np.clip(self.rotation[2, 2], -1.0, 1.0))))


def calibrate(cues: Cues, origin: str = "corner", tuned: CalibrationParameters = DEFAULT) -> Calibration:
    """Find the pose that fits all cues best.

    The unknowns are the rotation and, with a rectangle, the camera's place over it and the rectangle's size. Every cue
    is an error in units of its own standard deviation: clicks by ``click_error``, measured lengths by ``measure_error``,
    the room's directions by their spread. The level follows from all cues together. The heading follows from the first of
    these that is given: ``heading``, the rectangle (with the walls where parallel to it), the walls; else the
    panorama's centre column looks along +y.

    Args:
        cues: what is known.
        origin: where the world's origin is on the floor: at the rectangle's first corner, at its centre, or under the
            camera; without a rectangle always under the camera.
        tuned: what is taken for an error, and what for a contradiction.

    Raises:
        InputError: the cues do not suffice or are impossible.
    """
    _check(cues, origin)
    warnings: list[str] = []
    rectangle = cues.rectangle
    if rectangle is not None:
        rectangle, found = put_in_order(rectangle)
        warnings += found + check_shape(rectangle, cues.camera_height, cues.click_error, tuned)
    problem = _Problem(cues, rectangle, tuned)
    warnings += problem.warnings
    start = problem.start()
    solution = least_squares(problem.errors, start, method="lm", x_scale="jac", xtol=1e-10, ftol=1e-10)
    rotation, camera, corners = problem.unpack(solution.x)
    zero = np.zeros(3)
    if corners is not None and camera is not None and origin != "corner":
        zero = corners.mean(axis=0) if origin == "centre" else camera * [1.0, 1.0, 0.0]
    residuals = problem.residuals(solution.x)
    clicked = [value for name, value in residuals.items() if name != "room"]
    counts = [problem.click_counts[name] for name in residuals if name != "room"]
    residual = float(np.sqrt(np.average(np.square(clicked), weights=counts))) if clicked else residuals["room"]
    information, axes = np.linalg.eigh(solution.jac.T @ solution.jac)
    covariance = ((axes / np.maximum(information, 1e-2)) @ axes.T)[:3, :3]
    result = Calibration(
        rotation=rotation,
        position=camera - zero if camera is not None else None,
        residual=residual,
        residuals=residuals,
        expected_error=float(np.degrees(np.sqrt(np.trace(covariance)))),
        corners=corners - zero if corners is not None else None,
        confidence=cues.room.confidence if cues.room is not None else None,
    )
    warnings += _doubts(result, cues, tuned)
    return replace(result, warnings=tuple(warnings))


def taken_as_level(
    rotation: FloatArray | None, camera_height: float | None, heading: FloatArray | None = None, bearing: float = 0.0
) -> Calibration:
    """The pose of a panorama of which nobody says more than that it is level, as cameras on tripods and most stitchers are.

    Args:
        rotation: light space to world as the file's metadata has it, shape (3, 3); ``None`` for the panorama's own axes.
        camera_height: of the capture point above the floor, metres.
        heading: a direction in light space that lies ``bearing`` degrees clockwise of +y, shape (3,).
        bearing: degrees.

    Raises:
        InputError: the height is not positive, or the heading points straight up or down.
    """
    if camera_height is not None and not (np.isfinite(camera_height) and camera_height > 0.0):
        raise InputError(f"camera height {camera_height:g}: a finite number above 0 is needed")
    found = np.eye(3) if rotation is None else rotation
    if heading is not None:
        found = _heading_rotation(found[2], heading, bearing)
    return Calibration(
        rotation=found,
        position=None if camera_height is None else np.array([0.0, 0.0, camera_height]),
        residual=0.0,
        residuals={},
        expected_error=None,
        warnings=(
            "taken as level: nothing was measured; look at the check picture, and give --auto, verticals or a "
            "rectangle where its plumb lines lean",
        )
        if rotation is None
        else (),
    )


def _check(cues: Cues, origin: str) -> None:
    """Refuse what cannot be solved."""
    if origin not in ORIGINS:
        raise InputError(f"origin '{origin}': allowed are {', '.join(ORIGINS)}")
    rectangle = cues.rectangle
    known = {
        "width": rectangle.width if rectangle else None,
        "length": rectangle.length if rectangle else None,
        "camera height": cues.camera_height,
        "click error": cues.click_error,
    }
    for name, value in known.items():
        if value is not None and not (np.isfinite(value) and value > 0):
            raise InputError(f"{name} {value:g}: a finite number above 0 is needed")
    if rectangle is not None and not (rectangle.width or rectangle.length or cues.camera_height):
        raise InputError("a floor rectangle needs its width, its length or the camera's height, for the scale")
    if cues.verticals is not None and (cues.verticals.length < np.radians(1.0)).any():
        shortest = int(np.argmin(cues.verticals.length)) + 1
        raise InputError(f"vertical {shortest}: its two points are less than a degree apart; click its far ends")
    verticals = len(cues.verticals) if cues.verticals is not None else 0
    if rectangle is None and cues.room is None and verticals < 3:
        raise InputError(
            f"{verticals} verticals are not enough: give three or more, or a floor rectangle (--rectangle), or let "
            "straight edges be found (--auto); a camera height alone (--camera-height) takes the panorama as level"
        )


class _Problem:
    """The unknowns, packed in a vector, and the cues' errors as its function.

    The vector holds a rotation vector (world axes, radian, added to the start's rotation); with a rectangle also the
    camera's x and y from the first corner in camera heights, and the logarithms of width and length in camera heights
    and of the camera height in metres; with a rectangle and a heading also the rectangle's own heading, radian.
    """

    def __init__(self, cues: Cues, rectangle: FloorRectangle | None, tuned: CalibrationParameters):
        self.cues = cues
        self.tuned = tuned
        self.rectangle = rectangle
        self.warnings: list[str] = []
        self.turns_freely = rectangle is not None and cues.heading is not None
        self.room = cues.room
        others = rectangle is not None or (cues.verticals is not None and len(cues.verticals) >= 3)
        if self.room is not None and self.room.confidence < tuned.sure_directions and others:
            self.warnings.append(
                f"the automatic directions were left out: their confidence is only {self.room.confidence:.2f}"
            )
            self.room = None
        self._parallelogram = fit_parallelogram(rectangle.corners) if rectangle is not None else None
        self._tangents = tangents(rectangle.corners) if rectangle is not None else np.empty((0, 2, 3))
        self._start_rotation = self._first_rotation()
        self._room_heading = self._room_direction()
        self.click_counts = {
            "rectangle": 4,
            "verticals": len(cues.verticals) if cues.verticals is not None else 0,
        }

    def _first_rotation(self) -> FloatArray:
        """A rotation near the solution."""
        if self._parallelogram is not None:
            rotation = self._parallelogram.rotation
        elif self.room is not None:
            rotation = self.room.rotation
        else:
            assert self.cues.verticals is not None
            normals = self.cues.verticals.normal
            # Where the verticals leave it open, near the zenith.
            up = np.linalg.eigh(normals.T @ normals - np.diag([0.0, 0.0, 1e-6]))[1][:, 0]
            up *= 1.0 if up[2] >= 0 else -1.0
            rotation = _heading_rotation(up, np.array([0.0, 1.0, 0.0]), 0.0)
        if self.cues.heading is not None:
            rotation = _heading_rotation(rotation[2], self.cues.heading, self.cues.bearing)
        return rotation

    def _room_direction(self) -> FloatArray | None:
        """The wall direction in light space that should become +y, where the room has a say in the heading."""
        if self.room is None or self.cues.heading is not None:
            return None
        if self.rectangle is None:
            return self.room.rotation[1]
        walls = np.stack([sign * self.room.rotation[axis] for axis in (0, 1) for sign in (1.0, -1.0)])
        wall = max(walls, key=lambda direction: float(direction @ self._start_rotation[1]))
        x, y, _ = self._start_rotation @ wall
        off = abs(np.degrees(np.arctan2(x, y)))
        if off > self.tuned.walls_parallel:
            self.warnings.append(
                f"the rectangle lies {off:.1f} degrees askew to the walls found; these were used for the level only"
            )
            return None
        return wall

    def start(self) -> FloatArray:
        """The vector to start from."""
        if self.rectangle is None or self._parallelogram is None:
            return np.zeros(3)
        shape = self._parallelogram
        width, length = shape.width, shape.width * shape.aspect
        if self.cues.camera_height:
            height = self.cues.camera_height
        elif self.rectangle.width:
            height = self.rectangle.width / width
        else:
            height = (self.rectangle.length or 1.0) / length
        camera = -shape.corners[0, :2]
        vector = [0.0, 0.0, 0.0, camera[0], camera[1], np.log(width), np.log(length), np.log(height)]
        if self.turns_freely:
            x_axis = self._start_rotation @ shape.rotation[0]
            vector.append(np.arctan2(x_axis[1], x_axis[0]))
        return np.array(vector)

    def unpack(self, vector: FloatArray) -> tuple[FloatArray, FloatArray | None, FloatArray | None]:
        """Rotation, camera and the rectangle's corners, in metres from the rectangle's first corner."""
        rotation = Rotation.from_rotvec(vector[:3]).as_matrix() @ self._start_rotation
        if self.rectangle is None:
            height = self.cues.camera_height
            return rotation, np.array([0.0, 0.0, height]) if height else None, None
        width, length, height = np.exp(vector[5:8])
        turn = euler_rotation([0.0, 0.0, np.degrees(vector[8])]) if self.turns_freely else np.eye(3)
        corners = np.array([[0, 0, 0], [width, 0, 0], [width, length, 0], [0, length, 0]]) * height
        camera = np.array([vector[3], vector[4], 1.0]) * height
        return rotation, turn @ camera, corners @ turn.T

    def errors(self, vector: FloatArray) -> FloatArray:
        """All cues' errors in their standard deviations."""
        rotation, _, _ = self.unpack(vector)
        click = self.cues.click_error
        errors = [self._heading_error(rotation)]
        if self.rectangle is not None:
            errors.append(self._corner_errors(vector).ravel() / (self.rectangle.error or click))
            width, length, height = vector[5:8]
            known = (
                (self.rectangle.width, width + height),
                (self.rectangle.length, length + height),
                (self.cues.camera_height, height),
            )
            relative = [found - np.log(value) for value, found in known if value]
            errors.append(np.array(relative) / self.tuned.measure_error)
        if self.cues.verticals is not None:
            errors.append(self.cues.verticals.deviation(rotation[2]) / click)
        if self.room is not None:
            errors.append(np.degrees(rotation[:2] @ self.room.rotation[2]) / self.room.level_error)
            if self._room_heading is not None:
                errors.append(np.degrees(rotation[:1] @ self._room_heading) / self.room.heading_error)
        return np.concatenate(errors)

    def residuals(self, vector: FloatArray) -> dict[str, float]:
        """Root mean square error of each cue, degrees."""
        residuals = {}
        if self.rectangle is not None:
            residuals["rectangle"] = float(np.sqrt(np.mean(np.sum(self._corner_errors(vector) ** 2, axis=1))))
        if self.cues.verticals is not None:
            up = self.unpack(vector)[0][2]
            residuals["verticals"] = float(np.sqrt(np.mean(self.cues.verticals.deviation(up) ** 2)))
        if self.room is not None:
            residuals["room"] = self.room.residual
        return residuals

    def _corner_errors(self, vector: FloatArray) -> FloatArray:
        """Angles between clicked and solved corners along two axes, degrees, shape (4, 2)."""
        rotation, camera, corners = self.unpack(vector)
        assert camera is not None
        assert corners is not None
        seen = (corners - camera) @ rotation
        seen /= np.linalg.norm(seen, axis=1, keepdims=True)
        return np.degrees(np.einsum("nij,nj->ni", self._tangents, seen))

    def _heading_error(self, rotation: FloatArray) -> FloatArray:
        """By how much the rotation misses what decides the heading alone; empty where that is not a direction."""
        if self.cues.heading is not None:
            direction, bearing, deviation = self.cues.heading, self.cues.bearing, self.cues.click_error
        elif self.rectangle is None and self.room is None:
            direction, bearing, deviation = np.array([0.0, 1.0, 0.0]), 0.0, 1e-3  # A convention, without error.
        else:
            return np.empty(0)
        x, y, _ = euler_rotation([0.0, 0.0, bearing]) @ rotation @ direction
        return np.degrees([np.arctan2(x, y) * np.hypot(x, y)]) / deviation


def _heading_rotation(up: FloatArray, direction: FloatArray, bearing: float) -> FloatArray:
    """Light space to world, so that ``up`` becomes +z and ``direction`` lies at the bearing clockwise of +y."""
    side = np.cross(direction, up)
    if np.linalg.norm(side) < 0.02:
        raise InputError("the heading points straight up or down; click a point nearer to the horizon")
    x = side / np.linalg.norm(side)
    return euler_rotation([0.0, 0.0, -bearing]) @ np.stack([x, np.cross(up, x), up])


def _doubts(result: Calibration, cues: Cues, tuned: CalibrationParameters) -> list[str]:
    """Warnings about a solution."""
    warnings = []
    for name, value in result.residuals.items():
        if name != "room" and value > tuned.doubtful_clicks * cues.click_error:
            warnings.append(
                f"the {name} miss{'es' if name == 'rectangle' else ''} the solution by {value:.2f} degrees, "
                f"more than clicks are expected to ({cues.click_error:.2f})"
            )
    if result.tilt > tuned.doubtful_tilt:
        warnings.append(f"the panorama would be tilted by {result.tilt:.0f} degrees: is the rectangle on the floor?")
    if result.expected_error is not None and result.expected_error > tuned.doubtful_rotation:
        warnings.append(
            f"the rotation is only known to about {result.expected_error:.1f} degrees: add another "
            "cue (verticals, automatic), or click a rectangle that is larger or nearer"
        )
    if cues.room is not None and result.confidence is not None and result.confidence < tuned.sure_directions:
        warnings.append(
            f"the automatic directions are doubtful (confidence {result.confidence:.2f}): "
            "is this a room with straight edges?"
        )
    return warnings
