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
from lightdepth.parameters.mirror_ball import DEFAULT, MirrorBallParameters


def sharpened(
    radiance: NDArray[np.float32], view: BallView, reflectance: FloatArray, tuned: MirrorBallParameters = DEFAULT
) -> BallView:
    """The outline near ``view`` that explains the pixels beside it best; the focal length stays.

    Args:
        radiance: linear RGB, shape (height, width, 3).
        view: the ball, to a pixel.
        reflectance: of the ball at normal incidence, shape (3,).
        tuned: what is explained, and how.
    """
    for noise, starts_aside in zip(tuned.rim_noise, tuned.rim_starts, strict=True):
        tried = [tuned.rim_start_step * step for step in range(-starts_aside, starts_aside + 1)]
        rim = _Rim(radiance, view, reflectance, noise, tuned)
        starts = [np.array(each) for each in itertools.product(tried, repeat=3)]
        start = min(starts, key=rim.cost)
        found = least_squares(
            rim.left_over, start, rim.slopes, loss="cauchy", f_scale=noise, max_nfev=tuned.rim_evaluations
        )
        view = _moved(view, found.x)
    return view


class _Rim:
    """The pixels near an outline, each by the piece of the outline that it belongs to."""

    def __init__(
        self,
        radiance: NDArray[np.float32],
        view: BallView,
        reflectance: FloatArray,
        noise: float,
        tuned: MirrorBallParameters,
    ) -> None:
        self.view, self.noise, self.tuned = view, noise, tuned
        # The background may be anything.
        prior = np.array([np.inf, tuned.rim_slope, tuned.rim_reflected_slope, tuned.rim_reflected_curvature])
        self.ridge = np.diag(1e-9 + (noise / prior) ** 2)
        circle = view.circle()
        reach = circle.radius + tuned.rim_beyond + 4.0
        left, top = max(0, int(circle.x - reach)), max(0, int(circle.y - reach))
        light = radiance[top : int(circle.y + reach) + 1, left : int(circle.x + reach) + 1].mean(axis=2)
        y, x = np.mgrid[top : top + light.shape[0], left : left + light.shape[1]] + 0.5
        away = _away(view, x, y)
        near = (away > -tuned.rim_within) & (away < tuned.rim_beyond)
        self.x, self.y = x[near], y[near]
        count = max(24, round(2.0 * np.pi * circle.radius / tuned.rim_piece))
        turn = np.arctan2(self.y - circle.y, self.x - circle.x) / (2.0 * np.pi) % 1.0
        order = np.argsort(turn, kind="stable")
        self.x, self.y, turn = self.x[order], self.y[order], turn[order]
        _, self.first, self.piece = np.unique((turn * count).astype(int), return_index=True, return_inverse=True)
        values = np.maximum(light[near][order].astype(np.float64), 0.0)
        mean = np.add.reduceat(values, self.first) / np.diff([*self.first, len(values)])
        self.light = values / np.maximum(mean, 1e-12)[self.piece]
        self.profiles = _profiles(circle.radius, reflectance, tuned)

    def left_over(self, change: FloatArray) -> FloatArray:
        """What no background explains of each pixel, relative, with the outline moved."""
        away = _away(_moved(self.view, change), self.x, self.y)
        within, beyond = self.tuned.rim_within, self.tuned.rim_beyond
        index = (np.clip(away, -within - 1.9, beyond + 1.9) + within + 2.0) / self.tuned.rim_sample
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
        step = self.tuned.rim_step
        pairs = [[self.left_over(change + side * step * axis) for side in (-1.0, 1.0)] for axis in np.eye(3)]
        return np.stack([(after - before) / (2.0 * step) for before, after in pairs], axis=-1)


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


def _profiles(radius: float, reflectance: FloatArray, tuned: MirrorBallParameters) -> FloatArray:
    """Radiance across an outline, of which each piece is a sum, shape (samples, 4).

    Of columns: background, its slope, and slope and curvature of what the ball reflects over the angle of deflection.
    """
    fine = tuned.rim_sample
    away = np.arange(-tuned.rim_within - 2.0, tuned.rim_beyond + 2.0, fine)
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
    window = round(1.0 / fine)
    blurred = [
        uniform_filter1d(gaussian_filter1d(profile, tuned.rim_blur / fine), window, mode="nearest")
        for profile in profiles
    ]
    return np.stack(blurred, axis=-1)
