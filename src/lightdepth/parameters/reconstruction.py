"""The tuned constants of making a place's surfaces from a panorama, clicks, depth or points."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import AfterValidator, Field, model_validator
from pydantic.dataclasses import dataclass

from lightdepth.parameters.ranges import (
    CHECKED,
    Count,
    Depth,
    Factor,
    NotNegative,
    Positive,
    Probability,
    Ratio,
    Share,
    must_be_in_order,
)


def _odd(value: int) -> int:
    if value % 2 == 0:
        raise ValueError("must be odd")
    return value


Angle = Annotated[Positive, Field(lt=90.0)]
"""Degrees between 0 and 90."""
Width = Annotated[Annotated[int, Field(strict=True, ge=3)], AfterValidator(_odd)]
"""Pixels across a square around one."""


@dataclass(frozen=True, config=CHECKED)
class ClickParameters:
    """How exactly clicks must fit together, for ``lightdepth reconstruct layout``.

    Attributes:
        horizon: degrees below the horizon at which a click on the floor lies at least, and above it one on the ceiling.
        ceiling_corner: degrees of azimuth that a ceiling corner may be clicked beside its floor corner.
        steepest_slope: degrees from the horizontal that a sloped ceiling may have.
        thinnest_slope: least width of the triangle of a slope's clicks, as a share of its length.
        lamp_beside: degrees of azimuth that a lamp's middle may be beside the point that it hangs from.
        lamp_nearest: metres from the capture point that a lamp's surface must keep.
        lamp_subdivisions: times that an icosahedron is subdivided for a round lamp.
    """

    horizon: Angle = 0.5
    ceiling_corner: Angle = 5.0
    steepest_slope: Angle = 80.0
    thinnest_slope: Share = 0.02
    lamp_beside: Angle = 5.0
    lamp_nearest: NotNegative = 0.05
    lamp_subdivisions: Annotated[Depth, Field(le=6)] = 2


@dataclass(frozen=True, config=CHECKED)
class BoxParameters:
    """How a box is fitted to a room's edges, for ``lightdepth new``.

    Attributes:
        rows: of the maps of edges and colours that are looked up.
        edge_blur: degrees (standard deviation) that a found edge may be off for it to count partly.
        long_edge: degrees of length from which a found edge counts fully.
        short_edge: weight of the shortest edges, where long ones have 1.
        long_contradiction: degrees of length from which an edge that does not fit its surface counts fully.
        beside: degrees between the places at which colours are compared.
        small_step: steps of colour (natural logarithm) that mean little.
        along: degrees along an edge over which its step of colour is compared with itself.
        correlated: degrees over which evidence counts as one observation.
        hidden_below: probability that furniture hides an edge of the floor.
        hidden_above: the same of an edge of the ceiling.
        hidden_upright: the same of an upright edge.
        found: probability that an edge which is seen is found.
        rarest: edges are not taken for rarer than this; one that is found by chance must not decide alone.
        above_weight: weight of edges of the ceiling, where those of the floor have 1.
        upright_weight: weight of upright edges.
        contradiction: how much likelier a found edge that does not fit the surface it lies on is in the room than in any
            box: 5 % of the edges do not fit the room, and 33 % any box.
        agreement: the same of an edge that fits.
        above_horizon: weight of both above the horizon.
        below_horizon: weight of both below it, where there is more furniture.
        on_ceiling: share of a contradiction that an upright edge on the ceiling is, like a hanging lamp.
        on_floor: the same on the floor, like a leg of a table.
        own_colours: degrees of elevation from which on colours are those of the floor or ceiling.
        wall_colours: degrees of elevation up to which colours are those of walls.
        beside_own: degrees of elevation on its own side of the horizon up to which colours are taken for those beside the
            floor or ceiling.
        beside_other: the same on the other side of the horizon.
        below_sides: weight of the colours on the two sides of an edge of the floor.
        above_sides: weight of those of an edge of the ceiling.
        areas: weight of whether floor, walls and ceiling have their colours as areas.
        least_distance: distance of the nearest wall for which the tables hold evidence, camera heights.
        greatest_distance: that of the farthest.
        distances: entries of these tables.
        least_ratio: least ratio of a wall's distance and the ceiling's height above the camera for which the tables hold
            evidence of the ceiling.
        greatest_ratio: the greatest.
        ratios: entries of these tables.
        nearest_wall: distance of the nearest wall that is tried, camera heights.
        farthest_wall: that of the farthest.
        walls: distances that are tried between them.
        lowest_ceiling: height of the lowest ceiling that is tried, camera heights above the camera.
        highest_ceiling: that of the highest.
        ceilings: heights that are tried between them.
        usual_height: metres from floor to ceiling that are expected.
        height_spread: how far (natural logarithm) heights differ from that.
        height_weight: weight of this expectation.
        low_height: metres from floor to ceiling below which rooms are rare.
        low_spread: how soon (natural logarithm) they get rarer below it.
        low_weight: weight of this expectation.
        middle_weight: weight of the expectation that the camera stands about as far from all walls (squares of logarithms).
        pairs: of walls along x that are followed for each ceiling.
        starts: best boxes from which the search goes on by small steps.
        tries: random steps that are tried from each of them, in each of eight rounds.
        settled: how far (natural logarithm) edges are moved onto those of the picture at the end, at most.
        settled_points: points that are looked up along each edge then.
        settled_beside: degrees on either side of an edge at which colours are compared then.
        settled_small_step: ``small_step`` then.
        likely: share of the box's edges that the picture shows from which on it is taken for the room.
    """

    rows: Annotated[Count, Field(ge=64)] = 512
    edge_blur: Positive = 0.6
    long_edge: Positive = 10.0
    short_edge: Share = 0.3
    long_contradiction: Positive = 8.0
    beside: Positive = 1.1
    small_step: Positive = 0.025
    along: Count = 15
    correlated: Positive = 4.0
    hidden_below: Probability = 0.6
    hidden_above: Probability = 0.25
    hidden_upright: Probability = 0.5
    found: Probability = 0.8
    rarest: Annotated[Probability, Field(le=0.9)] = 0.06
    above_weight: Positive = 1.5
    upright_weight: NotNegative = 0.5
    contradiction: Probability = 0.05 / 0.33
    agreement: Ratio = 0.95 / 0.67
    above_horizon: NotNegative = 1.5
    below_horizon: NotNegative = 0.8
    on_ceiling: Share = 0.5
    on_floor: Share = 0.25
    own_colours: Angle = 40.0
    wall_colours: Angle = 30.0
    beside_own: Angle = 5.0
    beside_other: Angle = 40.0
    below_sides: NotNegative = 0.8
    above_sides: NotNegative = 0.5
    areas: NotNegative = 0.3
    least_distance: Positive = 0.25
    greatest_distance: Positive = 10.0
    distances: Annotated[Count, Field(ge=2)] = 140
    least_ratio: Positive = 0.12
    greatest_ratio: Positive = 30.0
    ratios: Annotated[Count, Field(ge=2)] = 200
    nearest_wall: Positive = 0.3
    farthest_wall: Positive = 9.0
    walls: Count = 110
    lowest_ceiling: Positive = 0.3
    highest_ceiling: Positive = 3.6
    ceilings: Count = 60
    usual_height: Positive = 2.75
    height_spread: Positive = 0.25
    height_weight: NotNegative = 11.5
    low_height: Positive = 2.3
    low_spread: Positive = 0.06
    low_weight: NotNegative = 4.0
    middle_weight: NotNegative = 20.0
    pairs: Count = 8
    starts: Count = 12
    tries: Count = 600
    settled: NotNegative = 0.04
    settled_points: Count = 24
    settled_beside: Positive = 0.6
    settled_small_step: Positive = 0.06
    likely: Share = 0.4

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        must_be_in_order(
            self,
            ("least_distance", "greatest_distance"),
            ("least_ratio", "greatest_ratio"),
            ("nearest_wall", "farthest_wall"),
            ("lowest_ceiling", "highest_ceiling"),
            strictly=True,
        )
        if not self.least_distance <= self.nearest_wall < self.farthest_wall <= self.greatest_distance:
            raise ValueError("nearest_wall and farthest_wall must lie within least_distance and greatest_distance")
        return self


@dataclass(frozen=True, config=CHECKED)
class DepthParameters:
    """How the surfaces of a depth image are cleaned and continued, for ``lightdepth reconstruct from-depth``.

    Attributes:
        much_missing: share of all directions that may be unmeasured without a warning.
        largest_hole: half-angle, degrees, of a hole that is closed by going on with the surfaces around it; larger ones
            are closed flatly.
        least_continued: reciprocal distance in a hole, at least, relative to the least around it.
        most_continued: reciprocal distance in a hole, at most, relative to the greatest around it.
        filter_width: pixels across the window of the bilateral filter that takes measurement noise away.
        filter_range: its range, standard deviations of the noise.
        noise_levels: distances at which the noise is estimated.
        noise_pixels: pixels from which it is estimated at each of them, at least.
        negligible_noise: share of the reciprocal distance below which noise is rounding.
        behind_reach: degrees by which a surface goes on behind what stands before it.
        behind_nearer: what is nearer than the background by less than this factor belongs to it.
        behind_gap: the background keeps at least this far behind, as a factor of the reciprocal distance.
        behind_share: of the triangles, for what lies behind.
        unseen_error: metres by which a surface may move in simplification though it need not.
    """

    much_missing: Share = 0.05
    largest_hole: Annotated[Positive, Field(le=180.0)] = 60.0
    least_continued: Share = 0.5
    most_continued: Factor = 4.0
    filter_width: Width = 9
    filter_range: Positive = 4.0
    noise_levels: Annotated[Count, Field(ge=2)] = 12
    noise_pixels: Count = 50
    negligible_noise: NotNegative = 2e-5
    behind_reach: Angle = 10.0
    behind_nearer: Ratio = 1.05
    behind_gap: Share = 0.98
    behind_share: Probability = 0.2
    unseen_error: NotNegative = 0.002


@dataclass(frozen=True, config=CHECKED)
class UnitParameters:
    """How the unknown unit of an estimated depth image is found.

    Attributes:
        rows: of the reduced picture by which it is found.
        tolerance: relative error of an estimated distance up to which a pixel counts for the floor or ceiling.
        steep: sine of the angle to the horizon from which floor and ceiling are looked for.
        fewest_pixels: known pixels well below the horizon, at least.
        trials: of RANSAC, where there may be a shift; a sixth of them where there is none.
        judges: pixels that judge a trial; a score needs no more.
        apart: natural logarithm of the ratio of the distances of the two floor pixels of a trial with a shift, at least.
        least_floor: share of the directions below the horizon that the floor must hold.
        least_score: what floor and ceiling, by ``ceiling_weight``, must hold less what lies below the floor;
            noise has up to 0.3.
        needed_gain: a shift is accepted where floor and ceiling hold this many times as much with it.
        surer: one kind is accepted where it explains this many times as much as the other.
        lowest_ceiling: height of the lowest ceiling above the camera, camera heights.
        highest_ceiling: that of the highest.
        ceiling_step: natural logarithm of the ratio of two neighbouring heights that are tried.
        ceiling_steps: neighbouring heights that a level ceiling takes up.
        ceiling_weight: what a ceiling is worth, where a floor is worth 1.
        ceiling_floor: what the floor must hold for a ceiling to count.
        below: times ``tolerance`` from which on a pixel lies below the floor.
    """

    rows: Count = 64
    tolerance: Positive = 0.12
    steep: Probability = 0.25
    fewest_pixels: Count = 50
    trials: Annotated[Count, Field(ge=6)] = 3000
    judges: Count = 4000
    apart: NotNegative = 0.25
    least_floor: Share = 0.15
    least_score: Share = 0.35
    needed_gain: Factor = 1.15
    surer: Factor = 1.2
    lowest_ceiling: Positive = 0.25
    highest_ceiling: Positive = 6.0
    ceiling_step: Positive = 0.04
    ceiling_steps: Count = 4
    ceiling_weight: NotNegative = 0.5
    ceiling_floor: Share = 0.05
    below: Positive = 2.0

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        must_be_in_order(self, ("lowest_ceiling", "highest_ceiling"), strictly=True)
        return self


@dataclass(frozen=True, config=CHECKED)
class PlaneParameters:
    """How the planes of a room are found in an estimated depth image, and its smooth error.

    Attributes:
        degree: of the polynomial that the relative error is.
        expected_error: standard deviation of the relative error over all directions.
        unit_error: share of the weight of this expectation for the error's mean: the unit itself may be off by more.
        shift_error: weight of an error of the shift, beside the polynomial, where the estimate has a shift.
        patches: independent parts of the picture that speak about the error.
        patch_noise: standard deviation of a patch's own relative error.
        tolerance: relative error up to which a pixel counts for a plane.
        first_tolerance: how many times as large it is in the first round, while the error is not known.
        outer_tolerance: times ``tolerance`` from which on a pixel has no weight for the error.
        least_wall: share of all directions that a wall must take.
        least_ceiling: the same of a ceiling.
        ceiling_step: natural logarithm of the ratio of two neighbouring heights that are tried.
        ceiling_steps: neighbouring heights that a level ceiling takes up.
        most_walls: walls that are looked for, at most.
        most_ceilings: ceilings that are looked for, at most.
        rows: of the reduced picture that planes are fitted to; joints are looked for in the whole.
        trials: of RANSAC, for each wall.
        judges: pixels that judge a trial.
        least_apart: degrees between the two pixels of a trial, at least.
        most_apart: the same at most.
        level: sine of the angle to the horizon from which ceilings are looked for.
        upright: slope against the vertical that what is fitted freely to a wall may have.
        rounds: of fitting planes and error in turns.
        fewest_pixels: pixels that a plane is fitted to, at least.
        same: relative difference up to which two planes of one direction are one.
        square: degrees that a wall may be off from being square to the others for it to be made so.
        crease: degrees over which the bend of the reciprocal distance along a meridian is measured.
        searched: degrees from where planes meet by the fit so far, within which it is looked for where they meet in the
            picture.
        least_bend: share of the bend of two exact planes that a joint must have at least.
        fewest_meridians: of those of a picture of 512 rows, on which a joint must be seen.
        joint_prior: weight of the wall so far where one is put through its joint: few points far from each other give no
            direction.
        joint_turn: degrees by which its joint may turn a wall.
    """

    degree: Annotated[Count, Field(le=8)] = 4
    expected_error: Positive = 0.05
    unit_error: Positive = 0.04
    shift_error: Positive = 0.3
    patches: Positive = 300.0
    patch_noise: Positive = 0.015
    tolerance: Positive = 0.06
    first_tolerance: Factor = 2.0
    outer_tolerance: Factor = 2.0
    least_wall: Share = 0.012
    least_ceiling: Share = 0.02
    ceiling_step: Positive = 0.02
    ceiling_steps: Count = 5
    most_walls: Depth = 12
    most_ceilings: Depth = 3
    rows: Count = 64
    trials: Count = 1200
    judges: Count = 3000
    least_apart: Angle = 6.0
    most_apart: Angle = 35.0
    level: Probability = 0.2
    upright: Positive = 0.25
    rounds: Count = 6
    fewest_pixels: Count = 20
    same: NotNegative = 0.05
    square: Annotated[NotNegative, Field(le=45.0)] = 3.0
    crease: Angle = 1.4
    searched: Angle = 3.0
    least_bend: Share = 0.3
    fewest_meridians: Count = 12
    joint_prior: Positive = 0.05
    joint_turn: Angle = 10.0

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        must_be_in_order(self, ("least_apart", "most_apart"), strictly=True)
        return self


@dataclass(frozen=True, config=CHECKED)
class EstimateParameters:
    """How the pixels of an estimated depth image are made surfaces.

    Attributes:
        plane_errors: how many times the usual relative deviation from the planes a pixel of a plane may deviate.
        least_plane_error: relative deviation that it may have in any case.
        most_plane_error: relative deviation that it may have at most.
        majority: pixels across the square in which most pixels' plane is taken.
        small_patch: square degrees up to which a patch that differs from all around it is noise.
        soft: pixels of an image of 1024 columns on either side of an edge over which an estimate blurs it.
        step: ratio of the reciprocal distances within that, from which on there is an edge,
        bent: where the picture also bends by more than this, relative to the reciprocal distance.
        joint: pixels beside a joint within which the nearer of the two planes is what is seen.
        convex: share of these pixels that must show the nearer one already for it to be so.
        fewest_pixels: pixels beside a joint, at least.
        much_unknown: share of all directions that may be closed like a hole without a warning.
        above_floor: pixels of no plane are at least this many times nearer than the floor.
        behind_reach: degrees behind an object over which the planes around it go on to their joints.
    """

    plane_errors: Positive = 4.0
    least_plane_error: Positive = 0.02
    most_plane_error: Positive = 0.06
    majority: Width = 5
    small_patch: NotNegative = 4.0
    soft: Count = 3
    step: Ratio = 1.15
    bent: NotNegative = 0.05
    joint: Count = 6
    convex: Share = 0.7
    fewest_pixels: Count = 20
    much_unknown: Share = 0.005
    above_floor: Factor = 1.002
    behind_reach: Angle = 15.0

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        must_be_in_order(self, ("least_plane_error", "most_plane_error"))
        return self


@dataclass(frozen=True, config=CHECKED)
class FloorParameters:
    """How the floor is found in measurements.

    Attributes:
        trials: of RANSAC, for each plane.
        points: points, spread over the surfaces, that are looked at.
        largest_tilt: angle to the horizontal that a floor may have, degrees.
        least_share: share of these points that it must hold.
        fewest_points: points that it must hold in any case.
        contrast: a plane holds at least this many times as many points as the two layers of the same thickness beside it.
        lower_step: metres that a floor lies below a table or bed that was taken for it, at least.
        lower_share: such a lower floor holds at least this share of the points that the table holds.
        flattest: cosine to the plane's normal of a face that can be laid flat without becoming a sliver.
        highest: metres above the floor from which on the unit of a lens's height is doubted.
        same_unit: relative deviation from the ratio of two units up to which the floor's depth is taken for one in the
            other unit.
    """

    trials: Count = 500
    points: Annotated[Count, Field(ge=3)] = 20_000
    largest_tilt: Angle = 10.0
    least_share: Share = 0.01
    fewest_points: Annotated[Count, Field(ge=3)] = 30
    contrast: NotNegative = 1.6
    lower_step: NotNegative = 0.1
    lower_share: Share = 0.25
    flattest: Share = 0.2
    highest: Positive = 30.0
    same_unit: Share = 0.1


@dataclass(frozen=True, config=CHECKED)
class PointParameters:
    """How points are cleaned and continued, for ``lightdepth reconstruct from-points``.

    Attributes:
        per_cell: a cell of the surface is this many times as wide as the spacing of the points that it is made from.
        open_cells: where nothing was measured within this many cells, the surface is the reconstruction's own invention.
        outlier_neighbours: nearest points that a point is compared with.
        outlier_factor: an outlier is farther from them than this many times their own distances.
        smallest_clump: points that hang together, at least; fewer are strays.
        stray_factor: times the median distance between neighbours from which on a point is a stray.
        smoothing_neighbours: nearest points through which a plane is fitted.
        gap_cells: a direction is unmeasured where the nearest measured point lies this many cells beside it.
        gap_fewest_rows: rows of the picture in which unmeasured directions are looked for, at least.
        gap_most_rows: the same at most.
        ring: degrees across the ring around unmeasured directions, from whose points it is judged how the place goes on.
        plane_share: a plane goes on where it holds at least this share of the ring's points.
        plane_fewest: points that it holds in any case.
        plane_beyond: a plane that more than this share of the ring's points lie behind is furniture's: one sees past it.
        plane_trials: of RANSAC, for each plane.
        plane_judges: points that judge a trial.
        plane_thickness: cells from a plane up to which a point may lie on it.
        plane_normal: cosine between their normals from which on it does.
        plane_behind: cells from which on a point lies behind a plane.
        volume: side of the cube in which the surface is reconstructed, times the longest extent of the points.
        coarsest: times that this cube is halved, at least.
        finest: times that it is halved, at most: one more takes about four times the memory.
    """

    per_cell: Positive = 2.0
    open_cells: Positive = 4.0
    outlier_neighbours: Count = 8
    outlier_factor: Factor = 3.0
    smallest_clump: Count = 30
    stray_factor: Factor = 8.0
    smoothing_neighbours: Annotated[Count, Field(ge=3)] = 32
    gap_cells: Positive = 4.0
    gap_fewest_rows: Annotated[Count, Field(ge=2)] = 64
    gap_most_rows: Annotated[Count, Field(ge=2)] = 400
    ring: Angle = 12.0
    plane_share: Share = 0.04
    plane_fewest: Annotated[Count, Field(ge=3)] = 30
    plane_beyond: Share = 0.04
    plane_trials: Count = 300
    plane_judges: Count = 3000
    plane_thickness: Positive = 0.5
    plane_normal: Share = 0.9
    plane_behind: Positive = 2.0
    volume: Factor = 1.3
    coarsest: Count = 5
    finest: Annotated[Count, Field(le=14)] = 11

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        must_be_in_order(self, ("gap_fewest_rows", "gap_most_rows"), ("coarsest", "finest"))
        return self


@dataclass(frozen=True, config=CHECKED)
class SourceParameters:
    """How the strongest sources of a light-depth map are found, for ``lightdepth reconstruct lights``.

    Attributes:
        edge: a source ends where its luminance falls below this share of its brightest part.
        bright: a source is at least this many times as bright as the map's mean.
        largest_width: pixels; wider maps are reduced: a lamp's place does not need more.
        longest_glow: pixels around a source's core.
        largest_step: neighbouring distances of a larger ratio belong to two sources.
        grown: sources that are grown for each that is asked for; a speck may be brighter than a window.
        flat: variance across a source, relative to that along its shorter side, up to which it is flat.
    """

    edge: Share = 0.15
    bright: Positive = 3.0
    largest_width: Annotated[Count, Field(ge=2)] = 2048
    longest_glow: Depth = 64
    largest_step: Ratio = 1.15
    grown: Count = 4
    flat: Share = 0.02


@dataclass(frozen=True, config=CHECKED)
class ReviewParameters:
    """How a reconstruction is measured and drawn, for a person to judge.

    Attributes:
        coverage_rows: of the panorama whose pixels are rays that find what the surfaces leave open.
        shell_margin: metres between the outermost surface and the shell around everything.
        shell_share: the same as a share of the shell, where that is more.
        sharpest_bend: degrees between normals a few pixels apart from which an edge is drawn.
        shortest_edge: share of the picture's height; shorter edges are not drawn.
        jump: share by which the reciprocal distance a few pixels on differs from the plane's, from which an edge is drawn.
        same_position: metres by which two poses are the same.
        same_rotation: the same of the entries of their rotations: a tenth of a degree.
    """

    coverage_rows: Annotated[Count, Field(ge=8)] = 512
    shell_margin: NotNegative = 0.02
    shell_share: Positive = 0.01
    sharpest_bend: Annotated[Positive, Field(lt=180.0)] = 30.0
    shortest_edge: Share = 0.05
    jump: NotNegative = 0.04
    same_position: NotNegative = 0.001
    same_rotation: NotNegative = 2e-3


@dataclass(frozen=True, config=CHECKED)
class ReconstructionParameters:
    """One object for each step; vary them by :func:`dataclasses.replace`, which checks them.

    Attributes:
        clicks: of fitting clicks together.
        box: of fitting a box to edges.
        depth: of cleaning and continuing depth images.
        unit: of finding the unit of an estimated one.
        planes: of finding its planes.
        estimate: of making its pixels surfaces.
        floor: of finding the floor.
        points: of cleaning and continuing points.
        sources: of finding the strongest sources.
        review: of measuring and drawing a reconstruction.
    """

    clicks: ClickParameters = ClickParameters()
    box: BoxParameters = BoxParameters()
    depth: DepthParameters = DepthParameters()
    unit: UnitParameters = UnitParameters()
    planes: PlaneParameters = PlaneParameters()
    estimate: EstimateParameters = EstimateParameters()
    floor: FloorParameters = FloorParameters()
    points: PointParameters = PointParameters()
    sources: SourceParameters = SourceParameters()
    review: ReviewParameters = ReviewParameters()


DEFAULT = ReconstructionParameters()
"""What places are reconstructed with."""
