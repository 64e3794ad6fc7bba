"""Radial lens distortion after Brown and Conrady, on NumPy's arrays and Dr.Jit's alike.

A pinhole shows a point at the distance ``r`` from the principal point, in focal lengths; the lens shows it at
``r (1 + k1 r^2 + k2 r^4)``, as OpenCV, COLMAP and Blender's motion tracking (``Brown``) mean the two coefficients.
Source: D. C. Brown, "Decentering Distortion of Lenses", Photogrammetric Engineering 32 (1966).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

NEAR_FOLD = 0.98
"""Share of the largest distorted radius up to which a picture may reach: beyond, the inverse is ill-conditioned."""
_STEPS = 24
_PRECISION = 1e-9


@dataclass(frozen=True)
class RadialDistortion:
    """Two coefficients of radial distortion.

    Attributes:
        k1: of the square of the radius in focal lengths; negative for a barrel, positive for a pincushion.
        k2: of its fourth power.
    """

    k1: float
    k2: float

    @property
    def none(self) -> bool:
        """Whether this is a lens without distortion."""
        return self.k1 == 0.0 and self.k2 == 0.0

    def scale(self, squared: Any) -> Any:
        """Distorted radius over the undistorted one, at squares of undistorted radii."""
        return 1.0 + squared * (self.k1 + squared * self.k2)

    def slope(self, squared: Any) -> Any:
        """Derivative of the distorted radius by the undistorted one, at squares of undistorted radii."""
        return 1.0 + squared * (3.0 * self.k1 + squared * (5.0 * self.k2))

    @cached_property
    def fold(self) -> float:
        """Undistorted radius at which the distorted one stops growing and the picture would fold over; inf for never."""
        a, b = 5.0 * self.k2, 3.0 * self.k1
        if a == 0.0:
            return math.sqrt(-1.0 / b) if b < 0.0 else math.inf
        root = b * b - 4.0 * a
        if root < 0.0:
            return math.inf
        found = [(-b + sign * math.sqrt(root)) / (2.0 * a) for sign in (-1.0, 1.0)]
        return math.sqrt(min((square for square in found if square > 0.0), default=math.inf))

    @property
    def farthest(self) -> float:
        """Distorted radius up to which the distortion can be inverted with care; inf for everywhere."""
        return math.inf if math.isinf(self.fold) else NEAR_FOLD * self.fold * self.scale(self.fold**2)

    def undistorted(self, radius: Any, steps: int = _STEPS) -> Any:
        """Undistorted radii of distorted ones up to :attr:`farthest`, by Newton's iteration.

        Args:
            radius: not negative; an array of NumPy or a variable of Dr.Jit.
            steps: iterations; see :meth:`steps`.
        """
        result = radius
        for _ in range(steps):
            squared = result * result
            result = result - (result * self.scale(squared) - radius) / self.slope(squared)
        return result

    def steps(self, largest: float) -> int:
        """Iterations after which :meth:`undistorted` is exact in single precision for radii up to ``largest``."""
        radius = np.linspace(0.0, largest, 65)
        exact = self.undistorted(radius)
        for steps in range(1, _STEPS):
            if np.abs(self.undistorted(radius, steps) - exact).max() <= _PRECISION * max(1.0, largest):
                return steps
        return _STEPS

    def inverts(self, largest: float) -> bool:
        """Whether the distortion can be inverted for distorted radii up to ``largest``."""
        if largest > self.farthest:
            return False
        radius = np.linspace(0.0, largest, 65)
        with np.errstate(all="ignore"):
            found = self.undistorted(radius)
            back = found * self.scale(found**2)
        return bool(np.all(np.abs(back - radius) <= 1e-7 * max(1.0, largest)) and np.all(found >= 0.0))
