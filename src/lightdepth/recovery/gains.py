"""One gain per channel and photograph, from what several photographs of a place see of the same surfaces.

Theory, section 9, eq. (14). Exposures, white balances, and lamps that warmed up are a factor per channel. What
disagrees beyond that is something else: people who walked, mirrors, a wrong pose or a wrong model.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from lightdepth.directions import direction_to_latlong, pixel_directions
from lightdepth.kernel.variables import as_vectors
from lightdepth.parameters.balance import DEFAULT, BalanceParameters
from lightdepth.parameters.place import DEFAULT as PLACE
from lightdepth.parameters.place import PlaceParameters
from lightdepth.place.photograph import Photograph
from lightdepth.place.traced_surfaces import TracedSurfaces
from lightdepth.regions import connected_regions
from lightdepth.scene.model import Panorama


@dataclass(frozen=True)
class Disagreement:
    """Where a photograph shows something else than the others.

    Attributes:
        share: of the directions in which another photograph sees the same surface, in [0, 1].
        row: in the middle of the largest such region, pixels of the photograph.
        column: likewise.
        point: what the model has there, world, metres, shape (3,).
        region: share of that region, as above.
    """

    share: float
    row: int
    column: int
    point: NDArray[np.float64]
    region: float


@dataclass(frozen=True)
class Balance:
    """How photographs of one place compare.

    Attributes:
        gains: of each photograph, per channel, shape (k, 3), float32.
        shared: points of each that another one sees too, shape (k,).
        deviation: typical relative deviation at these, after the gains, shape (k,); nan where there are none.
        disagreements: of each; ``None`` where it has none.
        problem: why they cannot be used together; ``None`` where they can.
    """

    gains: NDArray[np.float32]
    shared: tuple[int, ...]
    deviation: tuple[float, ...]
    disagreements: tuple[Disagreement | None, ...]
    problem: str | None = None


@dataclass(frozen=True)
class _Pairs:
    """Points that two photographs see.

    Attributes:
        first: index of the photograph, shape (n,).
        second: of the other one.
        cell: which of the first one's directions.
        point: world, metres, shape (n, 3).
        ratio: logarithm of the ratio of both radiances, shape (n, 3).
        least: the same of the first one's darkest and the second one's brightest pixel around the point.
        most: likewise of the brightest and the darkest.
    """

    first: NDArray[np.int64]
    second: NDArray[np.int64]
    cell: NDArray[np.int64]
    point: NDArray[np.float32]
    ratio: NDArray[np.float64]
    least: NDArray[np.float64]
    most: NDArray[np.float64]


def solve_gains(
    panoramas: Sequence[Panorama],
    surfaces: TracedSurfaces,
    tuned: BalanceParameters = DEFAULT,
    place: PlaceParameters = PLACE,
) -> Balance:
    """Solve the gains of the photographs that are not balanced; those of the others are 1.

    Args:
        panoramas: of one place, the first of them balanced.
        surfaces: the real surfaces, as they were photographed.
        tuned: what no gain explains, among others.
        place: what a photograph is taken to see.
    """
    count = len(panoramas)
    ones = np.ones((count, 3), np.float32)
    if count == 1:
        return Balance(ones, (0,), (np.nan,), (None,))
    pairs = _pairs(panoramas, surfaces, tuned, place)
    free = np.array([not panorama.balanced for panorama in panoramas])
    alone = _unconnected(pairs, free, tuned.fewest)
    if alone is not None:
        return Balance(ones, (0,) * count, (np.nan,) * count, (None,) * count, _shares_nothing(panoramas, alone))
    logs = np.stack([_solved(pairs, free, channel, tuned) for channel in range(3)], axis=1)
    gain = logs[pairs.first] - logs[pairs.second]
    left = np.abs(pairs.ratio + gain).max(axis=1)
    # An edge that lies half a pixel beside its place is no disagreement.
    surely = np.maximum(np.maximum(pairs.least + gain, -pairs.most - gain).max(axis=1), 0.0)
    mine = [pairs.first == index for index in range(count)]
    deviation = tuple(float(np.expm1(np.median(left[each]))) if each.any() else np.nan for each in mine)
    disagreements = tuple(
        _disagreement(panorama, pairs, each, surely, tuned) for panorama, each in zip(panoramas, mine, strict=True)
    )
    worst = int(np.nanargmax([*deviation[1:], -1.0])) + 1
    problem = None
    if worst < count and np.log1p(deviation[worst]) > math.log(tuned.too_far):
        problem = (
            f"{_name(panoramas, worst)}: what it shares with the other panoramas differs by {100.0 * deviation[worst]:.0f} "
            "% in the typical point, which no gain explains; is its pose right, and was it taken in the same light?"
        )
    return Balance(
        np.exp(logs).astype(np.float32), tuple(int(each.sum()) for each in mine), deviation, disagreements, problem
    )


def _pairs(
    panoramas: Sequence[Panorama], surfaces: TracedSurfaces, tuned: BalanceParameters, place: PlaceParameters
) -> _Pairs:
    rows = tuned.grid_rows
    photographs = [Photograph(each, surfaces, parameters=place).beside_others(each) for each in panoramas]
    ranges = [_ranges(each.shown_radiance) for each in panoramas]
    bright = [mi.Bool(_near_bright(each.shown_radiance, tuned).reshape(-1)) for each in panoramas]
    grid = pixel_directions(rows, 2 * rows).reshape(-1, 3)
    # A grid on the sphere is denser toward the poles: each row keeps so few that all stand for the same solid angle.
    row, column = np.divmod(np.arange(len(grid)), 2 * rows)
    share = np.sin(np.pi * (row + 0.5) / rows)
    kept = np.floor((column + 1) * share) > np.floor(column * share)
    parts: list[tuple[NDArray, ...]] = []
    for index, (panorama, photograph) in enumerate(zip(panoramas, photographs, strict=True)):
        world = grid[kept] @ panorama.rotation.T
        direction = as_vectors(world)
        hit = surfaces.first_real(mi.Ray3f(mi.Point3f(*map(float, photograph.capture)), direction), mi.Bool(True))
        point = mi.Vector3f(hit.point)
        own = photograph.sighting(point, hit.normal, hit.valid, direction, mi.Bool(True))
        clear_here = ~dr.gather(mi.Bool, bright[index], photograph.map.pixel(own.direction))
        shown = photograph.picture_at(own.direction)
        for other, another in enumerate(photographs):
            if other == index:
                continue
            sighting = another.sighting(point, hit.normal, hit.valid, direction, mi.Bool(True))
            there = another.picture_at(sighting.direction)
            clear = hit.valid & clear_here
            clear &= ~dr.gather(mi.Bool, bright[other], another.map.pixel(sighting.direction))
            for each in (own, sighting):
                clear &= (each.clarity > tuned.clear) & (each.counts > tuned.clear)
                clear &= dr.abs(dr.dot(hit.normal, each.toward)) > tuned.steep
            clear &= dr.dot(hit.normal, own.toward) * dr.dot(hit.normal, sighting.toward) > 0.0
            both = clear.numpy()
            values = shown.numpy().T[both].astype(np.float64), there.numpy().T[both].astype(np.float64)
            if not len(values[0]):
                continue
            usable = np.ones(len(values[0]), bool)
            for value in values:
                usable &= value.min(axis=1) > tuned.dark * np.median(value)
            (darkest, brightest), (darkest_there, brightest_there) = (
                [around[each.map.pixel(seen.direction).numpy()[both][usable]] for around in ranges[number]]
                for each, seen, number in ((photograph, own, index), (another, sighting, other))
            )
            count = int(usable.sum())
            parts.append(
                (
                    np.full(count, index),
                    np.full(count, other),
                    np.flatnonzero(kept)[both][usable],
                    point.numpy().T[both][usable],
                    _log_ratio(values[0][usable], values[1][usable]),
                    _log_ratio(darkest, brightest_there),
                    _log_ratio(brightest, darkest_there),
                )
            )
    if not parts:
        none, no_colours = np.zeros(0, np.int64), np.zeros((0, 3))
        return _Pairs(none, none, none, no_colours.astype(np.float32), no_colours, no_colours, no_colours)
    return _Pairs(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _log_ratio(first: NDArray, second: NDArray) -> NDArray[np.float64]:
    return np.asarray(np.log(np.maximum(first, 1e-30)) - np.log(np.maximum(second, 1e-30)), np.float64)


def _ranges(radiance: NDArray[np.float32]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Darkest and brightest value of each channel among a pixel and its neighbours, shapes (pixels, 3)."""
    mode = ("nearest", "wrap", "nearest")
    darkest, brightest = (each(radiance, (3, 3, 1), mode=mode) for each in (minimum_filter, maximum_filter))
    return darkest.reshape(-1, 3), brightest.reshape(-1, 3)


