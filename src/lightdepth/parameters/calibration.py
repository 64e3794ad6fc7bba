"""The tuned constants of finding the pose of a panorama and the camera of a photograph."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass

from lightdepth.parameters.ranges import CHECKED, Count, NotNegative, Positive, Probability, Share

FieldsOfView = Annotated[tuple[Annotated[Positive, Field(lt=180.0)], ...], Field(min_length=1)]


@dataclass(frozen=True, config=CHECKED)
class CalibrationParameters:
    """How ``lightdepth calibrate`` finds edges, and how far it trusts clicks.

    Attributes:
        edge_largest_width: pixels; wider panoramas are reduced to at most this before edges are looked for.
        edge_fineness: pixels of the views in which edges are looked for, to one of the panorama, in a view's middle.
        edge_shortest: degrees; shorter edges are left out.
        edge_noisy: standard deviation of the noise, of 255 levels, above which a picture is denoised: more would break
            edges up.
        edge_denoising: strength of the denoising, in standard deviations of the noise.
        frame_fewest_edges: without which no room is looked for.
        frame_triples: random triples of edges, each of which gives a frame to begin with.
        frame_half_triples: the same for each random half of the edges.
        frame_kept: best of these frames, that are refined.
        frame_steps: of the refinement.
        frame_tolerance: degrees by which the ends of an edge may be off for it to count fully or partly.
        frame_horizontal_weight: of a horizontal edge beside a vertical one. Gravity makes verticals plumb; walls are only
            roughly square to each other, and a stitched panorama stretches heights more than it leans verticals. These
            errors are shared by many edges, so that their number does not lessen them. Horizontals are left to decide
            the heading, and the level where there are hardly any verticals.
        frame_short: degrees of length up to which an edge's ends get more certain with it. The detector fits a segment to
            all its pixels, so that the variance of its ends falls with its length, but only down to what masonry and
            stitching leave: in proportion to 1 + ``frame_short`` / length.
        frame_halves: random halves of the edges that are solved again for the confidence.
        frame_agreement: degrees within which the solution of a half must be.
        frame_least_error: degrees; no agreement of edges makes a frame more certain: masons and stitching leave as much.
        snap_reach: standard deviations of a click within which the edge along a rectangle's side is searched.
        snap_blur: standard deviation of the blur before edges are looked for, half pixels of the panorama.
        snap_least_agreement: share of a side's length along which the picture must get brighter toward the same side of
            it.
        snap_most_edges: edges beside each other that are considered for a side: a rug's border has several.
        snap_corner: share of a side at either end that is not looked at: what lies there may belong to the other side.
        snap_error: standard deviation of a corner found, along either axis, in pixels of the panorama.
        rectangle_angle: degrees by which the sides of a rectangle may be off a right angle,
        rectangle_measure: and share by which it may be off its known measures,
        rectangle_errors: or standard deviations that the clicks leave, whichever is more.
        measure_error: relative standard deviation of a length measured in the place.
        walls_parallel: degrees within which a floor rectangle is taken to lie along the walls.
        plumb: degrees of azimuth within which two points are taken to stand one above the other.
        sure_directions: confidence from which on directions that edges show are used beside clicks, and written.
        doubtful_clicks: click errors by which a cue may miss the solution without a warning.
        doubtful_tilt: degrees from which on a tilt is doubted.
        doubtful_rotation: degrees of the expected error of a rotation from which on another cue is asked for.
        doubtful_focal_length: the same of its relative error.
        view_fovs: degrees from which the search for a photograph's camera begins where its field of view is free.
        view_starts: best starts that are followed, until one is as good as clicks can be.
        view_spins: turns about an axis, known by lines, that are tried where points give the rest.
        view_evaluations: of the errors from each start, at most.
        view_false_alarm: chance that clicks as good as they are said to be are called contradictory.
        view_hopeless: root mean square residual, in click errors, from which there is no use in a result.
        view_culprit: share of the residual that is left without a cue, below which that cue is named as wrong.
        view_undetermined: share of the best determined unknown's effect on the errors, below which one has none.
        view_largest_distortion: coefficient of the lens.
        map_pixels: of an ST map to which a lens is fitted.
        map_error: pixels by which a fitted lens may miss a map without a warning.
    """

    edge_largest_width: Count = 2048
    edge_fineness: Positive = 1.3
    edge_shortest: NotNegative = 1.5
    edge_noisy: NotNegative = 2.0
    edge_denoising: Positive = 1.2
    frame_fewest_edges: Count = 20
    frame_triples: Count = 800
    frame_half_triples: Count = 200
    frame_kept: Count = 5
    frame_steps: Count = 15
    frame_tolerance: Positive = 0.5
    frame_horizontal_weight: Positive = 0.03
    frame_short: NotNegative = 10.0
    frame_halves: Count = 16
    frame_agreement: Positive = 1.0
    frame_least_error: Positive = 0.2
    snap_reach: Positive = 3.0
    snap_blur: Positive = 1.5
    snap_least_agreement: Share = 0.85
    snap_most_edges: Count = 3
    snap_corner: Share = 0.06
    snap_error: Positive = 0.5
    rectangle_angle: NotNegative = 1.0
    rectangle_measure: NotNegative = 0.02
    rectangle_errors: NotNegative = 3.0
    measure_error: Positive = 0.01
    walls_parallel: NotNegative = 5.0
    plumb: Positive = 3.0
    sure_directions: Share = 0.5
    doubtful_clicks: Positive = 3.0
    doubtful_tilt: Positive = 60.0
    doubtful_rotation: Positive = 1.0
    doubtful_focal_length: Positive = 0.03
    view_fovs: FieldsOfView = (18.0, 28.0, 40.0, 55.0, 70.0, 88.0, 108.0)
    view_starts: Count = 5
    view_spins: Count = 24
    view_evaluations: Count = 60
    view_false_alarm: Probability = 1e-3
    view_hopeless: Positive = 8.0
    view_culprit: Share = 0.5
    view_undetermined: Share = 1e-6
    view_largest_distortion: Positive = 3.0
    map_pixels: Count = 4000
    map_error: Positive = 0.05


DEFAULT = CalibrationParameters()
"""What poses are found with."""
