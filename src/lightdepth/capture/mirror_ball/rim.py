"""A mirror ball's outline to a tenth of a pixel, from what a polished rim looks like.

At the outline the ball reflects at grazing incidence, all of the light and in the ray's own direction: there is no step;
its last pixels blend into what is behind it. One pixel within an outline of 100 pixels radius, reflectance has fallen by
a quarter and the reflected ray is turned by 16 degrees. So the edge that one sees lies within the true one, by an amount
that depends on the place. Here each short piece of the outline is explained as the background, and within the outline as
the same times the metal's reflectance, with a slope and a curvature over the angle of deflection.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d, uniform_filter1d
from scipy.optimize import least_squares

from lightdepth.capture.mirror_ball.geometry import BallView
from lightdepth.capture.mirror_ball.reflectance import metal_reflectance
from lightdepth.directions import FloatArray

WITHIN, BEYOND = 1.5, 3.0
"""Pixels on both sides of the outline that are explained: farther within, the place is too compressed for a curve."""
PRIOR = (np.inf, 0.05, 1.5, 2.0)
"""What a piece's parts come to, relative to its background: that, its slope a pixel, and the slope a radian and curvature
of what the ball reflects."""
PIECE = 4.0
"""Pixels along the outline of a piece that has its own background."""
FINE = 0.02
"""Pixels between the samples of the profile."""
ROUNDS = ((0.02, tuple(0.3 * step for step in range(-4, 5))), (0.01, (-0.3, 0.0, 0.3)), (0.01, (0.0,)))
"""Each takes the pixels near the last outline. The relative difference from which on a pixel counts less, as what the
pieces do not explain is texture, or a stand; and pixels by which the outline is moved and widened for a start."""
STEP = 0.03
"""Pixels over which differences are taken."""


def sharpened(radiance: NDArray[np.float32], view: BallView, reflectance: FloatArray) -> BallView:
    """The outline near ``view`` that explains the pixels beside it best; the focal length stays.

    Args:
        radiance: linear RGB, shape (height, width, 3).
        view: the ball, to a pixel.
        reflectance: of the ball at normal incidence, shape (3,).
    """
    for noise, tried in ROUNDS:
        rim = _Rim(radiance, view, reflectance, noise)
        starts = [np.array(each) for each in itertools.product(tried, repeat=3)]
        start = min(starts, key=rim.cost)
        found = least_squares(rim.left_over, start, rim.slopes, loss="cauchy", f_scale=noise, max_nfev=20)
        view = _moved(view, found.x)
    return view


class _Rim:
    """The pixels near an outline, each by the piece of the outline that it belongs to."""

    def __init__(self, radiance: NDArray[np.float32], view: BallView, reflectance: FloatArray, noise: float) -> None:
        self.view, self.noise = view, noise
        self.ridge = np.diag(1e-9 + (noise / np.array(PRIOR)) ** 2)
        circle = view.circle()
        reach = circle.radius + BEYOND + 4.0
        left, top = max(0, int(circle.x - reach)), max(0, int(circle.y - reach))
        light = radiance[top : int(circle.y + reach) + 1, left : int(circle.x + reach) + 1].mean(axis=2)
        y, x = np.mgrid[top : top + light.shape[0], left : left + light.shape[1]] + 0.5
        away = _away(view, x, y)
        near = (away > -WITHIN) & (away < BEYOND)
        self.x, self.y = x[near], y[near]
        count = max(24, round(2.0 * np.pi * circle.radius / PIECE))
        turn = np.arctan2(self.y - circle.y, self.x - circle.x) / (2.0 * np.pi) % 1.0
        order = np.argsort(turn, kind="stable")
        self.x, self.y, turn = self.x[order], self.y[order], turn[order]
        _, self.first, self.piece = np.unique((turn * count).astype(int), return_index=True, return_inverse=True)
        values = np.maximum(light[near][order].astype(np.float64), 0.0)
        mean = np.add.reduceat(values, self.first) / np.diff([*self.first, len(values)])
        self.light = values / np.maximum(mean, 1e-12)[self.piece]
        self.profiles = _profiles(circle.radius, reflectance)

    def left_over(self, change: FloatArray) -> FloatArray:
        """What no background explains of each pixel, relative, with the outline moved."""
        away = _away(_moved(self.view, change), self.x, self.y)
        index = (np.clip(away, -WITHIN - 1.9, BEYOND + 1.9) + WITHIN + 2.0) / FINE
        low = index.astype(np.intp)
        share = (index - low)[:, None]
        basis = (1.0 - share) * self.profiles[low] + share * self.profiles[low + 1]
        normal = np.add.reduceat(basis[:, :, None] * basis[:, None], self.first) + self.ridge
        right = np.add.reduceat(basis * self.light[:, None], self.first)
        parts = np.linalg.solve(normal, right[..., None])[..., 0]
        return np.asarray((basis * parts[self.piece]).sum(axis=1) - self.light)

    def cost(self, change: FloatArray) -> float:
        """Of all pixels, robust."""
        return float(np.log1p((self.left_over(change) / self.noise) ** 2).sum())

    def slopes(self, change: FloatArray) -> FloatArray:
        """Derivatives of :meth:`left_over`, shape (n, 3)."""
        pairs = [[self.left_over(change + side * STEP * axis) for side in (-1.0, 1.0)] for axis in np.eye(3)]
        return np.stack([(after - before) / (2.0 * STEP) for before, after in pairs], axis=-1)


def _moved(view: BallView, change: FloatArray) -> BallView:
    """The view with its outline moved to the right, upward and outward by pixels."""
    right, up = view.across()
    scale = view.axis[1] ** 2 / view.focal_length
    axis = view.axis + scale * (change[0] * right + change[1] * up)
    radius = view.angular_radius + scale * change[2]
    return replace(view, axis=axis / np.linalg.norm(axis), distance=float(1.0 / np.sin(radius)))


def _away(view: BallView, x: FloatArray, y: FloatArray) -> FloatArray:
    """How far pixels are outside the outline, in pixels of one in the middle (negative within)."""
    angle = np.arccos(np.clip(view.rays(x, y) @ view.axis, -1.0, 1.0))
    return np.asarray((np.sin(angle) * view.distance - 1.0) * view.circle().radius)


def _profiles(radius: float, reflectance: FloatArray) -> FloatArray:
    """Radiance across an outline, of which each piece is a sum, shape (samples, 4).

    Of columns: background, its slope, and slope and curvature of what the ball reflects over the angle of deflection.
    """
    away = np.arange(-WITHIN - 2.0, BEYOND + 2.0, FINE)
    inside = away < 0.0
    cosine = np.sqrt(np.clip(1.0 - (1.0 + away / radius) ** 2, 0.0, 1.0)) * inside
    share = metal_reflectance(reflectance, cosine).mean(axis=1)
    deflection = 2.0 * np.arcsin(cosine)
    profiles = [
        np.where(inside, share, 1.0),
        np.where(inside, 0.0, away),
        np.where(inside, share * deflection, 0.0),
        np.where(inside, share * deflection**2, 0.0),
    ]
    # A pixel is a square a pixel wide, seen from any side; a lens is not much sharper.
    window = round(1.0 / FINE)
    blurred = [
        uniform_filter1d(gaussian_filter1d(profile, 0.15 / FINE), window, mode="nearest") for profile in profiles
    ]
    return np.stack(blurred, axis=-1)
