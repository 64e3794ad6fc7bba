"""What overlapping photographs say about vignetting and about differences of their exposures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.capture.lens import Lens
from lightdepth.parameters.capture import DEFAULT, CaptureParameters

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Photograph:
    """A linear image with its lens and pose.

    Attributes:
        radiance: linear RGB, shape (height, width, 3), float32.
        seen: share of trust in each pixel, 0 to 1, shape (height, width), float32; 0 outside a fisheye's circle,
            little where it is clipped or black.
        lens: lens and pose.
    """

    radiance: NDArray[np.float32]
    seen: NDArray[np.float32]
    lens: Lens


@dataclass(frozen=True)
class Photometry:
    """Corrections that make photographs agree.

    Attributes:
        vignetting: ``(b, c, d)`` of the light's share ``exp(b r^2 + c r^4 + d r^6)`` that reaches radius ``r``,
            measured in half diagonals of the photograph.
        gains: factors on the radiance of each photograph and colour channel, shape (photographs, 3).
        disagreement_before: median relative difference of overlapping photographs as they came.
        disagreement: the same after correction.
    """

    vignetting: tuple[float, float, float]
    gains: FloatArray
    disagreement_before: float
    disagreement: float

    def falloff(self, radius: FloatArray) -> FloatArray:
        """Share of the light at radii in half diagonals."""
        b, c, d = self.vignetting
        square = np.asarray(radius) ** 2
        return np.exp(square * (b + square * (c + square * d)))


def half_diagonals(lens: Lens, x: FloatArray, y: FloatArray) -> FloatArray:
    """Distance of points of a photograph from its lens axis, in half diagonals of the photograph."""
    right, down = x - lens.width / 2.0 - lens.shift[0], y - lens.height / 2.0 - lens.shift[1]
    return np.hypot(right, down) / np.hypot(lens.width / 2.0, lens.height / 2.0)


def sphere_directions(count: int) -> FloatArray:
    """Directions spread evenly over the sphere by a Fibonacci spiral, shape (count, 3)."""
    index = np.arange(count) + 0.5
    z = 1.0 - 2.0 * index / count
    angle = np.pi * (1.0 + 5.0**0.5) * index
    ring = np.sqrt(1.0 - z * z)
    return np.stack([ring * np.cos(angle), ring * np.sin(angle), z], axis=-1)


def estimate_photometry(
    photographs: Sequence[Photograph], with_gains: bool = True, tuned: CaptureParameters = DEFAULT
) -> Photometry:
    """Vignetting and gains from the directions that several photographs show.

    In a direction that photographs ``i`` and ``j`` show at the radii ``r_i`` and ``r_j``, the logarithms of their
    radiances differ by ``V(r_i) + g_i - V(r_j) - g_j``. ``V`` is a polynomial in ``r^2``; the system is solved by
    least squares with outliers (things that moved, parallax) losing their say. A weak prior holds gains at 1, so that
    exposures that agree already stay as they are.

    Args:
        photographs: with optimised lenses and poses.
        with_gains: also estimate a gain for each photograph and channel.
        tuned: what is looked at, and how much it counts.
    """
    image, direction, log, radius, weight = _overlaps(photographs, tuned)
    channels = 3
    unknowns = 3 + (len(photographs) * channels if with_gains else 0)
    rows, targets, confidence = [], [], []
    square = radius**2
    basis = np.stack([square, square**2, square**3], axis=-1)
    for channel in range(channels):
        columns = np.zeros((image.size, unknowns))
        columns[:, :3] = basis
        if with_gains:
            columns[np.arange(image.size), 3 + image * channels + channel] = -1.0
        rows.append(_centred(columns, direction, weight))
        targets.append(_centred(log[:, channel : channel + 1], direction, weight)[:, 0])
        confidence.append(weight)
    matrix, target, weights = np.concatenate(rows), np.concatenate(targets), np.concatenate(confidence)
    # Gains of a tenth of a stop or so are worth a little evidence; the falloff's terms are free.
    prior = np.diag(np.concatenate([np.full(3, 1e-3), np.full(unknowns - 3, 1.0)]))
    prior *= tuned.photometry_prior * max(weights.sum(), 1.0) / max(len(photographs), 1)
    solution: NDArray[np.floating] = np.zeros(unknowns)
    robust: NDArray[np.floating] = np.ones_like(weights)
    for _ in range(tuned.photometry_rounds):
        weighted = matrix * (weights * robust)[:, None]
        solution = np.linalg.solve(weighted.T @ matrix + prior, weighted.T @ target)
        residual = target - matrix @ solution
        scale = 1.4826 * np.median(np.abs(residual)) + 1e-4 if residual.size else 1.0
        robust = 1.0 / (1.0 + (residual / (tuned.photometry_scale * scale)) ** 2)
    gains = np.ones((len(photographs), channels))
    if with_gains:
        gains = np.exp(solution[3:].reshape(len(photographs), channels))
        gains /= np.exp(np.log(gains).mean())
    agreement = [float(np.median(np.abs(values))) if values.size else 0.0 for values in (target, residual)]
    return Photometry(tuple(solution[:3].tolist()), gains, *agreement)


def _overlaps(
    photographs: Sequence[Photograph], tuned: CaptureParameters
) -> tuple[NDArray[np.intp], NDArray[np.intp], FloatArray, FloatArray, FloatArray]:
    """Samples in directions that two photographs show: image, direction, log radiance (n, 3), radius and weight."""
    count, even = tuned.photometry_directions, tuned.photometry_even
    directions = sphere_directions(count)
    columns: list[list[NDArray]] = []
    for index, photograph in enumerate(photographs):
        lens = photograph.lens
        x, y = lens.project(directions)
        inside = (x > 3) & (x < lens.width - 3) & (y > 3) & (y < lens.height - 3)
        where = np.flatnonzero(inside)
        # Averaged over some pixels, so that slight misalignment does not matter where the picture is smooth.
        blurred = cv2.blur(photograph.radiance, (5, 5))
        steep = _unevenness(photograph.radiance, blurred)
        maps = [(axis[where] - 0.5).astype(np.float32)[None] for axis in (x, y)]
        seen = cv2.remap(cv2.erode(photograph.seen, np.ones((7, 7))), *maps, cv2.INTER_NEAREST)[0]
        values = cv2.remap(blurred, *maps, cv2.INTER_LINEAR)[0]
        uneven = cv2.remap(steep, *maps, cv2.INTER_LINEAR)[0]
        keep = (seen > 0.5) & (values > 0.0).all(axis=-1)
        weight = 1.0 / (even + uneven[keep]) ** 2 * even**2
        where = where[keep]
        radius = half_diagonals(lens, x[where], y[where])
        columns.append([np.full(where.size, index), where, np.log(values[keep].astype(float)), radius, weight])
    image, direction, log, radius, weight = (np.concatenate(parts) for parts in zip(*columns, strict=True))
    shared = np.bincount(direction, minlength=count)[direction] > 1
    return image[shared], direction[shared], log[shared], radius[shared], weight[shared]


def _unevenness(radiance: NDArray[np.float32], blurred: NDArray[np.float32]) -> NDArray[np.float32]:
    """Local relative contrast of an image, shape (height, width)."""
    variance = cv2.blur(radiance * radiance, (5, 5)) - blurred * blurred
    contrast = np.sqrt(np.maximum(variance, 0.0)) / np.maximum(blurred, 1e-12)
    return contrast.max(axis=2)


def _centred(values: FloatArray, group: NDArray[np.intp], weight: FloatArray) -> FloatArray:
    """Values minus their weighted mean over each group, shape (n, columns)."""
    total = np.bincount(group, weight)
    means = [np.bincount(group, weight * column) / np.maximum(total, 1e-30) for column in values.T]
    return values - np.stack(means, axis=-1)[group]
