"""The planes of a room in an estimated depth image: floor, ceilings and walls, and the estimate's smooth error.

Seen from the capture point, a plane ``n . x = d`` has the reciprocal distance ``q(w) = (n / d) . w``: planes are vectors,
and fitted linearly. An estimate's relative error is smooth: a polynomial of the direction of low degree (as spherical
harmonics are), which is known on the floor, whose distance is known, and by whose correction planes are plane. Planes and
error are fitted in turns. Where the picture bends, planes meet, whatever the error: where a wall meets the floor, its
distance is that of the floor.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import pixel_directions
from lightdepth.parameters.reconstruction import DEFAULT, PlaneParameters
from lightdepth.reconstruction.depth_unit import Unit

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class RoomPlanes:
    """The planes that a room is made of, and how an estimate deviates from them.

    Attributes:
        vectors: normal over distance from the capture point, 1 / metres, world, shape (n, 3): the floor, then ceilings,
            then walls; a plane has the reciprocal distance ``vector . w`` in the direction w.
        ceilings: how many ceilings there are.
        coefficients: of the smooth error, for :meth:`correction`.
        spread: robust standard deviation of what remains of the relative error on the planes.
        tuned: what they were found with.
    """

    vectors: FloatArray
    ceilings: int
    coefficients: FloatArray
    spread: float
    tuned: PlaneParameters

    def correction(self, directions: FloatArray, reciprocal: FloatArray, unit: Unit) -> FloatArray:
        """Reciprocal distances without the smooth error.

        Args:
            directions: world, unit, shape (..., 3).
            reciprocal: of the estimate, 1 / metres, shape (...).
            unit: of the estimate.
        """
        columns = _columns(directions.reshape(-1, 3), reciprocal.reshape(-1), unit, self.tuned)
        return reciprocal * np.exp(columns @ self.coefficients).reshape(reciprocal.shape)


def find_room_planes(
    reciprocal: FloatArray, height: float, unit: Unit, tuned: PlaneParameters = DEFAULT.planes, seed: int = 0
) -> RoomPlanes:
    """Find floor, ceilings and walls, and the smooth error.

    Args:
        reciprocal: estimated, 1 / metres, shape (rows, 2 rows) of a level panorama in the world's directions; 0 where
            nothing is known.
        height: of the camera above the floor, metres.
        unit: of the estimate.
        tuned: what counts as a plane, and how smooth the error is.
        seed: of the random trials.
    """
    step = max(1, len(reciprocal) // tuned.rows)
    directions = pixel_directions(*reciprocal.shape)[step // 2 :: step, step // 2 :: step]
    weights = np.broadcast_to(np.sqrt(1.0 - directions[..., 2] ** 2), directions.shape[:2])
    few = reciprocal[step // 2 :: step, step // 2 :: step]
    known = few > 0.0
    fit = _Fit(directions[known], few[known], weights[known] / weights[known].sum(), height, unit, tuned, seed)
    fit.settle()
    fit.find_ceilings()
    fit.settle()
    for _ in range(2):
        fit.find_walls()
        fit.settle()
        fit.merge()
        fit.make_square()
        fit.measure_joints(reciprocal)
        fit.settle()
    return fit.result()


class _Fit:
    """Planes and error so far."""

    def __init__(
        self,
        directions: FloatArray,
        reciprocal: FloatArray,
        weights: FloatArray,
        height: float,
        unit: Unit,
        tuned: PlaneParameters,
        seed: int,
    ) -> None:
        self._random = np.random.default_rng(seed)
        self._directions, self._estimate, self._weights = directions, reciprocal, weights
        self._unit, self._tuned = unit, tuned
        self._level_columns: FloatArray | None = None
        self._columns = _columns(directions, reciprocal, unit, tuned)
        self._vectors = np.array([[0.0, 0.0, -1.0 / height]])
        self._ceilings = 0
        self._measured = np.array([True])
        self._coefficients = np.zeros(self._columns.shape[1])

    def result(self) -> RoomPlanes:
        label, ratio = self._labels()
        error = np.abs(ratio[label >= 0])
        spread = 1.4826 * float(np.median(error)) if len(error) else self._tuned.tolerance
        return RoomPlanes(self._vectors, self._ceilings, self._coefficients, spread, self._tuned)

    def settle(self) -> None:
        """Fit error and planes in turns."""
        tuned = self._tuned
        for step in range(tuned.rounds):
            label, _ = self._labels(tuned.first_tolerance if step == 0 else 1.0)
            on = label >= 0
            model = np.einsum("ij,ij->i", self._directions[on], self._vectors[label[on]])
            wanted = np.log(np.maximum(model, 1e-9) / self._estimate[on])
            columns, weights = self._columns[on], self._weights[on] * tuned.patches / tuned.patch_noise**2
            deviation = wanted - columns @ self._coefficients
            weights = weights * np.maximum(0.0, 1.0 - (deviation / (tuned.outer_tolerance * tuned.tolerance)) ** 2) ** 2
            prior = np.eye(columns.shape[1]) * columns.shape[1] / tuned.expected_error**2
            prior[0, 0] *= tuned.unit_error
            self._coefficients = np.linalg.solve(
                (columns * weights[:, None]).T @ columns + prior, (columns * weights[:, None]).T @ wanted
            )
            self._fit_planes()

    def _fit_planes(self) -> None:
        label, _ = self._labels()
        corrected = self._corrected()
        for index in range(1, len(self._vectors)):
            on = label == index
            if self._measured[index] or np.count_nonzero(on) < self._tuned.fewest_pixels:
                continue
            # Relative errors: every pixel's equation is divided by its reciprocal distance.
            weights = self._weights[on] / corrected[on] ** 2
            free = [2] if index <= self._ceilings else [0, 1]
            part = self._directions[on][:, free]
            self._vectors[index, free] = np.linalg.solve(
                (part * weights[:, None]).T @ part, (part * weights[:, None]).T @ corrected[on]
            )

    def find_ceilings(self) -> None:
        """Level planes above the camera, the largest first."""
        while self._ceilings < self._tuned.most_ceilings:
            left = self._left() & (self._directions[:, 2] > self._tuned.level)
            level = np.log(self._corrected()[left] / self._directions[left, 2])
            if not left.any():
                return
            step, across = self._tuned.ceiling_step, self._tuned.ceiling_steps
            bins = np.arange(level.min(), level.max() + step, step)
            mass = np.histogram(level, bins, weights=self._weights[left])[0] if len(bins) > across else np.zeros(1)
            smooth = np.convolve(mass, np.ones(across), "same")
            if smooth.max() < self._tuned.least_ceiling:
                return
            middle = float(np.exp(bins[int(smooth.argmax())] + 0.5 * step))
            self._vectors = np.insert(self._vectors, 1 + self._ceilings, [0.0, 0.0, middle], axis=0)
            self._measured = np.insert(self._measured, 1 + self._ceilings, False)
            self._ceilings += 1

    def find_walls(self) -> None:
        """Upright planes, the largest first."""
        while len(self._vectors) - 1 - self._ceilings < self._tuned.most_walls:
            found = self._best_wall(np.flatnonzero(self._left()))
            if found is None:
                return
            self._vectors = np.vstack([self._vectors, found])
            self._measured = np.append(self._measured, False)

    def merge(self) -> None:
        """Make one plane of those that are nearly the same."""
        label, _ = self._labels()
        mass = np.bincount(label[label >= 0], self._weights[label >= 0], len(self._vectors))
        kept: list[int] = []
        for index in np.argsort(-mass):
            lengths = np.linalg.norm(self._vectors[kept] - self._vectors[index], axis=1)
            if index == 0 or not (lengths < self._tuned.same * np.linalg.norm(self._vectors[index])).any():
                kept.append(int(index))
        kept = sorted({0, *kept})
        self._ceilings = sum(1 for index in kept if 0 < index <= self._ceilings)
        self._vectors, self._measured = self._vectors[kept], self._measured[kept]

    def make_square(self) -> None:
        """Turn walls that are nearly square to each other to be so."""
        walls = self._vectors[1 + self._ceilings :, :2]
        if len(walls) < 2:
            return
        label, _ = self._labels()
        mass = np.bincount(label[label >= 0], self._weights[label >= 0], len(self._vectors))[1 + self._ceilings :]
        lengths = np.linalg.norm(walls, axis=1)
        angles = np.arctan2(walls[:, 1], walls[:, 0])
        # Angles that agree modulo a quarter turn; the one that most agree with, refined by these.
        off = (angles[:, None] - angles[None, :] + np.pi / 4.0) % (np.pi / 2.0) - np.pi / 4.0
        near = np.abs(off) < np.radians(self._tuned.square)
        best = int(np.argmax((near * mass[:, None]).sum(axis=0)))
        some = near[:, best]
        heading = angles[best] + np.average(off[some, best], weights=mass[some] + 1e-9)
        quarter = np.round((angles - heading) / (np.pi / 2.0))
        turned = np.where(some, heading + quarter * np.pi / 2.0, angles)
        self._vectors[1 + self._ceilings :, :2] = lengths[:, None] * np.stack([np.cos(turned), np.sin(turned)], axis=1)

    def measure_joints(self, reciprocal: FloatArray) -> None:
        """Where walls meet the floor in the picture, they are as far away as the floor there; ceilings likewise.

        On a plane ``q(t + s) + q(t - s) = 2 cos(s) q(t)`` along a meridian. Where two planes meet, the left side is more
        than the right one, whatever the unit and the smooth error.

        Args:
            reciprocal: see :func:`find_room_planes`.
        """
        rows, columns = reciprocal.shape
        shift = self._margin(rows)
        bend = np.zeros_like(reciprocal)
        outer, middle = reciprocal[2 * shift :] + reciprocal[: -2 * shift], reciprocal[shift:-shift]
        known = (reciprocal[2 * shift :] > 0.0) & (reciprocal[: -2 * shift] > 0.0) & (middle > 0.0)
        bent = outer - 2.0 * np.cos(np.pi * shift / rows) * middle
        bend[shift:-shift] = np.divide(bent, middle, out=np.zeros_like(middle), where=known)
        azimuth = 2.0 * np.pi * ((np.arange(columns) + 0.5) / columns - 0.5)
        level = np.stack([np.sin(azimuth), np.cos(azimuth)], axis=1)
        walls = self._vectors[1 + self._ceilings :, :2]
        if len(walls) == 0:
            return
        toward = level @ walls.T
        fewest = max(4, self._tuned.fewest_meridians * columns // 1024)
        self._measured[:] = False
        self._measured[0] = True
        label, _ = self._labels_of(reciprocal)
        lower = -self._vectors[0, 2]
        feet: dict[int, FloatArray] = {}
        for index in range(len(walls)):
            number = 1 + self._ceilings + index
            found = self._joint(bend, label, toward[:, index], lower, number, 0, sign=1)
            use = np.isfinite(found)
            if np.count_nonzero(use) >= fewest:
                feet[number] = level[use] / (lower * found[use])[:, None]
                self._vectors[number, :2] = _through(feet[number], walls[index], self._tuned)
        self.make_square()
        for number, points in feet.items():
            along = self._vectors[number, :2] / np.linalg.norm(self._vectors[number, :2])
            self._vectors[number, :2] = along / float(np.median(points @ along))
            self._measured[number] = True
        for ceiling in range(1, 1 + self._ceilings):
            heights: list[FloatArray] = []
            for wall in np.flatnonzero(self._measured[1 + self._ceilings :]):
                number = 1 + self._ceilings + int(wall)
                along = level @ self._vectors[number, :2]
                found = self._joint(bend, label, along, self._vectors[ceiling, 2], number, ceiling, sign=-1)
                use = np.isfinite(found)
                heights.append(along[use] / found[use])
            every = np.concatenate(heights) if heights else np.zeros(0)
            if len(every) >= fewest:
                self._vectors[ceiling, 2] = float(np.median(every))
                self._measured[ceiling] = True

    def _joint(
        self,
        bend: FloatArray,
        label: NDArray[np.intp],
        along: FloatArray,
        level: float,
        wall: int,
        other: int,
        sign: int,
    ) -> FloatArray:
        """Tangent of the angle to the horizon at which a wall meets the floor or a ceiling, for each meridian.

        Args:
            bend: of the picture.
            label: plane of each pixel.
            along: of the wall, the reciprocal of its distance along the level way of each meridian, shape (columns,).
            level: reciprocal of the height of floor or ceiling.
            wall: its number.
            other: that of the floor or ceiling.
            sign: 1 below the horizon, -1 above.

        Returns:
            Shape (columns,), NaN where they are not seen to meet.
        """
        rows, columns = bend.shape
        result = np.full(columns, np.nan)
        margin = self._margin(rows)
        reach = round(np.radians(self._tuned.searched) / np.pi * rows)
        for column in np.flatnonzero(along > 0.02):
            expected = np.arctan(along[column] / level)
            row = int((0.5 + sign * expected / np.pi) * rows)
            if not reach + margin < row < rows - reach - margin - 1:
                continue
            inner, outer = row - sign * (margin + 2), row + sign * (margin + 2)
            if label[inner, column] != wall or label[outer, column] != other:
                continue
            window = slice(row - reach, row + reach + 1)
            here = bend[window, column]
            peak = int(here.argmax())
            # Bend of two exact planes that meet there, seen through no blur.
            full = np.sin(np.pi * margin / rows) * (np.tan(expected) + 1.0 / np.tan(expected))
            if here[peak] < self._tuned.least_bend * full or not 0 < peak < len(here) - 1:
                continue
            around = slice(max(0, peak - margin), peak + margin + 1)
            mass = np.maximum(here[around], 0.0) ** 2
            at = row - reach + (np.arange(len(here))[around] * mass).sum() / mass.sum()
            result[column] = np.tan(abs((at + 0.5) / rows - 0.5) * np.pi)
        return result

    def _margin(self, rows: int) -> int:
        """Rows over which the bend is measured."""
        return max(2, round(np.radians(self._tuned.crease) / np.pi * rows))

    def _labels_of(self, reciprocal: FloatArray) -> tuple[NDArray[np.intp], FloatArray]:
        """The same as :meth:`_labels` for a whole level panorama."""
        directions = pixel_directions(*reciprocal.shape)
        if self._level_columns is None:
            self._level_columns = _columns(directions.reshape(-1, 3), reciprocal.reshape(-1), self._unit, self._tuned)
        corrected = reciprocal * np.exp(self._level_columns @ self._coefficients).reshape(reciprocal.shape)
        return nearest_planes(self._vectors, directions, corrected, self._tuned.tolerance)

    def _best_wall(self, left: NDArray[np.intp]) -> FloatArray | None:
        tuned = self._tuned
        if self._weights[left].sum() < tuned.least_wall:
            return None
        corrected = self._corrected()
        share = self._weights[left] / self._weights[left].sum()
        first, second = self._random.choice(left, (2, 20 * tuned.trials), p=share)
        apart = np.arccos(np.clip(np.sum(self._directions[first] * self._directions[second], axis=1), -1.0, 1.0))
        near = np.flatnonzero((apart > np.radians(tuned.least_apart)) & (apart < np.radians(tuned.most_apart)))
        near = near[: tuned.trials]
        one, other = self._directions[first[near], :2], self._directions[second[near], :2]
        determinant = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
        usable = np.abs(determinant) > 0.02
        one, other, determinant = one[usable], other[usable], determinant[usable]
        q_one, q_other = corrected[first[near][usable]], corrected[second[near][usable]]
        x = (q_one * other[:, 1] - q_other * one[:, 1]) / determinant
        y = (q_other * one[:, 0] - q_one * other[:, 0]) / determinant
        if len(x) == 0:
            return None
        jury = self._random.choice(left, min(tuned.judges, len(left)), replace=False, p=share)
        model = self._directions[jury, :2] @ np.stack([x, y])
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.log(np.maximum(model, 1e-9) / corrected[jury, None]) / tuned.tolerance
        best = int(np.argmax(np.maximum(0.0, 1.0 - ratio**2).sum(axis=0)))
        vector = np.array([x[best], y[best], 0.0])
        for _ in range(3):
            on = left[np.abs(_log_ratio(self._directions[left] @ vector, corrected[left])) < tuned.tolerance]
            if self._weights[on].sum() < tuned.least_wall:
                return None
            part = self._directions[on] / corrected[on, None]
            weights = self._weights[on]
            free = np.linalg.lstsq(part * np.sqrt(weights)[:, None], np.sqrt(weights), rcond=None)[0]
            level = part[:, :2]
            vector[:2] = np.linalg.lstsq(level * np.sqrt(weights)[:, None], np.sqrt(weights), rcond=None)[0]
        return vector if abs(free[2]) < tuned.upright * np.hypot(free[0], free[1]) else None

    def _corrected(self) -> FloatArray:
        return self._estimate * np.exp(self._columns @ self._coefficients)

    def _left(self) -> NDArray[np.bool_]:
        return self._labels()[0] < 0

    def _labels(self, factor: float = 1.0) -> tuple[NDArray[np.intp], FloatArray]:
        """The plane that each pixel is nearest to, -1 where none is near, and the logarithm of its ratio to it."""
        return nearest_planes(self._vectors, self._directions, self._corrected(), factor * self._tuned.tolerance)


def nearest_planes(
    vectors: FloatArray, directions: FloatArray, reciprocal: FloatArray, tolerance: float
) -> tuple[NDArray[np.intp], FloatArray]:
    """The plane that each reciprocal distance is nearest to.

    Args:
        vectors: of the planes, shape (k, 3).
        directions: shape (..., 3).
        reciprocal: shape (...), 0 where nothing is known.
        tolerance: largest relative deviation.

    Returns:
        Its index, -1 where none is so near, and the logarithm of the deviation, each of shape (...).
    """
    ratio = np.stack([_log_ratio(directions @ vector, reciprocal) for vector in vectors])
    label = np.abs(ratio).argmin(axis=0)
    least = np.take_along_axis(ratio, label[None], axis=0)[0]
    return np.where(np.abs(least) < tolerance, label, -1), least


def _through(points: FloatArray, vector: FloatArray, tuned: PlaneParameters) -> FloatArray:
    """The line ``p . m = 1`` through points of shape (n, 2), near the one given, by least squares with Tukey's weights."""
    start, prior = vector, tuned.joint_prior
    for _ in range(8):
        off = points @ vector - 1.0
        scale = max(3.0 * 1.4826 * float(np.median(np.abs(off))), 1e-3)
        weights = np.maximum(0.0, 1.0 - (off / scale) ** 2)
        # The line that is given counts a little: few points far from each other determine no direction.
        rows = np.vstack([points * weights[:, None], prior * np.eye(2) / np.linalg.norm(start)])
        vector = np.linalg.lstsq(rows, np.concatenate([weights, prior * start / np.linalg.norm(start)]), rcond=None)[0]
    cosine = float(vector @ start) / float(np.linalg.norm(vector) * np.linalg.norm(start))
    return vector if cosine > np.cos(np.radians(tuned.joint_turn)) else start