def _near_bright(radiance: NDArray[np.float32], tuned: BalanceParameters) -> NDArray[np.bool_]:
    """Pixels that are much brighter than the typical one, and those around them, shape (height, 2 height)."""
    brightest = radiance.max(axis=2)
    size = 2 * tuned.bright_rim + 1
    return np.asarray(
        maximum_filter(brightest > tuned.bright * np.median(brightest), size, mode=("nearest", "wrap")), bool
    )


def _unconnected(pairs: _Pairs, free: NDArray[np.bool_], fewest: int) -> int | None:
    """A photograph whose gain nothing determines, or ``None``."""
    known = set(np.flatnonzero(~free).tolist())
    while len(known) < len(free):
        inside = np.isin(pairs.first, list(known))
        reached = [
            index
            for index in range(len(free))
            if index not in known and np.count_nonzero(inside & (pairs.second == index)) >= fewest
        ]
        if not reached:
            return min(index for index in range(len(free)) if index not in known)
        known |= set(reached)
    return None


def _solved(pairs: _Pairs, free: NDArray[np.bool_], channel: int, tuned: BalanceParameters) -> NDArray[np.float64]:
    """Logarithms of the gains of one channel, by iteratively reweighted least squares with Cauchy's weights."""
    logs = np.zeros(len(free))
    unknown = np.flatnonzero(free)
    if not len(unknown):
        return logs
    ratio = pairs.ratio[:, channel]
    design = (pairs.first[:, None] == unknown).astype(float) - (pairs.second[:, None] == unknown)
    # From the medians of pairs, so that a large part of outliers cannot lead astray.
    weight = np.ones(len(ratio))
    for first in range(len(free)):
        for second in range(len(free)):
            chosen = (pairs.first == first) & (pairs.second == second)
            if chosen.any():
                weight[chosen] = 1.0 / (1.0 + np.square((ratio[chosen] - np.median(ratio[chosen])) / tuned.scale))
    for _ in range(tuned.rounds):
        scaled = np.sqrt(weight)[:, None]
        logs[unknown] = np.linalg.lstsq(design * scaled, -ratio * scaled[:, 0], rcond=None)[0]
        left = ratio + logs[pairs.first] - logs[pairs.second]
        weight = 1.0 / (1.0 + np.square(left / tuned.scale))
    return logs


