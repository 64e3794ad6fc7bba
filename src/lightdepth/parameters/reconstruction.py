"""The tuned constants of making a place's surfaces from a panorama, clicks, depth or points."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator
from pydantic.dataclasses import dataclass

from lightdepth.parameters.ranges import CHECKED, Count, Depth, NotNegative, Positive, Probability, Ratio, Share

Angle = Annotated[Positive, Field(lt=90.0)]
"""Degrees between 0 and 90."""


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
        beside_floor: degrees above the horizon up to which colours are not those of the floor; below it for the ceiling.
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
        settled: how far (natural logarithm) edges are moved onto those of the picture at the end, at most.
        settled_points: points that are looked up along each edge then.
        settled_beside: degrees on either side of an edge at which colours are compared then.
        settled_small_step: ``small_step`` then.
        likely: share of the box's edges that the picture shows from which on it is taken for the room.
    """

    rows: Annotated[Count, Field(ge=64)] = 512
    edge_blur: Positive = 0.6
    long_edge: Positive = 10.0
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
    beside_floor: Angle = 5.0
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
    settled: NotNegative = 0.04
    settled_points: Count = 24
    settled_beside: Positive = 0.6
    settled_small_step: Positive = 0.06
    likely: Share = 0.4

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        for least, greatest in (
            ("least_distance", "greatest_distance"),
            ("least_ratio", "greatest_ratio"),
            ("nearest_wall", "farthest_wall"),
            ("lowest_ceiling", "highest_ceiling"),
        ):
            if getattr(self, least) >= getattr(self, greatest):
                raise ValueError(f"{least} must be less than {greatest}")
        if not self.least_distance <= self.nearest_wall < self.farthest_wall <= self.greatest_distance:
            raise ValueError("nearest_wall and farthest_wall must lie within least_distance and greatest_distance")
        return self


@dataclass(frozen=True, config=CHECKED)
class ReconstructionParameters:
    """One object for each step; vary them by :func:`dataclasses.replace`, which checks them.

    Attributes:
        clicks: of fitting clicks together.
        box: of fitting a box to edges.
    """

    clicks: ClickParameters = ClickParameters()
    box: BoxParameters = BoxParameters()


DEFAULT = ReconstructionParameters()
"""What places are reconstructed with."""
