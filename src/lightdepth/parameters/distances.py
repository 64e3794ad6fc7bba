"""The tuned constants of reading images of distances: what their numbers seem to be, and what is said about them."""

from __future__ import annotations

from typing import Self

from pydantic import model_validator
from pydantic.dataclasses import dataclass

from lightdepth.parameters.ranges import CHECKED, Count, NotNegative, Positive, Probability, Share, must_be_in_order


@dataclass(frozen=True, config=CHECKED)
class DistancesParameters:
    """How the kind of distances is recognised, and which ones are reported.

    Attributes:
        near_plane: cosine to the viewing axis below which a distance along it says nothing about the one along the ray.
        fewest_known: pixels without which nothing is guessed.
        negative: share of them that is negative, from which on the sign may be that of the viewing axis,
        negative_behind: and share of them whose sign is that of the axis.
        beside: cosine to the viewing axis up to which a pixel lies beside it,
        fewest_beside: pixels there without which that says nothing,
        vanishing: and share of the median up to which their median vanishes: distances along the axis do.
        steep: sine of the angle to the horizon from which on a row is looked at that may show a floor or a ceiling,
        fewest_rows: and how many are needed.
        least_slope: least exponent by which the values of a floor go with that sine where they are reciprocal distances,
        largest_slope: and the largest. It is 1, and -1 for distances.
        far_row: rows' worth of pixels at the same distance above which it seems to be a mark: by chance a level floor or
            ceiling meets a row at exactly one distance, and both of them two.
        far_share: the same as a share of all.
        far_fewest: pixels at the same distance above which it is a mark where all others are much nearer,
        far_fewest_share: and share of all,
        far_ratio: and how many times nearer.
        farthest_surface: metres beyond which one hardly sees any.
        largest_median: metres above which half of the distances are none.
        normalised: share of 1 from which on the largest distance seems to be the end of a normalised range.
    """

    near_plane: Probability = 0.02
    fewest_known: Count = 64
    negative: Share = 0.1
    negative_behind: Share = 0.9
    beside: Share = 0.05
    fewest_beside: Count = 16
    vanishing: Share = 0.15
    steep: Share = 0.6
    fewest_rows: Count = 4
    least_slope: Positive = 0.7
    largest_slope: Positive = 1.3
    far_row: NotNegative = 2.5
    far_share: Share = 0.01
    far_fewest: Count = 16
    far_fewest_share: Share = 0.002
    far_ratio: Positive = 5.0
    farthest_surface: Positive = 2e4
    largest_median: Positive = 300.0
    normalised: Share = 0.99

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        must_be_in_order(self, ("least_slope", "largest_slope"))
        return self


DEFAULT = DistancesParameters()
"""What distances are read with."""
