"""A mirror ball before a perspective camera: which direction each pixel reflects, and which pixel reflects each direction.

Camera space has x to the right, y forward and z up. Lengths are in radii of the ball. The camera, the ball's centre and any
point of the place lie in one plane, in which the reflection happens too; so two angles from the axis that leads from the
ball to the camera say everything: ``facing`` of the point on the ball, and ``angle`` of what it reflects.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from lightdepth.capture.fisheye import Circle, circle_through
from lightdepth.directions import FloatArray
from lightdepth.errors import InputError

OUTLINE = 720
"""Points on the outline of a ball."""
HALVINGS, NEWTON = 6, 4
"""Steps toward a reflecting point: of the interval in which it lies, then Newton's. Together exact to 1e-8 degrees."""
NEAREST, FARTHEST = 1.2, 1e4
"""Distances of the camera from the ball's centre in radii that a photograph can have."""


@dataclass(frozen=True, eq=False)
class BallView:
    """A ball in a photograph.

    Attributes:
        width: of the photograph in pixels.
        height: of the photograph in pixels.
        focal_length: of the ideal lens in pixels; the axis goes through the photograph's middle.
        axis: toward the ball's centre, unit, camera space, shape (3,).
        distance: from the camera to the ball's centre, in radii.
    """

    width: int
    height: int
    focal_length: float
    axis: FloatArray
    distance: float

    @property
    def angular_radius(self) -> float:
        """Of the ball's outline, radians; directions this near to the one behind the ball are hidden by it."""
        return float(np.arcsin(1.0 / self.distance))

    @property
    def rim(self) -> float:
        """``facing`` of the outline, radians."""
        return float(np.arccos(1.0 / self.distance))

    def rays(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Unit vectors through pixel coordinates, counted from the upper left corner; shape (..., 3)."""
        return pixel_rays(self.width, self.height, self.focal_length, x, y)

    def pixels(self, directions: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Pixel coordinates ``(x, y)`` of directions of camera space, shape (...); those behind the camera are NaN."""
        forward = np.where(directions[..., 1] > 1e-6, directions[..., 1], np.nan)
        return (
            self.width / 2.0 + self.focal_length * directions[..., 0] / forward,
            self.height / 2.0 - self.focal_length * directions[..., 2] / forward,
        )

    def outline(self, scale: float = 1.0, count: int = OUTLINE) -> tuple[FloatArray, FloatArray]:
        """Pixel coordinates ``(x, y)`` around the ball, each of shape (count,).

        Args:
            scale: of the cone's angle; 1 is the outline.
            count: of points.
        """
        turn = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
        right, up = self.across()
        angle = scale * self.angular_radius
        around = np.cos(turn)[:, None] * right + np.sin(turn)[:, None] * up
        return self.pixels(np.cos(angle) * self.axis + np.sin(angle) * around)

    def circle(self) -> Circle:
        """The circle nearest to the outline, in pixels."""
        return circle_through(np.stack(self.outline(), axis=-1))

    def reflected(self, x: FloatArray, y: FloatArray) -> FloatArray:
        """Directions, camera space, that pixels reflect from infinitely far; NaN beside the ball. Shape (..., 3)."""
        rays = self.rays(x, y)
        along = rays @ self.axis
        with np.errstate(invalid="ignore"):
            reach = self.distance * along - np.sqrt(1.0 - self.distance**2 * (1.0 - along**2))
        normal = rays * reach[..., None] - self.distance * self.axis
        return rays - 2.0 * (rays * normal).sum(axis=-1, keepdims=True) * normal

    def facing(self, angle: FloatArray, distance: FloatArray | None = None) -> FloatArray:
        """Where on the ball points are reflected: the angle at the ball's centre between there and the camera.

        Args:
            angle: at the ball's centre between the point and the camera, radians, shape (...).
            distance: of the points from the ball's centre, in radii and above 1, the same shape; ``None`` is infinity.

        Returns:
            Radians, the same shape; NaN where the ball hides the point.
        """
        if distance is None:
            facing = np.linspace(0.0, self.rim, 8193)
            leaving = facing + self._incidence(facing)
            return np.interp(angle, leaving, facing, right=np.nan)
        low, high = np.zeros_like(angle), np.full_like(angle, self.rim)
        for _ in range(HALVINGS):
            middle = 0.5 * (low + high)
            nearer = self._incidence(middle) < _incidence(angle - middle, distance)
            low, high = np.where(nearer, middle, low), np.where(nearer, high, middle)
        facing = 0.5 * (low + high)
        for _ in range(NEWTON):
            off = self._incidence(facing) - _incidence(angle - facing, distance)
            slope = _incidence_slope(facing, self.distance) + _incidence_slope(angle - facing, distance)
            facing = np.clip(facing - off / slope, low, high)
        hidden = _incidence(angle - self.rim, distance) > 0.5 * np.pi
        return np.where(hidden, np.nan, facing)

    def mirror(
        self, directions: FloatArray, distance: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """The points of the ball that reflect points of the place into the camera.

        Args:
            directions: unit, camera space, from the ball's centre, shape (n, 3).
            distance: of the points from the ball's centre, in radii, shape (n,); ``None`` is infinity.

        Returns:
            ``(normals, incidence, angle)``: of the ball there, unit, camera space, shape (n, 3), NaN where the ball hides
            the point; the cosine of the angle of incidence; and the angle in radians between point and camera; (n,).
        """
        toward = -directions @ self.axis
        angle = np.arccos(np.clip(toward, -1.0, 1.0))
        facing = self.facing(angle, distance)
        beside = directions + toward[:, None] * self.axis
        length = np.linalg.norm(beside, axis=-1, keepdims=True)
        beside = beside / np.maximum(length, 1e-12)
        normals = -np.cos(facing)[:, None] * self.axis + np.sin(facing)[:, None] * beside
        return normals, np.cos(self._incidence(facing)), angle

    def seen_at(self, normals: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Pixel coordinates of points of the ball with these normals."""
        return self.pixels(self.distance * self.axis + normals)

    def degrees_per_pixel(self, angle: FloatArray) -> tuple[FloatArray, FloatArray]:
        """How much of the place one pixel spans, in degrees, away from the camera's direction and around it.

        Args:
            angle: between the camera and what is reflected from infinitely far, radians, shape (n,).
        """
        step = 1e-4
        facing = np.clip(self.facing(angle), step, self.rim - step)
        radius = [self._image_radius(facing + by) for by in (-step, step)]
        leaving = [facing + by + self._incidence(facing + by) for by in (-step, step)]
        away = (leaving[1] - leaving[0]) / np.maximum(radius[1] - radius[0], 1e-9)
        middle = facing + self._incidence(facing)
        return np.degrees(away), np.degrees(np.sin(middle) / self._image_radius(facing))

    def _image_radius(self, facing: FloatArray) -> FloatArray:
        """Pixels between the ball's middle and points on it, as if it stood in the middle of the photograph."""
        return np.asarray(self.focal_length * np.sin(facing) / (self.distance - np.cos(facing)))

    def _incidence(self, facing: FloatArray) -> FloatArray:
        return _incidence(facing, self.distance)

    def across(self) -> tuple[FloatArray, FloatArray]:
        """Unit vectors at right angles to the axis, to the right and upward, camera space."""
        x, y, z = self.axis
        flat = max(float(np.hypot(x, y)), 1e-12)
        return np.array([y, -x, 0.0]) / flat, np.array([-x * z, -y * z, x * x + y * y]) / flat


def _incidence(angle: FloatArray, distance: FloatArray | float) -> FloatArray:
    """Angle between a normal of the ball and a point that lies ``angle`` from it at the centre; radians."""
    return np.arctan2(distance * np.sin(angle), distance * np.cos(angle) - 1.0)


def _incidence_slope(angle: FloatArray, distance: FloatArray | float) -> FloatArray:
    """Derivative of :func:`_incidence` by the angle."""
    cosine = np.cos(angle)
    return np.asarray(distance * (distance - cosine) / (distance * (distance - 2.0 * cosine) + 1.0))


def pixel_rays(width: int, height: int, focal_length: float, x: FloatArray, y: FloatArray) -> FloatArray:
    """Unit vectors of camera space through pixel coordinates of a photograph, shape (..., 3)."""
    right, down = np.asarray(x) - width / 2.0, np.asarray(y) - height / 2.0
    rays = np.stack([right, np.full_like(right, focal_length), -down], axis=-1)
    return np.asarray(rays / np.linalg.norm(rays, axis=-1, keepdims=True))


def view_from_cone(
    name: str, width: int, height: int, focal_length: float, x: NDArray[np.floating], y: NDArray[np.floating]
) -> BallView:
    """The ball whose outline goes through pixel coordinates: the cone through their rays, by least squares.

    Raises:
        InputError: there is no such ball.
    """
    rays = pixel_rays(width, height, focal_length, np.asarray(x, np.float64), np.asarray(y, np.float64))
    # All rays make one angle with the axis: ray . axis / cos(angle) = 1.
    scaled = np.linalg.lstsq(rays, np.ones(len(rays)), rcond=None)[0]
    length = float(np.linalg.norm(scaled))
    sine = np.sqrt(max(1.0 - 1.0 / length**2, 0.0)) if length > 1.0 else 0.0
    if not 1.0 / FARTHEST < sine < 1.0 / NEAREST:
        raise InputError(
            f"{name}: with this field of view the ball's circle would mean a camera "
            f"{1.0 / max(sine, 1e-9):.3g} radii from its centre; {NEAREST:g} to {FARTHEST:g} are allowed: state --fov or "
            "--distance as it was"
        )
    axis = np.asarray(scaled / length, np.float64)
    return BallView(width, height, focal_length, axis, 1.0 / float(sine))


def view_from_circle(
    name: str,
    width: int,
    height: int,
    circle: Circle,
    focal_length: float | None = None,
    distance: float | None = None,
) -> BallView:
    """The ball that a circle on a photograph outlines.

    Args:
        name: of the photograph, for messages.
        width: of the photograph in pixels.
        height: of the photograph in pixels.
        circle: the outline.
        focal_length: of the lens in pixels, or ``None`` where ``distance`` is known.
        distance: of the camera from the ball's centre, in radii.

    Raises:
        InputError: the two do not fit together.
    """
    turn = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
    x, y = circle.x + circle.radius * np.cos(turn), circle.y + circle.radius * np.sin(turn)
    if focal_length is not None:
        return view_from_cone(name, width, height, focal_length, x, y)
    assert distance is not None
    wanted = np.tan(np.arcsin(1.0 / distance))

    def off(logarithm: float) -> float:
        rays = pixel_rays(width, height, float(np.exp(logarithm)), x, y)
        scaled = np.linalg.lstsq(rays, np.ones(len(rays)), rcond=None)[0]
        length = max(float(np.linalg.norm(scaled)), 1.0 + 1e-12)
        return float(np.log(np.sqrt(length**2 - 1.0) / wanted))

    first = np.log(circle.radius / wanted)
    try:
        found = brentq(off, first - 2.0, first + 2.0)
    except ValueError:
        raise InputError(
            f"{name}: no lens shows a ball {distance:.3g} radii away as a circle of {circle.radius:.1f} pixels at "
            f"{circle.x:.1f},{circle.y:.1f}; state --distance and --ball-diameter as they were"
        ) from None
    return view_from_cone(name, width, height, float(np.exp(found)), x, y)
