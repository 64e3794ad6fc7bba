"""Arcs of great circles: what straight edges of the real place are in a panorama."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from lightdepth.directions import FloatArray


class Arcs:
    """Arcs of great circles between pairs of directions.

    All parallel edges point at one direction, their vanishing point; the great circle of each passes through it.

    Attributes:
        ends: the arcs' two ends, unit vectors in light space, shape (n, 2, 3).
        normal: the great circles' unit normals, shape (n, 3).
        length: the arcs' lengths, radian, shape (n,).
    """

    def __init__(self, ends: ArrayLike):
        self.ends = np.asarray(ends, dtype=np.float64).reshape(-1, 2, 3)
        first, second = self.ends[:, 0], self.ends[:, 1]
        cross = np.cross(first, second)
        sine = np.linalg.norm(cross, axis=1)
        self.normal = cross / np.maximum(sine, 1e-12)[:, None]
        self.length = np.arctan2(sine, np.sum(first * second, axis=1))
        middle = first + second
        self._middle = middle / np.maximum(np.linalg.norm(middle, axis=1), 1e-12)[:, None]
        self._along = np.cross(self.normal, self._middle)

    def __len__(self) -> int:
        return len(self.ends)

    def take(self, index: ArrayLike) -> Arcs:
        """The arcs at an index or where a mask is true."""
        return Arcs(self.ends[np.asarray(index)])

    def leverage(self, direction: ArrayLike) -> FloatArray:
        """How far the ends must move at least, for the great circle to move by one unit at a direction.

        Moving the ends of an arc of length a by e1 and e2 across it moves its great circle, at the angle psi from its
        middle, by (e1 sin(a/2 - psi) + e2 sin(a/2 + psi)) / sin a. The smallest sqrt(e1^2 + e2^2) that moves it by 1
        is sin a / sqrt(1 - cos a cos 2 psi).

        Args:
            direction: unit vectors in light space, shape (..., 3).

        Returns:
            One length for each direction and arc, shape (..., n).
        """
        v = np.asarray(direction, dtype=np.float64)
        cosine, sine = v @ self._middle.T, v @ self._along.T
        square = cosine**2 + sine**2
        cos_twice = np.divide(cosine**2 - sine**2, square, out=np.zeros_like(square), where=square > 1e-18)
        return np.sin(self.length) / np.sqrt(np.maximum(1.0 - np.cos(self.length) * cos_twice, 1e-18))

    def deviation(self, direction: ArrayLike) -> FloatArray:
        """By how much the ends must move at least, for the arcs' great circles to pass through a direction.

        Args:
            direction: unit vectors in light space, shape (..., 3).

        Returns:
            Signed angles in degrees for each direction and arc, shape (..., n).
        """
        sine = np.asarray(direction, dtype=np.float64) @ self.normal.T
        return np.degrees(np.arcsin(np.clip(sine, -1.0, 1.0))) * self.leverage(direction)
