"""Limits of statistical tests: from how often they may fail by chance, and for how large an error they must not pass."""

import argparse
import os
import sys
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

FALSE_ALARM = 5e-7
"""Chance that one comparison fails though nothing is wrong, whatever the processor and the seed."""


RECORD = os.environ.get("LIGHTDEPTH_TEST_RECORD")
"""File that `check_seen` adds its statistics to, instead of comparing them; `python -m tests.chance FILE SEEDS` makes a
`Seen` of those of each line."""


@dataclass(frozen=True)
class Seen:
    """What a statistic was with other seeds, by which its limits are judged.

    Attributes:
        seeds: how many.
        lowest: mean over the seeds; of several values that have limits in common, the lowest one.
        highest: likewise.
        deviation: standard deviation over the seeds, the largest of the values'.
    """

    seeds: int
    lowest: float
    highest: float
    deviation: float

    def far(self, comparisons: int = 1) -> float:
        """How far from the mean another seed's value may lie, with `FALSE_ALARM`: Student's prediction interval."""
        return standard_errors(self.seeds - 1, comparisons) * self.deviation * float(np.sqrt(1.0 + 1.0 / self.seeds))


def check_seen(value: ArrayLike, seen: Seen, low: float = -np.inf, high: float = np.inf) -> None:
    """Assert that a nearly normal statistic lies within limits, and that no seed may put it beyond them.

    For what one estimate costs too much to make many. An error is caught as surely as that if it moves the statistic
    by the distance of the limit from the mean and `Seen.far` more, which is never over twice the distance.

    Args:
        value: one, or several of any shape with the same limits.
        seen: with other seeds.
        low: limit.
        high: limit.
    """
    value = np.asarray(value, np.float64)
    if RECORD:
        test = os.environ["PYTEST_CURRENT_TEST"].rpartition(" ")[0]
        with Path(RECORD).open("a", encoding="utf-8") as file:
            file.write(f"{test}\t{sys._getframe(1).f_lineno}\t{' '.join(map(repr, value.ravel().tolist()))}\n")
        return
    far = seen.far(value.size)
    assert seen.lowest - far > low, f"of a million seeds one lies below {low}: {seen.lowest - far}"
    assert seen.highest + far < high, f"of a million seeds one lies above {high}: {seen.highest + far}"
    assert (value > low).all(), f"{value.min()}, not above {low}; with other seeds {seen}"
    assert (value < high).all(), f"{value.max()}, not below {high}; with other seeds {seen}"


def standard_errors(degrees: int | None = None, comparisons: int = 1) -> float:
    """How many standard errors a correct mean may lie off, two-sided.

    Args:
        degrees: of freedom of the standard error, `None` where it is known (normal distribution).
        comparisons: how many share `FALSE_ALARM` (Bonferroni).
    """
    chance = 0.5 * FALSE_ALARM / comparisons
    return float(stats.norm.isf(chance) if degrees is None else stats.t.isf(chance, degrees))


def mean_and_limit(values, comparisons: int = 1) -> tuple[float, float]:
    """Mean of independent values, and how far it may lie from the true one (Student).

    Args:
        values: shape (n,), each a mean over many paths, so that they are nearly normal.
        comparisons: how many share `FALSE_ALARM`.
    """
    values = np.asarray(values, np.float64)
    error = float(values.std(ddof=1)) / np.sqrt(len(values))
    return float(values.mean()), standard_errors(len(values) - 1, comparisons) * error


def enough(values, limit: float, comparisons: int = 1) -> int:
    """How many values in all make the limit of `mean_and_limit` of these many degrees as small as wanted.

    Stein's procedure in two steps (1945): the standard deviation comes from the first values alone, so that the mean of
    all, compared with that deviation, follows Student's distribution however many are added.

    Args:
        values: the first ones, shape (n,).
        limit: wanted.
        comparisons: how many share `FALSE_ALARM`.
    """
    values = np.asarray(values, np.float64)
    wanted = standard_errors(len(values) - 1, comparisons) * float(values.std(ddof=1)) / limit
    return max(len(values), int(np.ceil(wanted**2)))


def check_mean(
    measure: Callable[[int], ArrayLike],
    expected: ArrayLike,
    caught: ArrayLike,
    tolerance: float = 0.0,
    first: int = 12,
    most: int = 48,
) -> NDArray[np.float64]:
    """Assert that independent estimates have the mean that they should have, with a false alarm once in `1 / FALSE_ALARM`.

    As many estimates are made as it takes for errors of twice ``caught`` to be found as surely as that.

    Args:
        measure: an estimate, or several of shape (k,), by seed.
        expected: the true means.
        caught: absolute errors of the means, one or (k,), that are not taken for chance.
        tolerance: absolute error that all estimates may have in common, such as that of a recovered irradiance.
        first: estimates that say how many are needed.
        most: estimates at most.

    Returns:
        The means, shape (k,).
    """
    values = np.stack([np.atleast_1d(np.asarray(measure(seed), np.float64)) for seed in range(first)])
    comparisons = values.shape[1]
    wanted = np.broadcast_to(np.asarray(caught, np.float64), comparisons)
    count = max(enough(column, each, comparisons) for column, each in zip(values.T, wanted, strict=True))
    assert count < 16 * most, f"{count} estimates are needed to catch errors of {caught}"
    count = min(
        count, most
    )  # Where one of the first is an outlier, an error up to four times as large passes that once.
    more = [np.atleast_1d(np.asarray(measure(seed), np.float64)) for seed in range(first, count)]
    means = np.concatenate([values, *([np.stack(more)] if more else [])]).mean(axis=0)
    limit = standard_errors(first - 1, comparisons) * values.std(axis=0, ddof=1) / np.sqrt(count)
    off = np.abs(means - expected)
    rounding = 1e-6 * np.abs(means)  # Where all estimates are alike.
    assert (off <= limit + tolerance + rounding).all(), f"means {means}, expected {expected} to {limit + tolerance}"
    return means


def main() -> None:
    """Print what was seen, from a file of `RECORD`."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("file", type=Path)
    parser.add_argument("seeds", type=int, help="how many runs wrote to it")
    arguments = parser.parse_args()
    found = defaultdict(list)
    for line in arguments.file.read_text(encoding="utf-8").splitlines():
        test, number, values = line.split("\t")
        found[test.partition("[")[0], int(number)].append([float(value) for value in values.split()])
    for (test, number), rows in sorted(found.items()):
        values = np.array(rows).reshape(arguments.seeds, -1)  # Loops and parameters pass a line several times a run.
        means, deviation = values.mean(axis=0), values.std(axis=0, ddof=1).max()
        seen = Seen(arguments.seeds, *(float(f"{each:.3g}") for each in (means.min(), means.max(), deviation)))
        print(f"{test}, line {number}, {len(rows[0])} values: {seen}, furthest {seen.far(len(rows[0])):.2g}")


if __name__ == "__main__":
    main()
