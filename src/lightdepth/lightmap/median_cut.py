"""Median cut of a light-depth map into point lights (Debevec, A Median Cut Algorithm for Light Probe Sampling, 2005).

The panorama is cut into rectangles: each cut halves the light energy of the rectangle that holds the most, across its
longer side on the sphere. Every rectangle becomes one light, which lies, unlike Debevec's, at its real distance (light
points of the paper's eq. 8).
"""

from __future__ import annotations

import heapq
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import direction_to_latlong, pixel_directions, pixel_solid_angles
from lightdepth.errors import InputError
from lightdepth.images.tonemapping import LUMINANCE


@dataclass(frozen=True)
class PointLights:
    """The lights of a median cut, brightest first.

    Attributes:
        direction: from the capture point, light space, unit, shape (k, 3), float64.
        position: light space, metres, shape (k, 3), float64; infinite components where the light is sky.
        power: radiance times solid angle, RGB, shape (k, 3), float64: the irradiance that the light gives a surface at
            the capture point that faces it. Seen from elsewhere it grows and shrinks with the square of the distance.
        solid_angle: of the light's rectangle, steradian, shape (k,), float64; they sum to 4 pi.
        rectangle: first row, row behind the last, first column, column behind the last, shape (k, 4), int64.
    """

    direction: NDArray[np.float64]
    position: NDArray[np.float64]
    power: NDArray[np.float64]
    solid_angle: NDArray[np.float64]
    rectangle: NDArray[np.int64]

    def to_world(self, position: NDArray[np.float64], rotation: NDArray[np.float64]) -> NDArray[np.float64]:
        """The lights' positions, world, metres, shape (k, 3); infinite or NaN components where the light is sky.

        Args:
            position: capture point, world, metres, shape (3,).
            rotation: light space to world, shape (3, 3).
        """
        with np.errstate(invalid="ignore"):
            return position + self.position @ rotation.T

    def as_rows(self, position: NDArray[np.float64], rotation: NDArray[np.float64]) -> list[dict[str, Any]]:
        """The lights as rows of a table: direction and position in the world, ``None`` for the position of sky."""
        directions = self.direction @ rotation.T
        return [
            {
                "direction": [round(float(x), 6) for x in direction],
                "position": [round(float(x), 4) for x in place] if np.isfinite(place).all() else None,
                "power": [float(x) for x in power],
                "solid_angle": float(solid_angle),
            }
            for direction, place, power, solid_angle in zip(
                directions, self.to_world(position, rotation), self.power, self.solid_angle, strict=True
            )
        ]


def median_cut(radiance: NDArray[np.float32], depth: NDArray[np.float32], count: int) -> PointLights:
    """Cut a light-depth map into point lights of nearly equal energy.

    Args:
        radiance: linear RGB, shape (height, 2 height, 3), finite and not negative.
        depth: distance from the capture point, metres, shape (height, 2 height), inf for sky.
        count: how many lights, at least 1. Powers of two give Debevec's own cuts.

    Returns:
        The lights; fewer than ``count`` where a single pixel or darkness cannot be cut further.

    Raises:
        InputError: ``count`` is below 1 or the two arrays do not fit together.
    """
    if count < 1:
        raise InputError(f"median cut: the number of lights is {count}; at least 1 is needed")
    height, width = depth.shape
    if radiance.shape != (height, width, 3):
        raise InputError(
            f"median cut: radiance has shape {radiance.shape}, depth {depth.shape}; (height, width, 3) and "
            "(height, width) are needed"
        )
    power = radiance * pixel_solid_angles(height, width)[:, None, None]
    energy = power @ LUMINANCE
    rectangles = np.array(_cut(energy, count))

    directions = pixel_directions(height, width)
    solid_angles = np.broadcast_to(pixel_solid_angles(height, width)[:, None], (height, width))
    means = []
    for top, bottom, left, right in rectangles:
        here = (slice(top, bottom), slice(left, right))
        weights = energy[here] if energy[here].sum() > 0 else solid_angles[here]
        mean = np.einsum("ij,ijk->k", weights, directions[here])
        length = float(np.linalg.norm(mean))
        # A rectangle around the whole sphere may have no mean direction.
        lost = length < 1e-9 * weights.sum()
        means.append(directions[(top + bottom) // 2, (left + right) // 2] if lost else mean / length)
    direction = np.array(means)
    # The light lies on the surface that is seen there, where the paper's visibility tests look for it.
    u, v = direction_to_latlong(direction)
    distance = depth[np.minimum((v * height).astype(int), height - 1), np.minimum((u * width).astype(int), width - 1)]
    with np.errstate(invalid="ignore"):
        position = np.where(direction == 0.0, 0.0, direction * distance[:, None].astype(np.float64))
    total = np.array([power[t:b, left:right].sum(axis=(0, 1)) for t, b, left, right in rectangles])
    covered = np.array([solid_angles[t:b, left:right].sum() for t, b, left, right in rectangles])
    order = np.argsort(-(total @ LUMINANCE), kind="stable")
    return PointLights(direction[order], position[order], total[order], covered[order], rectangles[order])


def _cut(energy: NDArray[np.float64], count: int) -> list[tuple[int, int, int, int]]:
    """Rectangles (top, bottom, left, right) that part the energy, at most ``count`` of them."""
    height, width = energy.shape
    summed = np.zeros((height + 1, width + 1))
    np.cumsum(np.cumsum(energy, axis=0), axis=1, out=summed[1:, 1:])
    todo = [(-summed[-1, -1], 0, height, 0, width)]
    done: list[tuple[int, int, int, int]] = []
    while todo and len(todo) + len(done) < count:
        negative, top, bottom, left, right = heapq.heappop(todo)
        # The longer side on the sphere: columns narrow toward the poles.
        wide = (right - left) * np.sin(np.pi * (top + bottom) / (2 * height))
        across_columns = right - left > 1 and (wide > bottom - top or bottom - top == 1)
        if negative >= 0.0 or (bottom - top == 1 and right - left == 1):
            done.append((top, bottom, left, right))
            continue
        if across_columns:
            at = left + _half(summed[bottom, left : right + 1] - summed[top, left : right + 1])
            parts = [(top, bottom, left, at), (top, bottom, at, right)]
        else:
            at = top + _half(summed[top : bottom + 1, right] - summed[top : bottom + 1, left])
            parts = [(top, at, left, right), (at, bottom, left, right)]
        for t, b, l, r in parts:  # noqa: E741
            heapq.heappush(todo, (-(summed[b, r] - summed[t, r] - summed[b, l] + summed[t, l]), t, b, l, r))
    return done + [(top, bottom, left, right) for _, top, bottom, left, right in todo]


def _half(running: NDArray[np.float64]) -> int:
    """Where a running sum is nearest to the middle of its range; never at either end."""
    middle = 0.5 * (running[0] + running[-1])
    return 1 + int(np.argmin(np.abs(running[1:-1] - middle)))
