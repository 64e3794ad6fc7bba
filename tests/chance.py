"""Limits of statistical tests: from how often they may fail by chance, and for how large an error they must not pass."""

import numpy as np
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
