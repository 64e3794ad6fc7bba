"""A rectangle on the floor, from the directions of its four corners."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from lightdepth.directions import FloatArray
from lightdepth.errors import InputError
from lightdepth.parameters.calibration import DEFAULT, CalibrationParameters


@dataclass(frozen=True)
class FloorRectangle:
    """A rectangle on the floor.

    Attributes:
        corners: directions of the corners, counter-clockwise seen from above, unit vectors in light space, (4, 3).
        width: length of the sides from corner 1 to 2 and from 3 to 4, metres, where known.
        length: length of the other two sides, metres, where known.
        error: standard deviation of a corner along either axis, degrees, where it is not that of a click.
    """

    corners: FloatArray
    width: float | None = None
    length: float | None = None
    error: float | None = None


@dataclass(frozen=True)
class Parallelogram:
    """The one parallelogram, up to its size, that four directions show.

    Attributes:
        rotation: light space to a frame with x along the first side and z up, away from the floor, shape (3, 3).
        corners: in that frame, seen from the camera, which is 1 above the floor, shape (4, 3).
        angle: between its sides at the first corner, degrees.
        aspect: length of the second side divided by the first.
        width: of the first side, in camera heights.
    """

    rotation: FloatArray
    corners: FloatArray
    angle: float
    aspect: float
    width: float


def fit_parallelogram(corners: FloatArray) -> Parallelogram:
    """Solve t1 d1 - t2 d2 + t3 d3 - t4 d4 = 0: a parallelogram's diagonals halve each other.

    Args:
        corners: directions in order around the parallelogram, shape (4, 3).
    """
    distance = np.abs(_dependency(corners))
    points = distance[:, None] * corners
    along = points[1] - points[0] + points[2] - points[3]
    across = points[3] - points[0] + points[2] - points[1]
    normal = np.cross(along, across)
    normal *= -np.sign(normal @ points.sum(axis=0))
    z = normal / np.linalg.norm(normal)
    x = along / np.linalg.norm(along)
    points /= -(points @ z).mean()
    cosine = (along @ across) / (np.linalg.norm(along) * np.linalg.norm(across))
    rotation = np.stack([x, np.cross(z, x), z])
    return Parallelogram(
        rotation=rotation,
        corners=points @ rotation.T,
        angle=float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))),
        aspect=float(np.linalg.norm(across) / np.linalg.norm(along)),
        width=float(np.linalg.norm(points[1] - points[0] + points[2] - points[3]) / 2),
    )


def put_in_order(rectangle: FloorRectangle) -> tuple[FloorRectangle, list[str]]:
    """Bring the corners into counter-clockwise order, with a warning where they were not.

    Raises:
        InputError: the four directions cannot be those of a rectangle's corners.
    """
    warnings = []
    order = [0, 1, 2, 3]
    positive = _dependency(rectangle.corners) > 0
    if positive.sum() != 2:
        raise InputError(
            "the rectangle's corners: one lies between the other three, or they do not all lie below the camera; no "
            "rectangle on the floor looks like this; click its four corners, counter-clockwise seen from above"
        )
    if positive[0] == positive[1]:  # Sides 1-2 and 3-4 are the diagonals.
        order = [0, 2, 1, 3]
    elif positive[0] == positive[3]:  # Sides 2-3 and 4-1 are the diagonals.
        order = [0, 1, 3, 2]
    if order != [0, 1, 2, 3]:
        warnings.append("the rectangle's sides cross")
    first, second, third = (rectangle.corners[index] for index in order[:3])
    if np.linalg.det([first, second, third]) > 0:  # Seen from inside the sphere, a floor's corners turn the other way.
        order = [order[1], order[0], order[3], order[2]]
        if not warnings:
            warnings.append("the rectangle's corners are in clockwise order seen from above")
    if warnings:
        used = ", ".join(str(index + 1) for index in order)
        warnings[0] += f"; they were taken in the order {used} (width from the first of these to the second)"
    return replace(rectangle, corners=rectangle.corners[order]), warnings


def check_shape(
    rectangle: FloorRectangle,
    camera_height: float | None,
    click_error: float,
    tuned: CalibrationParameters = DEFAULT,
) -> list[str]:
    """Say where the clicks contradict a rectangle, or its known measures, by more than the clicks' error explains.

    Args:
        rectangle: with its corners in order.
        camera_height: metres above the floor, where known.
        click_error: standard deviation of a click along either axis, degrees.
        tuned: what is taken for a contradiction.

    Returns:
        Warnings.
    """
    warnings = []
    click_error = rectangle.error or click_error
    found, error = _with_error(rectangle.corners, lambda shape: shape.angle, click_error)
    if abs(found - 90.0) > max(tuned.rectangle_angle, tuned.rectangle_errors * error):
        warnings.append(
            f"the corners are not those of a rectangle: its sides meet at {found:.1f} degrees "
            f"(the clicks explain {tuned.rectangle_errors * error:.1f} degrees off 90)"
        )
    ratios: list[tuple[str, float, Callable[[Parallelogram], float]]] = []
    if rectangle.width and rectangle.length:
        ratios.append(("length / width", rectangle.length / rectangle.width, lambda shape: shape.aspect))
    if camera_height and rectangle.width:
        ratios.append(("width / camera height", rectangle.width / camera_height, lambda shape: shape.width))
    elif camera_height and rectangle.length:
        ratios.append(
            ("length / camera height", rectangle.length / camera_height, lambda shape: shape.width * shape.aspect)
        )
    for name, known, measure in ratios:
        found, error = _with_error(rectangle.corners, measure, click_error)
        if abs(found - known) > max(tuned.rectangle_measure * known, tuned.rectangle_errors * error):
            warnings.append(
                f"the corners do not fit the given measures: {name} is {found:.3f} by the clicks, "
                f"{known:.3f} as given (the clicks explain a difference of {tuned.rectangle_errors * error:.3f})"
            )
    return warnings


def _dependency(corners: FloatArray) -> FloatArray:
    """Factors (t1, -t2, t3, -t4) of the linear dependency of four directions, shape (4,)."""
    _, singular, basis = np.linalg.svd(corners.T)
    if singular[2] < 1e-4 * singular[0]:
        raise InputError(
            "the rectangle's corners lie on one line or on the horizon; click the four corners of a "
            "rectangle on the floor"
        )
    return basis[3]


def _with_error(
    corners: FloatArray, measure: Callable[[Parallelogram], float], click_error: float
) -> tuple[float, float]:
    """A measure of the parallelogram, and its standard deviation when every corner moves by the clicks' error."""
    value = measure(fit_parallelogram(corners))
    variance = 0.0
    for index in range(4):
        for tangent in tangents(corners)[index]:
            moved = corners.copy()
            moved[index] += np.tan(np.radians(click_error)) * tangent
            moved[index] /= np.linalg.norm(moved[index])
            variance += (measure(fit_parallelogram(moved)) - value) ** 2
    return value, float(np.sqrt(variance))


def tangents(directions: FloatArray) -> FloatArray:
    """Two unit vectors across each direction and across each other, shape (n, 2, 3)."""
    helper = np.eye(3)[np.argmin(np.abs(directions), axis=1)]
    first = np.cross(directions, helper)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(directions, first)], axis=1)
