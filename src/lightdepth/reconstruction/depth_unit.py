"""The unit of a depth image that a network estimated: kind, scale and shift, from the floor and the ceiling.

Networks give distances, or reciprocal distances (disparity), up to a scale and often a shift. The floor, whose distance
below the camera is known, determines both; a ceiling, which is level at an unknown height, confirms them: seen at an angle
whose sine is s above or below the horizon, a level plane at height h has the reciprocal distance s / h.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.parameters.reconstruction import DEFAULT, UnitParameters

FloatArray = NDArray[np.float64]
Estimate = Literal["ray", "disparity"]


@dataclass(frozen=True)
class Unit:
    """What an estimate means: ``scale * value + shift`` is the distance in metres, or its reciprocal.

    Attributes:
        kind: ``ray`` (distances) or ``disparity`` (reciprocal ones).
        scale: positive.
        shift: 0 where the values are proportional.
        floor: share of the directions well below the horizon that are floor with it, in [0, 1].
    """

    kind: Estimate
    scale: float
    shift: float
    floor: float

    def reciprocal(self, values: FloatArray) -> FloatArray:
        """Reciprocal distances, 1 / metres, of the same shape; 0 where they would not be positive or are not known."""
        metric = self.scale * values + self.shift
        known = metric > 0.0  # NaN is not.
        if self.kind == "disparity":
            return np.where(known, metric, 0.0)
        return np.divide(1.0, metric, out=np.zeros_like(metric), where=known)


def solve_unit(
    values: FloatArray,
    rise: FloatArray,
    weights: FloatArray,
    height: float,
    kind: Estimate | None = None,
    shift: bool | None = None,
    tuned: UnitParameters = DEFAULT.unit,
    seed: int = 0,
) -> Unit:
    """Find scale and shift (and the kind) of an estimate by which the floor lies where it is.

    Args:
        values: of the file, NaN where nothing is known, any shape.
        rise: sine of the angle above the horizon, the same shape.
        weights: solid angles, the same shape.
        height: of the camera above the floor, metres.
        kind: what the values are, where it is known.
        shift: whether there is one; ``None`` looks whether one is needed.
        tuned: what counts as floor and ceiling.
        seed: of the random trials.

    Raises:
        InputError: there is no floor, or both kinds explain it as well.
    """
    known = np.isfinite(values) & (np.abs(rise) > tuned.steep)
    values, rise, weights = values[known], rise[known], weights[known]
    below = rise < 0.0
    if np.count_nonzero(below) < tuned.fewest_pixels:
        raise InputError("no floor is found: too little is known below the horizon")
    kinds: tuple[Estimate, ...] = ("ray", "disparity") if kind is None else (kind,)
    found: list[tuple[float, Unit]] = []
    for tried in kinds:
        options = (False, True) if shift is None else (shift,)
        best = [_solve(values, rise, weights, height, tried, free, tuned, seed) for free in options]
        chosen = best[-1] if len(best) == 2 and best[1][0] > tuned.needed_gain * max(best[0][0], 1e-9) else best[0]
        found.append(chosen)
    found.sort(key=lambda item: -item[0])
    score, unit = found[0]
    if score < tuned.least_score or unit.floor < tuned.least_floor:
        raise InputError(
            f"no floor is found in the depth: at most {100 * max(unit.floor, 0.0):.0f} % of what lies below the horizon "
            f"is level and {height:g} m below the camera; check the pose and whether the depth belongs to this panorama"
        )
    if len(found) == 2 and score < tuned.surer * found[1][0]:
        raise InputError(
            "it is not clear whether the depth is distance or disparity (larger where nearer): give --kind ray or "
            "--kind disparity"
        )
    return unit


def _solve(
    values: FloatArray,
    rise: FloatArray,
    weights: FloatArray,
    height: float,
    kind: Estimate,
    free: bool,
    tuned: UnitParameters,
    seed: int,
) -> tuple[float, Unit]:
    """The best scale, and shift where it is free, by RANSAC over pairs of floor pixels; with its score."""
    random = np.random.default_rng(seed)
    below = np.flatnonzero(rise < 0.0)
    judges = tuned.judges
    if len(values) > judges:
        chosen = random.choice(len(values), judges, replace=False, p=weights / weights.sum())
        some_values, some_rise, some_weights = values[chosen], rise[chosen], np.ones(judges)
    else:
        some_values, some_rise, some_weights = values, rise, weights
    wanted = -rise[below] / height if kind == "disparity" else height / -rise[below]
    x = values[below]
    one, other = random.choice(len(below), (2, tuned.trials), p=weights[below] / weights[below].sum())
    if free:
        step = x[one] - x[other]
        with np.errstate(divide="ignore", invalid="ignore"):
            scales = (wanted[one] - wanted[other]) / step
        shifts = wanted[one] - scales * x[one]
        # Two pixels in one direction from the horizon say nothing about the shift.
        apart = np.abs(np.log(wanted[one] / wanted[other])) > tuned.apart
        usable = apart & np.isfinite(scales) & (scales > 0.0)
        scales, shifts = scales[usable], shifts[usable]
    else:
        with np.errstate(divide="ignore", invalid="ignore"):
            scales = wanted[one[: tuned.trials // 6]] / x[one[: tuned.trials // 6]]
        scales = scales[np.isfinite(scales) & (scales > 0.0)]
        shifts = np.zeros(len(scales))
    best = (-1.0, Unit(kind, 1.0, 0.0, 0.0))
    for scale, offset in zip(scales, shifts, strict=True):
        unit = Unit(kind, float(scale), float(offset), 0.0)
        score, floor = _score(unit, some_values, some_rise, some_weights, height, tuned)
        if score > best[0]:
            best = score, Unit(kind, unit.scale, unit.shift, floor)
    return best


def _score(
    unit: Unit, values: FloatArray, rise: FloatArray, weights: FloatArray, height: float, tuned: UnitParameters
) -> tuple[float, float]:
    """How much lies on the floor and on one level ceiling, less what lies below the floor; and the floor's share."""
    reciprocal = unit.reciprocal(values)
    seen = reciprocal > 0.0
    down = rise < 0.0
    # The logarithm of a pixel's depth below the camera over the floor's: 0 on the floor, positive below it.
    with np.errstate(divide="ignore"):
        level = np.log(np.abs(rise) / np.where(seen, reciprocal, 1e-12) / height)
    on = down & (np.abs(level) < tuned.tolerance)
    agreement = 1.0 - (level / tuned.tolerance) ** 2
    total = weights[down].sum()
    floor = float((weights * agreement)[on].sum() / total)
    under = float(weights[down & (level > tuned.below * tuned.tolerance)].sum() / total)
    lowest, highest, step = np.log(tuned.lowest_ceiling), np.log(tuned.highest_ceiling), tuned.ceiling_step
    up = ~down & seen & (level > lowest) & (level < highest)
    ceiling = 0.0
    if up.any():
        bins = np.histogram(level[up], np.arange(lowest, highest + step, step), weights=weights[up])[0]
        ceiling = float(
            np.convolve(bins, np.ones(tuned.ceiling_steps), "same").max() / max(weights[~down].sum(), 1e-12)
        )
    share = float(weights[on].sum() / total)
    return floor - under + tuned.ceiling_weight * ceiling * (floor > tuned.ceiling_floor), share