def _log_ratio(model: FloatArray, reciprocal: FloatArray) -> FloatArray:
    """Logarithm of the ratio of two reciprocal distances; infinite where one is not positive."""
    usable = (model > 1e-9) & (reciprocal > 1e-9)
    ratio = np.divide(model, reciprocal, out=np.ones_like(model), where=usable)
    return np.where(usable, np.log(ratio), np.inf)


def _columns(directions: FloatArray, reciprocal: FloatArray, unit: Unit, tuned: PlaneParameters) -> FloatArray:
    """What the logarithm of the error is composed of: polynomials, and an error of the shift where there is one."""
    columns = _monomials(directions, tuned.degree) @ _orthonormal(tuned.degree)
    if unit.shift == 0.0:
        return columns
    safe = np.maximum(reciprocal, 1e-9)
    usual = float(np.median(reciprocal[reciprocal > 0.0])) if (reciprocal > 0.0).any() else 1.0
    bent = usual / safe if unit.kind == "disparity" else safe / usual
    return np.column_stack([columns, tuned.shift_error * np.clip(bent, 0.0, 4.0)])


def _monomials(directions: FloatArray, degree: int) -> FloatArray:
    """All monomials of the two highest degrees, which on the sphere make those of lower degrees as well."""
    powers = [np.cumprod(np.stack([np.ones_like(x), *[x] * degree]), axis=0) for x in directions.T]
    exponents = [e for e in product(range(degree + 1), repeat=3) if sum(e) in (degree, degree - 1)]
    return np.stack([powers[0][i] * powers[1][j] * powers[2][k] for i, j, k in exponents], axis=1)


@lru_cache(maxsize=1)
def _orthonormal(degree: int) -> FloatArray:
    """Combines the monomials to functions that are orthonormal over the sphere, the first of them constant."""
    random = np.random.default_rng(0)
    points = random.normal(size=(4000, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    values = _monomials(points, degree)
    count = values.shape[1]
    constant = np.linalg.lstsq(values, np.ones(len(points)), rcond=None)[0]
    ordered = np.column_stack([constant, np.eye(count)])[:, :count]
    _, triangle = np.linalg.qr(values @ ordered)
    return np.asarray(ordered @ np.linalg.inv(triangle) * np.sqrt(len(points)))
