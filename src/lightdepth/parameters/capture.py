"""The tuned constants of making a panorama of photographs."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator
from pydantic.dataclasses import dataclass

from lightdepth.parameters.ranges import (
    CHECKED,
    Count,
    NotNegative,
    Positive,
    Positives,
    Ratio,
    Share,
    must_be_in_order,
)


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
        response_least_slope: of the response's logarithm over the reading, by which a reading's noise is taken.
        response_scale: standard deviations of the differences from which on a patch loses its say.
        align_side: pixels; photographs are compared at this size at most. The result is good to some hundredths of such a
            pixel.
        align_trust: in a reading of one photograph,
        align_reading: and reading of the next one, from which on the two are compared at a pixel.
        align_least_share: of such pixels, without which nothing is moved.
        align_iterations: of the refinement, at most.
        align_change: of the correlation that ends it.
        align_least_correlation: below which two photographs were not found to show the same; they are then taken to lie as
            they are.
        merge_least_trust: in a black pixel of the longest exposure.
        merge_ghost: difference of readings in [0, 1] beyond which something moved; noise is alike in all readings, and
            much smaller.
        merge_ghost_blur: pixels across the square over which such differences are means.
        merge_ghost_rim: pixels across the square around each such pixel that counts as moved: edges are half transparent.
        merge_well_exposed: trust in a reading of the middle exposure, from which on it is what others are compared with.
        merge_same: ratio of exposures up to which they are said to be the same.
        merge_unlike: photographs of one view whose brightness differs by more were not exposed as is stated.
        merge_cells: width in cells of the small pictures by which the views of a bracket are compared.
        merge_least_cells: share of the cells that two photographs must both expose well to be compared.
        merge_alike: by how much the logarithm of a cell's brightness may differ in pictures of one view.
        merge_least_alike: share of the cells that are so alike in pictures of one view,
        merge_likeness: or their correlation.
        negative: share of negative pixels from which on they are named; developers leave a few in the dark.
        circle_side: pixels of the longer side in which a fisheye's circle is searched.
        circle_black: light around a circle, at most, as a share of white.
        circle_edge: light, between black and bright, from which on a point lies inside a circle.
        circle_fewest_points: on the edge between light and black.
        circle_trials: circles through three of these points.
        circle_tolerance: pixels from a circle up to which a point lies on it.
        circle_least_share: of the points that must lie on the circle.
        circle_reach: share of its radius by which a circle of linear light is refined, at most.
        circle_contrast: times that light inside its edge is brighter than outside,
        circle_lit: and share of the median all around, from which on the edge is seen at a place.
        circle_least_lit: share of the places all around at which it must be.
        circle_tolerances: pixels up to which a place counts, from one fit to the next.
        rig_tolerance: degrees that the camera may stand from where the rig says, field of view included.
        lens_least_fov: field of view over the stated one, at least, for a lens that could be real,
        lens_greatest_fov: and at most.
        lens_least_slope: of the distorted radius over the radius, at least,
        lens_greatest_slope: and at most: distortion is mild.
        lens_shift: share of the width by which the axis may be off the picture's middle.
        matching_smallest: pixels of the longer side of the pictures in which control points are looked for, at least,
        matching_largest: and at most.
        matching_contrast: limit to which their local contrast is raised.
        wrong_point: degrees between the two directions of a control point from which on it is reported.
        large_gain: stops between photographs from which on their exposures are reported to differ.
        stitch_distrust: weight of pixels that are clipped or black in every exposure: they count where nothing else does.
        photometry_directions: at which photographs are compared; OpenCV looks up 32766 at once, at most.
        photometry_even: local relative contrast around a direction up to which it counts in full.
        photometry_prior: weight of gains of 1, relative to what photographs show: what agrees stays as it is.
        photometry_rounds: in which what disagrees loses its say.
        photometry_scale: standard deviations of the differences from which on it does.
        blend_sharpness: the weight of a pixel is its distance from the photograph's edge to this power: each direction is
            mostly one's.
        dual_smallest_fov: degrees across a circle of a camera with two lenses, that are tried,
        dual_largest_fov: to this,
        dual_fov_step: in these steps.
        dual_around: points along the seam,
        dual_across: and across it, at which the two pictures are compared.
        dual_band: degrees on both sides of the seam in which they are, while the field of view is not known,
        dual_widest_band: and at most.
        dual_gain_band: degrees on both sides in which their exposures are compared.
        dual_rim: share of a circle's radius beyond which the lens mount shades the picture.
        dual_blurs: pixels by which the pictures are blurred while they are aligned, one after the other.
        dual_evaluations: of their agreement for each of these, at most.
        dual_agreeing: correlation in the overlap below which poses found are not to be trusted.
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
    response_least_slope: Positive = 0.5
    response_scale: Positive = 3.0
    align_side: Count = 1600
    align_trust: Share = 0.3
    align_reading: Share = 0.03
    align_least_share: Share = 0.001
    align_iterations: Count = 60
    align_change: Positive = 1e-5
    align_least_correlation: Share = 0.8
    merge_least_trust: Share = 0.05
    merge_ghost: Share = 0.05
    merge_ghost_blur: Count = 5
    merge_ghost_rim: Count = 9
    merge_well_exposed: Share = 0.95
    merge_same: Ratio = 1.05
    merge_unlike: Ratio = 1.5
    merge_cells: Count = 32
    merge_least_cells: Share = 0.12
    merge_alike: Positive = 0.25
    merge_least_alike: Share = 0.5
    merge_likeness: Share = 0.4
    negative: Share = 0.01
    circle_side: Count = 1200
    circle_black: Share = 0.012
    circle_edge: Share = 0.15
    circle_fewest_points: Count = 24
    circle_trials: Count = 300
    circle_tolerance: Positive = 2.5
    circle_least_share: Share = 0.6
    circle_reach: Positive = 0.03
    circle_contrast: Ratio = 4.0
    circle_lit: Share = 0.1
    circle_least_lit: Share = 0.5
    circle_tolerances: Positives = (2.0, 1.0, 0.5)
    rig_tolerance: Positive = 12.0
    lens_least_fov: Positive = 0.7
    lens_greatest_fov: Positive = 1.4
    lens_least_slope: Positive = 0.6
    lens_greatest_slope: Positive = 1.6
    lens_shift: Positive = 0.08
    matching_smallest: Count = 800
    matching_largest: Count = 2000
    matching_contrast: Positive = 3.0
    wrong_point: Positive = 2.0
    large_gain: Positive = 0.5
    stitch_distrust: Share = 0.01
    photometry_directions: Annotated[Count, Field(le=32_766)] = 30_000
    photometry_even: Positive = 0.02
    photometry_prior: Positive = 1e-3
    photometry_rounds: Count = 12
    photometry_scale: Positive = 2.0
    blend_sharpness: Positive = 4.0
    dual_smallest_fov: Positive = 184.0
    dual_largest_fov: Annotated[Positive, Field(lt=360.0)] = 220.0
    dual_fov_step: Positive = 3.0
    dual_around: Count = 720
    dual_across: Count = 9
    dual_band: Positive = 1.2
    dual_widest_band: Positive = 8.0
    dual_gain_band: Positive = 3.0
    dual_rim: Share = 0.985
    dual_blurs: Positives = (6.0, 2.0)
    dual_evaluations: Count = 160
    dual_agreeing: Share = 0.5

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        must_be_in_order(
            self,
            ("black", "white"),
            ("lens_least_fov", "lens_greatest_fov"),
            ("lens_least_slope", "lens_greatest_slope"),
            ("matching_smallest", "matching_largest"),
            ("dual_smallest_fov", "dual_largest_fov"),
            ("dual_band", "dual_widest_band"),
        )
        return self


DEFAULT = CaptureParameters()
"""What panoramas are made with."""
