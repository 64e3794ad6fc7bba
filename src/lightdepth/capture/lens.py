"""The lens and pose of one photograph as Hugin's project files state them, and what they mean."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lightdepth.directions import euler_rotation

FloatArray = NDArray[np.float64]

PROJECTIONS: dict[str, int] = {"rectilinear": 0, "fisheye": 2, "equisolid": 21, "stereographic": 10}
"""Kinds of lens by name, with the numbers of Panorama Tools; "fisheye" is the equidistant one."""


@dataclass(frozen=True)
class Lens:
    """Projection, distortion and orientation of one photograph, in the parameters of Panorama Tools.

    The ideal radius ``r`` in pixels of a ray at the angle ``theta`` from the axis is ``f theta`` (fisheye),
    ``2 f sin(theta / 2)`` (equisolid), ``2 f tan(theta / 2)`` (stereographic) or ``f tan(theta)`` (rectilinear); the
    photograph has it at ``r (a s^3 + b s^2 + c s + 1 - a - b - c)`` with ``s`` in halves of the shorter side.

    Attributes:
        width: pixels.
        height: pixels.
        projection: a key of :data:`PROJECTIONS`.
        fov: degrees across the photograph's width, without distortion.
        distortion: ``(a, b, c)``.
        shift: pixels to the right and down from the photograph's centre to the lens axis.
        yaw: degrees to the right.
        pitch: degrees up.
        roll: degrees, clockwise as the photographer sees the camera turn.
    """

    width: int
    height: int
    projection: str
    fov: float
    distortion: tuple[float, float, float] = (0.0, 0.0, 0.0)
    shift: tuple[float, float] = (0.0, 0.0)
    yaw: float = 0.0
    pitch: float = 0.0
    roll: float = 0.0

    @property
    def rotation(self) -> FloatArray:
        """Camera space (x right, y forward, z up) to the panorama's light space, shape (3, 3)."""
        about_axis = euler_rotation([0.0, self.roll, 0.0])
        return euler_rotation([0.0, 0.0, -self.yaw]) @ euler_rotation([self.pitch, 0.0, 0.0]) @ about_axis

    def with_rotation(self, rotation: FloatArray) -> Lens:
        """The lens with yaw, pitch and roll of a :attr:`rotation`; straight up and down the roll is 0."""
        sine = float(np.clip(rotation[2, 1], -1.0, 1.0))
        if abs(sine) > 1.0 - 1e-12:
            # There yaw and roll turn about one axis: the side that points right gives their sum.
            yaw, roll = -np.arctan2(rotation[1, 0], rotation[0, 0]), 0.0
        else:
            yaw = np.arctan2(rotation[0, 1], rotation[1, 1])
            roll = np.arctan2(-rotation[2, 0], rotation[2, 2])
        pitch = float(np.degrees(np.arcsin(sine)))
        return replace(self, yaw=float(np.degrees(yaw)), pitch=pitch, roll=float(np.degrees(roll)))

    @property
    def focal_length(self) -> float:
        """Pixels per radian at the axis, without distortion."""
        half = np.radians(self.fov) / 2.0
        edge = {
            "rectilinear": lambda: np.tan(half),
            "fisheye": lambda: half,
            "equisolid": lambda: 2.0 * np.sin(half / 2.0),
            "stereographic": lambda: 2.0 * np.tan(half / 2.0),
        }[self.projection]()
        return float(self.width / 2.0 / edge)

    def project(self, directions: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Where directions of the panorama's light space appear in the photograph.

        Args:
            directions: unit vectors, shape (..., 3).

        Returns:
            ``(x, y)`` in pixels from the upper left corner (a pixel's centre is at ``i + 0.5``), each of shape (...);
            NaN where the projection cannot show the direction. They may lie outside the photograph.
        """
        right, forward, up = np.moveaxis(np.asarray(directions, dtype=np.float64) @ self.rotation, -1, 0)
        sine = np.hypot(right, up)
        theta = np.arctan2(sine, forward)
        if self.projection == "rectilinear":
            ideal = np.where(forward > 1e-6, sine / np.maximum(forward, 1e-6), np.nan)
        elif self.projection == "fisheye":
            ideal = theta
        elif self.projection == "equisolid":
            ideal = 2.0 * np.sin(theta / 2.0)
        else:
            ideal = 2.0 * np.tan(np.minimum(theta, 3.1) / 2.0)
        radius = self.focal_length * ideal
        a, b, c = self.distortion
        s = radius / (min(self.width, self.height) / 2.0)
        radius = radius * (((a * s + b) * s + c) * s + 1.0 - a - b - c)
        scale = radius / np.maximum(sine, 1e-12)
        return right * scale + self.width / 2.0 + self.shift[0], -up * scale + self.height / 2.0 + self.shift[1]

    def unproject(self, x: ArrayLike, y: ArrayLike) -> FloatArray:
        """Directions seen at points of the photograph: the inverse of :meth:`project`.

        Args:
            x: pixels from the left edge, any shape.
            y: pixels from the upper edge, the same shape.

        Returns:
            Unit vectors in the panorama's light space, shape (..., 3).
        """
        right = np.asarray(x, dtype=np.float64) - self.width / 2.0 - self.shift[0]
        down = np.asarray(y, dtype=np.float64) - self.height / 2.0 - self.shift[1]
        distorted = np.hypot(right, down)
        unit = min(self.width, self.height) / 2.0
        a, b, c = self.distortion
        radius = distorted
        # Newton's method; lenses distort by some per cent, and each step squares the remaining error.
        for _ in range(8):
            s = radius / unit
            value = radius * (((a * s + b) * s + c) * s + 1.0 - a - b - c)
            slope = ((4 * a * s + 3 * b) * s + 2 * c) * s + 1.0 - a - b - c
            radius = radius - (value - distorted) / np.where(np.abs(slope) > 1e-3, slope, 1.0)
        ideal = radius / self.focal_length
        if self.projection == "rectilinear":
            theta = np.arctan(ideal)
        elif self.projection == "fisheye":
            theta = ideal
        elif self.projection == "equisolid":
            theta = 2.0 * np.arcsin(np.clip(ideal / 2.0, -1.0, 1.0))
        else:
            theta = 2.0 * np.arctan(ideal / 2.0)
        scale = np.sin(theta) / np.maximum(distorted, 1e-12)
        return np.stack([right * scale, np.cos(theta), -down * scale], axis=-1) @ self.rotation.T


def horizontal_fov(focal_length_35mm: float, width: int, height: int) -> float:
    """Field of view across a rectilinear photograph's width in degrees.

    Args:
        focal_length_35mm: millimetres on 24 x 36 mm film with the same diagonal field of view, as EXIF states it.
        width: of the photograph in pixels.
        height: of the photograph in pixels.
    """
    diagonal = np.hypot(36.0, 24.0) / 2.0 / focal_length_35mm
    return float(2.0 * np.degrees(np.arctan(diagonal * width / np.hypot(width, height))))
