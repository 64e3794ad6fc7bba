"""The tuned constants of finding the pose of a panorama and the camera of a photograph."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass

from lightdepth.parameters.ranges import CHECKED, Count, Counts, Depth, NotNegative, Positive, Probability, Share

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
        second_starts: rotations from which the search for a second panorama's pose begins.
        second_start_scale: standard deviations from which on a point counts less where these are compared.
        second_kept: best of them, that are refined.
        second_scale: as ``second_start_scale``, where they are refined.
        second_weighings: times that the best is refined again, with the points weighted as from its position.
        second_contradiction: click errors of the residual beyond which the points contradict each other.
        second_culprit: as ``view_culprit``, of a point.
        second_behind: cost of a point that the rays meet behind a capture point: the mirrored solutions have all of them
            there.
        second_grazing: least cosine of a ray with a surface's normal.
        second_samples: sets of eight points that are tried where many may be wrong.
        second_rounds: times that a pose is then solved from the points that agree with the last one.
        doubtful_position: share of the baseline by which a second panorama's position may be off, two standard deviations,
            without a warning.
        feature_side: pixels of a view in which features are looked for, at most.
        features: in a view, at most.
        feature_contrast: least contrast of a feature, as SIFT counts it.
        feature_ratio: of the distances to the best and to the second description, above which a match is ambiguous
            (Lowe's test).
        feature_same: degrees; matches nearer to each other than this in both panoramas count once.
        feature_error: degrees of a match's standard deviation.
        feature_tolerance: degrees within which a right match agrees with the pose.
        feature_fewest: matches that are needed, and must agree.
        feature_share: of the matches that must agree: fewer do so by chance.
        match_rounds: times that templates of a shared point's surroundings are drawn, each with a better pose.
        match_reach: click errors within which the template is searched.
        match_half: half the template's side, pixels of the panorama in which they are larger.
        match_coarsenings: times that these pixels are enlarged, in turn, until there is enough to be seen in the template.
        match_finest: samples of a pixel along either side, at most.
        match_nearer: share of its distance by which a surface must be nearer to be another one.
        match_least_known: share of the template that must be seen by the first panorama.
        match_likeness: least correlation of the template with what is found.
        match_sharpness: by how much the correlation must fall one pixel away, in the direction in which it falls least:
            edges slide.
        match_independent: differences between the template and the picture that count as independent of each other.
        match_apart: pixels around the best place within which no second place as good counts.
        match_ambiguity: share of the best place's misfit to that of the second best, above which it is not clear which is
            meant.
        match_error: least standard deviation of a place found, pixels;
        match_vague: and the largest, in multiples of the click's.
        match_outlier: standard deviations by which a place found may be off before the click counts again.
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
    second_starts: Count = 300
    second_start_scale: Positive = 3.0
    second_kept: Count = 8
    second_scale: Positive = 2.0
    second_weighings: Count = 2
    second_contradiction: Positive = 8.0
    second_culprit: Share = 0.4
    second_behind: NotNegative = 10.0
    second_grazing: Positive = 0.02
    second_samples: Count = 2000
    second_rounds: Count = 3
    doubtful_position: Positive = 0.05
    feature_side: Annotated[Count, Field(ge=64)] = 640
    features: Count = 1200
    feature_contrast: Positive = 0.02
    feature_ratio: Share = 0.8
    feature_same: Positive = 0.15
    feature_error: Positive = 0.15
    feature_tolerance: Positive = 0.6
    feature_fewest: Count = 20
    feature_share: Share = 0.25
    match_rounds: Count = 2
    match_reach: Positive = 4.0
    match_half: Count = 9
    match_coarsenings: Counts = (1, 2)
    match_finest: Annotated[Count, Field(ge=2)] = 4
    match_nearer: Share = 0.02
    match_least_known: Share = 0.75
    match_likeness: Share = 0.8
    match_sharpness: Positive = 0.002
    match_independent: Count = 20
    match_apart: Depth = 3
    match_ambiguity: Share = 0.7
    match_error: Positive = 0.3
    match_vague: Positive = 0.5
    match_outlier: Positive = 8.0


DEFAULT = CalibrationParameters()
"""What poses are found with."""
