"""The tuned constants of the recovery of albedo and irradiance."""

from __future__ import annotations

from pydantic.dataclasses import dataclass

from lightdepth.parameters.ranges import CHECKED, Count, Depth, NotNegative, Positive, Probability, Share


@dataclass(frozen=True, config=CHECKED)
class RecoveryParameters:
    """How carefully albedo and irradiance are recovered. Every one is part of the key of a cached place.

    Attributes:
        light_samples: light samples that all points share, at most.
        lights_per_sample: the same, for each sample of a point: drawing more would take longer than using them.
        interpolation_tolerance: relative deviation at an edge's middle above which the edge is halved.
        noise_tolerance: the same in standard errors of the estimate, below which a deviation may be noise.
        levels: times that edges are halved, at most.
        most_vertices: where refinement ends; the faces with the largest error are refined first.
        vertices_a_sample: the same, for each sample of a point: a quick look is not worth a fine mesh.
        shortest_edge: metres; shorter edges are not halved.
        coarsest_edge: longest edge that is accepted without a test, as a share of the support's diagonal.
        inward: share of the way to the middle of the faces around that points are moved where light is estimated: exactly
            in the plane of a wall, half of it would be missed.
        dark: vertices below this share of the median irradiance lie inside something; they take their neighbours' value.
        check_points: points at which the interpolated irradiance is compared with a careful estimate.
        check_samples: samples of that estimate, for each sample at a vertex.
        triangle_cost: nodes that take as much memory, and so time, as a triangle that is traced.
        far_from_best: times the least cost so far beyond which still larger triangles are not tried.
        unseen_points: points on the real surfaces, besides one a face, to find what is unseen.
        unseen_share: share of unseen area below which nothing is recovered.
        unseen_rounds: how many times the light of unseen surfaces is estimated: they light each other.
        unseen_mesh_samples: samples for finding their mesh; few, which keeps it coarse.
        unseen_tolerance: ``interpolation_tolerance`` of it.
        unseen_fewer: samples of the support's vertices to one at each vertex of unseen surfaces, at most.
        unseen_samples: samples at each vertex of it, at most.
        unseen_vertex_samples: samples at all its vertices together, at most.
        unseen_fewest_samples: samples at each vertex, at least; many vertices share their noise.
        unseen_pairs: unseen faces times seen points, at most.
        unseen_fewest_seen: seen points that are used whatever ``unseen_pairs`` says.
        same_plane: metres from a face's plane up to which a point belongs to it.
        parallel: cosine between normals from which on a point belongs to a face's plane.
        same_plane_weight: how much more such a point counts for the face's albedo.
        same_piece_weight: how much more yet if it is on the same connected mesh: a rug is not coloured as the floor is.
        alike: how much less surfaces count for each other that are not both walls, both floors, or both ceilings.
        glowing_share: of a face that must glow at least for it to count as glowing: beside an occluder, pixels mix the two.
        largest_albedo: of unseen surfaces.
        smallest_albedo: of unseen surfaces.
        gloss_points: points on each glossy surface, at which the photograph bounds how much the lobe may mirror.
        gloss_samples: samples of each technique at each of them.
        gloss_broken: share of the seen area at which the lobe may still mirror more: the model of the place is rough.
        mirrored_height: rows of the image of what is mirrored, at most.
        plate_mirrored_height: the same of what a plate shows.
        mirrored_samples: samples of each technique in each of its pixels.
        mirrored_blur: pixels across the square in which its noise is shared.
    """

    light_samples: Count = 1 << 16
    lights_per_sample: Count = 256
    interpolation_tolerance: NotNegative = 0.01
    noise_tolerance: NotNegative = 2.5
    levels: Depth = 6
    most_vertices: Count = 40_000
    vertices_a_sample: Count = 240
    shortest_edge: Positive = 0.01
    coarsest_edge: Positive = 1 / 10
    inward: Probability = 0.01
    dark: NotNegative = 1e-3
    check_points: Count = 1024
    check_samples: Count = 2
    triangle_cost: Count = 16
    far_from_best: Positive = 1.5
    unseen_points: Count = 2048
    unseen_share: Share = 1e-3
    unseen_rounds: Depth = 3
    unseen_mesh_samples: Count = 16
    unseen_tolerance: NotNegative = 0.04
    unseen_fewer: Count = 4
    unseen_samples: Count = 64
    unseen_vertex_samples: Count = 1 << 20
    unseen_fewest_samples: Count = 8
    unseen_pairs: Count = 1 << 21
    unseen_fewest_seen: Count = 16
    same_plane: NotNegative = 0.1
    parallel: Share = 0.95
    same_plane_weight: Positive = 100.0
    same_piece_weight: Positive = 10.0
    alike: Positive = 8.0
    glowing_share: Share = 0.1
    largest_albedo: Share = 1.0
    smallest_albedo: Share = 1e-3
    gloss_points: Count = 4096
    gloss_samples: Count = 128
    gloss_broken: Share = 0.05
    mirrored_height: Count = 512
    plate_mirrored_height: Count = 256
    mirrored_samples: Count = 32
    mirrored_blur: Count = 3


DEFAULT = RecoveryParameters()
"""What renderings use."""
