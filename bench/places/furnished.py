"""Random furnished rooms, painted instead of lit: many of them in seconds, to see what a fitted box makes of furniture."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import euler_rotation, pixel_directions

FloatArray = NDArray[np.float64]
SUBPIXELS = 2


@dataclass(frozen=True)
class FurnishedRoom:
    """A box-shaped room with boxes in it, and where it is photographed from.

    Attributes:
        low: least coordinates of the room, world, metres, shape (3,); the floor is at 0.
        high: greatest coordinates.
        position: capture point.
        rotation: light space to world, XYZ Euler, degrees.
        things: low and high corners of furniture, shape (n, 2, 3).
        seed: of colours and patterns.
    """

    low: FloatArray
    high: FloatArray
    position: FloatArray
    rotation: tuple[float, float, float]
    things: FloatArray
    seed: int

    def photograph(self, height: int) -> NDArray[np.float32]:
        """Its panorama, linear RGB, shape (height, 2 height, 3)."""
        fine = SUBPIXELS * height
        directions = pixel_directions(fine, 2 * fine) @ euler_rotation(self.rotation).T
        random = np.random.default_rng(self.seed)
        with np.errstate(divide="ignore", invalid="ignore"):
            near, far = (self.low - self.position) / directions, (self.high - self.position) / directions
            distance = np.maximum(near, far)
            axis = distance.argmin(axis=-1)
            hit = distance.min(axis=-1)
            which = np.zeros(hit.shape, int)
            for index, (low, high) in enumerate(self.things, 1):
                one, other = (low - self.position) / directions, (high - self.position) / directions
                first, last = np.minimum(one, other), np.maximum(one, other)
                enters = first.max(axis=-1)
                seen = (enters < last.min(axis=-1)) & (enters > 0.0) & (enters < hit)
                hit = np.where(seen, enters, hit)
                axis = np.where(seen, first.argmax(axis=-1), axis)
                which[seen] = index
        points = self.position + directions * hit[..., None]
        toward = (np.take_along_axis(directions, axis[..., None], axis=-1)[..., 0] > 0.0).astype(int)
        radiance = self._colours(random)[which, axis, toward]
        self._patterns(random, radiance, points, which, axis, toward)
        # A lamp below the ceiling lights what is nearer more, and what it meets at a slant less.
        lamp = np.array([0.5 * (self.low[0] + self.high[0]), 0.5 * (self.low[1] + self.high[1]), self.high[2] - 0.4])
        away = points - lamp
        square = (away**2).sum(axis=-1)
        slant = np.abs(np.take_along_axis(away, axis[..., None], axis=-1)[..., 0]) / np.sqrt(square)
        radiance *= (0.6 + slant / (1.0 + 0.5 * square))[..., None]
        coarse = radiance.reshape(height, SUBPIXELS, 2 * height, SUBPIXELS, 3).mean(axis=(1, 3))
        return (coarse * (1.0 + 0.01 * random.standard_normal(coarse.shape))).astype(np.float32)

    def _colours(self, random: np.random.Generator) -> FloatArray:
        """Of each thing's faces by axis and side, shape (1 + n, 3, 2, 3)."""
        colours = random.uniform(0.05, 0.5, (1 + len(self.things), 1, 1, 3)) * np.ones((1, 3, 2, 1))
        colours *= random.uniform(0.8, 1.2, (1 + len(self.things), 3, 2, 1))
        white = random.uniform(0.5, 0.7) * np.array([1.0, 0.97, 0.92])
        colours[0] = white * random.uniform(0.92, 1.08, (3, 2, 1))
        if random.random() < 0.3:  # A painted wall.
            colours[0, random.integers(2), random.integers(2)] = random.uniform(0.1, 0.6, 3)
        colours[0, 2, 0] = random.uniform(0.15, 0.45) * np.array([1.0, 0.8, 0.62])
        colours[0, 2, 1] = random.uniform(0.65, 0.8)
        return colours

    def _patterns(
        self,
        random: np.random.Generator,
        radiance: FloatArray,
        points: FloatArray,
        which: NDArray[np.int_],
        axis: NDArray[np.int_],
        toward: NDArray[np.int_],
    ) -> None:
        """Boards and a rug on the floor, pictures, doors, windows and skirting boards on the walls."""
        floor = (which == 0) & (axis == 2) & (toward == 0)
        boards = random.uniform(0.85, 1.1, 64)
        radiance[floor] *= boards[(points[floor][:, random.integers(2)] / 0.14).astype(int) % 64][:, None]
        middle = random.uniform(self.low + 1.2, self.high - 1.2)[:2]
        rug = floor & (np.abs(points[..., :2] - middle) < random.uniform(0.4, 1.2, 2)).all(axis=-1)
        radiance[rug] = random.uniform(0.05, 0.5, 3)
        for wall, side in ((0, 0), (0, 1), (1, 0), (1, 1)):
            here = (which == 0) & (axis == wall) & (toward == side)
            across, up = points[..., 1 - wall], points[..., 2]
            radiance[here & (up < 0.07)] *= random.choice([1.0, 0.6])
            low, high = self.low[1 - wall], self.high[1 - wall]
            for _ in range(random.integers(1, 4)):
                left = random.uniform(low, high - 0.9)
                width = random.uniform(0.4, 1.6)
                kind = random.choice(["door", "window", "picture"])
                bottom, top = {"door": (0.0, 2.05), "window": (0.9, 2.2), "picture": (1.2, 1.8)}[kind]
                shown = here & (across > left) & (across < left + width) & (up > bottom) & (up < top)
                radiance[shown] = 6.0 if kind == "window" else random.uniform(0.05, 0.6, 3)


def furnished_room(seed: int) -> FurnishedRoom:
    """A room of usual size, photographed somewhere in its middle, with five to nine pieces of furniture along its walls."""
    random = np.random.default_rng(1000 + seed)
    size = np.array([*random.uniform(3.2, 7.0, 2), random.uniform(2.4, 3.2)])
    share = random.uniform(0.35, 0.65, 2)
    low = np.array([*(-share * size[:2]), 0.0])
    high = low + size
    position = np.array([0.0, 0.0, random.uniform(1.3, 1.65)])
    things = []
    for _ in range(random.integers(5, 10)):
        wall, side = random.integers(2), random.integers(2)
        tall = random.random() < 0.25
        depth, width = random.uniform(0.3, 0.95), random.uniform(0.5, 2.2)
        height = random.uniform(1.6, 2.1) if tall else random.uniform(0.35, 0.95)
        start = random.uniform(low[1 - wall], max(high[1 - wall] - width, low[1 - wall] + 0.01))
        gap = 0.0 if random.random() < 0.7 else random.uniform(0.0, 0.3)
        corner, opposite = np.zeros(3), np.zeros(3)
        corner[1 - wall], opposite[1 - wall] = start, min(start + width, high[1 - wall])
        corner[wall] = low[wall] + gap if side == 0 else high[wall] - gap - depth
        opposite[wall] = corner[wall] + depth
        corner[2], opposite[2] = 0.0, height
        # Nothing stands where the camera does.
        if not ((corner[:2] < 0.5) & (opposite[:2] > -0.5)).all():
            things.append([corner, opposite])
    rotation = (float(random.uniform(-2, 2)), float(random.uniform(-2, 2)), float(random.uniform(-40, 40)))
    return FurnishedRoom(low, high, position, rotation, np.array(things).reshape(-1, 2, 3), seed)
