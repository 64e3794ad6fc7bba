"""The kinds of numbers that parameters are."""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, ConfigDict, Field


def _power_of_two(value: int) -> int:
    if value & (value - 1):
        raise ValueError("must be a power of two")
    return value


Count = Annotated[int, Field(strict=True, ge=1)]
"""1 or more."""
PowerOfTwo = Annotated[Count, AfterValidator(_power_of_two)]
"""Points of a Sobol sequence, which is even in these numbers alone."""
Depth = Annotated[int, Field(strict=True, ge=0)]
"""0 or more."""
Share = Annotated[float, Field(strict=True, ge=0.0, le=1.0)]
"""0 to 1."""
Probability = Annotated[float, Field(strict=True, gt=0.0, lt=1.0)]
"""Between 0 and 1."""
Positive = Annotated[float, Field(strict=True, gt=0.0, allow_inf_nan=False)]
"""More than 0."""
Factor = Annotated[Positive, Field(ge=1.0)]
"""1 or more."""
Ratio = Annotated[Positive, Field(gt=1.0)]
"""More than 1; its inverse counts as well."""
NotNegative = Annotated[float, Field(strict=True, ge=0.0, allow_inf_nan=False)]
"""0 or more."""
Counts = Annotated[tuple[Count, ...], Field(min_length=1)]
"""One or more, each 1 or more, in the order in which they are used."""
Positives = Annotated[tuple[Positive, ...], Field(min_length=1)]
"""One or more, each more than 0, in the order in which they are used."""

CHECKED = ConfigDict(extra="forbid")
"""Of every parameters object: no name is misspelt unnoticed."""


def must_be_in_order(values: object, *pairs: tuple[str, str], strictly: bool = False) -> None:
    """Refuse parameters of which one must not exceed another.

    Args:
        values: the parameters' object.
        pairs: names of two of its fields, the smaller one first.
        strictly: whether they must differ.

    Raises:
        ValueError: a pair is not in order.
    """
    for less, more in pairs:
        one, other = getattr(values, less), getattr(values, more)
        if one > other or (strictly and one == other):
            raise ValueError(f"{less} must be {'less than' if strictly else 'at most'} {more}")
