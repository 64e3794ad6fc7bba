"""Limits of statistical tests: from how often they may fail by chance, and for how large an error they must not pass."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import stats

FALSE_ALARM = 5e-7
"""Chance that one comparison fails though nothing is wrong, whatever the processor and the seed."""


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
