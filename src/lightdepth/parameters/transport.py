"""The tuned constants of following paths."""

from __future__ import annotations

from typing import Self

from pydantic import model_validator
from pydantic.dataclasses import dataclass

from lightdepth.parameters.ranges import (
    CHECKED,
    Count,
    Depth,
    Factor,
    NotNegative,
    Positive,
    Probability,
    Share,
    must_be_in_order,
)


@dataclass(frozen=True, config=CHECKED)
class TransportParameters:
    """How paths are followed. Cell sizes decide how far the radiance cache blurs; all others trade noise for time.

    Attributes:
        candidates: RIS candidates for each shadow ray; one is kept, in proportion to the light that would arrive
            unoccluded. More cost more than they gain once the brightest few lights are distinguished.
        unlikely_sun: share of the vertices that test whether a declared sun is visible, among those where its shadow map
            finds that it is not.
        directed_share: of the scattered rays at support, that are object-directed where the objects fill a small part of
            the view.
        far_from_objects: radii of an object's sphere from which on such rays go around it as well, so that it looks as
            large as from there;
        surroundings: at most this many radii around its centre.
        glossy_share: of the other ones, that sample the specular lobe of a glossy surface that is not black beneath.
        mirrors_all: share of the paths that come from an object to a glossy surface and follow what its lobe mirrors, of
            all light; the others follow the change of its matte part.
        most_spheres: objects beyond this count share bounding spheres; each costs a test at each support vertex.
        compared_spheres: of more spheres than this, neighbours along their longest extent share one before the nearest are
            looked for: all pairs would take long.
        outline_faces: of a part of an object, about, that has a sphere of its own where the influenced pixels are found.
        outline_parts: of all objects together, at most, where they are not more themselves.
        expanded_triangles: meshes that stand at many places become one mesh of at most this many triangles; beyond, each
            stands once in memory, and rays take longer to find it.
        roulette_depth: scatterings before Russian roulette by throughput begins.
        aimed_density: times the density of even directions over a hemisphere, from which on a direction was aimed at
            something small.
        largest_survival: probability with which a path goes on at most, so that none is endless.
        roulette_gain: between support surfaces, a path survives Russian roulette in proportion to the share of the
            hemisphere that objects fill: the factor on that share.
        smallest_reach: the smallest survival probability that comes of it; less makes fireflies.
        smallest_footprint: of a path, relative to a cache cell's area, where the cell's mean is used: from 1 on the
            mean over the cell is as good as the point that happens to be met.
        cell_edge: edge of a cell of the radiance cache, at most, relative to the distance to the nearest object; finer
            ones would blur nothing less that can be seen, and have fewer records each.
        smallest_cell: its smallest edge, metres: contact shadows of small objects.
        largest_cell: its largest, metres.
        neighbours_count: cells are read as if they had this many more records, equal to the mean of their block of two
            by two by two: most have few of their own at first, and some none.
        light_roulette_depth: scatterings of a light path on objects before Russian roulette begins.
        light_largest_survival: as ``largest_survival``, of light paths.
        connection_probability: with which a light path that comes from one object to another ends there and is
            connected to the camera.
        envpath_lights: K, the lights of the median cut in the method ``envpath`` (paper, section 5.5).
        envpath_longest_edge: metres; ``envpath`` cuts support meshes this fine, since it knows the scale factor at
            vertices only.
        envpath_smallest_share: smallest denominator of the paper's eq. 8, as a share of its numerator: vertices that
            hardly any light faces.
        envpath_roulette_depth: as ``roulette_depth``, of ``envpath``.
        envpath_largest_survival: as ``largest_survival``, of ``envpath``.
    """

    candidates: Count = 8
    unlikely_sun: Probability = 0.0625
    directed_share: Probability = 0.5
    far_from_objects: Positive = 40.0
    surroundings: Factor = 6.0
    glossy_share: Probability = 0.5
    mirrors_all: Probability = 0.75
    most_spheres: Count = 6
    compared_spheres: Count = 64
    outline_faces: Count = 32
    outline_parts: Count = 512
    expanded_triangles: Count = 500_000
    roulette_depth: Depth = 3
    aimed_density: Positive = 256.0
    largest_survival: Probability = 0.99
    roulette_gain: NotNegative = 6.0
    smallest_reach: Probability = 0.75
    smallest_footprint: NotNegative = 1.0
    cell_edge: Positive = 0.5
    smallest_cell: Positive = 0.001
    largest_cell: Positive = 4.0
    neighbours_count: NotNegative = 4.0
    light_roulette_depth: Depth = 4
    light_largest_survival: Probability = 0.95
    connection_probability: Probability = 0.5
    envpath_lights: Count = 256
    envpath_longest_edge: Positive = 0.25
    envpath_smallest_share: Share = 1e-3
    envpath_roulette_depth: Depth = 3
    envpath_largest_survival: Probability = 0.95

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        must_be_in_order(self, ("smallest_cell", "largest_cell"))
        return self


DEFAULT = TransportParameters()
"""What renderings use."""
