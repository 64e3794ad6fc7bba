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
Ratio = Annotated[Positive, Field(gt=1.0)]
"""More than 1; its inverse counts as well."""
NotNegative = Annotated[float, Field(strict=True, ge=0.0, allow_inf_nan=False)]
"""0 or more."""
Distances = Annotated[tuple[Positive, ...], Field(min_length=1)]
"""One or more, each more than 0, in the order in which they are used."""

CHECKED = ConfigDict(extra="forbid")
"""Of every parameters object: no name is misspelt unnoticed."""
