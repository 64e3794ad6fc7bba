"""The tuned constants of making a panorama of photographs."""

from __future__ import annotations

from typing import Self

from pydantic import model_validator
from pydantic.dataclasses import dataclass

from lightdepth.parameters.ranges import CHECKED, Count, NotNegative, Positive, Ratio, Share


@dataclass(frozen=True, config=CHECKED)
class CaptureParameters:
    """How ``lightdepth capture`` merges brackets and stitches orientations.

    Attributes:
        bracket_same: stops; exposures that differ by less are the same.
        bracket_least_span: stops that a bracket spans at least where no exposure comes again.
        white_balance_same: relative difference of white balances from which on it is named.
        black: reading in [0, 1] below which it says only that it was darker,
        white: and above which it says only that it was brighter.
        reading_fade: difference from these over which the trust in a reading rises.
        response_patch: side in pixels of the patches whose mean reading is a sample of the response.
        response_most_patches: in larger photographs only every second, third, ... patch is looked at.
        response_samples: most even patches that a response is recovered from.
        response_least_range: greatest over least exposure from which on a response can be recovered.
        response_fewest_readings: neither black nor white, that determine a channel's response.
        response_smoothness: of the response's difference from sRGB, relative to what the readings say.
        response_rounds: in which patches that changed during the bracket lose their say.
        align_side: pixels; photographs are compared at this size at most. The result is good to some hundredths of such a
            pixel.
        align_iterations: of the refinement, at most.
        align_change: of the correlation that ends it.
        align_least_correlation: below which two photographs were not found to show the same; they are then taken to lie as
            they are.
        merge_least_trust: in a black pixel of the longest exposure.
        merge_ghost: difference of readings in [0, 1] beyond which something moved; noise is alike in all readings, and
            much smaller.
        merge_unlike: photographs of one view whose brightness differs by more were not exposed as is stated.
        merge_cells: width in cells of the small pictures by which the views of a bracket are compared.
        merge_least_cells: share of the cells that two photographs must both expose well to be compared.
        merge_alike: by how much the logarithm of a cell's brightness may differ in pictures of one view,
        merge_likeness: and their correlation.
        negative: share of negative pixels from which on they are named; developers leave a few in the dark.
        circle_side: pixels of the longer side in which a fisheye's circle is searched.
        circle_black: light around a circle, at most, as a share of white.
        circle_fewest_points: on the edge between light and black.
        circle_trials: circles through three of these points.
        circle_tolerance: pixels from a circle up to which a point lies on it.
        circle_least_share: of the points that must lie on the circle.
    """

    bracket_same: Positive = 0.1
    bracket_least_span: Positive = 0.9
    white_balance_same: NotNegative = 0.01
    black: Share = 0.01
    white: Share = 0.985
    reading_fade: Positive = 0.08
    response_patch: Count = 4
    response_most_patches: Count = 60_000
    response_samples: Count = 2000
    response_least_range: Ratio = 1.3
    response_fewest_readings: Count = 64
    response_smoothness: Positive = 100.0
    response_rounds: Count = 5
    align_side: Count = 1600
    align_iterations: Count = 60
    align_change: Positive = 1e-5
    align_least_correlation: Share = 0.8
    merge_least_trust: Share = 0.05
    merge_ghost: Share = 0.05
    merge_unlike: Ratio = 1.5
    merge_cells: Count = 32
    merge_least_cells: Share = 0.12
    merge_alike: Positive = 0.25
    merge_likeness: Share = 0.4
    negative: Share = 0.01
    circle_side: Count = 1200
    circle_black: Share = 0.012
    circle_fewest_points: Count = 24
    circle_trials: Count = 300
    circle_tolerance: Positive = 2.5
    circle_least_share: Share = 0.6

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if self.black >= self.white:
            raise ValueError("black must be below white")
        return self


DEFAULT = CaptureParameters()
"""What panoramas are made with."""