def _disagreement(
    panorama: Panorama,
    pairs: _Pairs,
    mine: NDArray[np.bool_],
    left: NDArray[np.float64],
    tuned: BalanceParameters,
) -> Disagreement | None:
    """Where one photograph's points disagree with the others'."""
    off = mine & (left > math.log(tuned.disagrees))
    if not off.any():
        return None
    rows = tuned.grid_rows
    marked = np.zeros(2 * rows * rows, bool)
    marked[pairs.cell[off]] = True
    # The grid has gaps toward the poles.
    regions, _ = connected_regions(_closed(marked.reshape(rows, 2 * rows)))
    of_point = regions.reshape(-1)[pairs.cell[off]]
    largest = np.bincount(of_point).argmax()
    inside = np.flatnonzero(off)[of_point == largest]
    points = pairs.point[inside].astype(np.float64)
    middle = points[np.argmin(np.linalg.norm(points - np.median(points, axis=0), axis=1))]
    u, v = direction_to_latlong((middle - panorama.position) @ panorama.rotation)
    height, width = panorama.radiance.shape[:2]
    return Disagreement(
        float(off.sum() / mine.sum()),
        min(int(float(v) * height), height - 1),
        min(int(float(u) * width), width - 1),
        middle,
        float(len(inside) / mine.sum()),
    )


def _closed(marked: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Marked cells and those beside them in their row."""
    return np.asarray(marked | np.roll(marked, 1, axis=1) | np.roll(marked, -1, axis=1))


def _shares_nothing(panoramas: Sequence[Panorama], alone: int) -> str:
    return (
        f"{_name(panoramas, alone)}: sees next to nothing that another panorama sees too, so that its gain cannot be "
        "solved; correct its pose or the model, or give its gain"
    )


def _name(panoramas: Sequence[Panorama], index: int) -> str:
    path = panoramas[index].path
    return f"[[panorama]] {index + 1}" + (f" ({path})" if path else "")
