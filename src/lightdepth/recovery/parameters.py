"""The constants of the recovery that were tuned, in one place: a benchmark varies them without patching modules."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
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
        unseen_samples: samples at each vertex of it, at most.
        unseen_vertex_samples: samples at all its vertices together, at most.
        unseen_fewest_samples: samples at each vertex, at least; many vertices share their noise.
        unseen_pairs: unseen faces times seen points, at most.
        unseen_fewest_seen: seen points that are used whatever ``unseen_pairs`` says.
        same_plane: metres from a face's plane up to which a point belongs to it.
        parallel: cosine between normals from which on a point belongs to a face's plane.
        same_plane_weight: how much more such a point counts for the face's albedo.
        alike: how much less surfaces count for each other that are not both walls, both floors, or both ceilings.
        glowing_share: of a face that must glow at least for it to count as glowing: beside an occluder, pixels mix the two.
        largest_albedo: of unseen surfaces.
        smallest_albedo: of unseen surfaces.
        gloss_points: points on each glossy surface, at which the photograph bounds how much the lobe may mirror.
        gloss_samples: samples of each technique at each of them.
        gloss_broken: share of the seen area at which the lobe may still mirror more: the model of the place is rough.
        mirrored_height: rows of the image of what is mirrored, at most.
        mirrored_samples: samples of each technique in each of its pixels.
        mirrored_blur: pixels across the square in which its noise is shared.
    """

    light_samples: int = 1 << 16
    lights_per_sample: int = 256
    interpolation_tolerance: float = 0.01
    noise_tolerance: float = 2.5
    levels: int = 6
    most_vertices: int = 40_000
    vertices_a_sample: int = 240
    shortest_edge: float = 0.01
    coarsest_edge: float = 1 / 10
    dark: float = 1e-3
    check_points: int = 1024
    check_samples: int = 2
    triangle_cost: int = 8
    far_from_best: float = 1.5
    unseen_points: int = 2048
    unseen_share: float = 1e-3
    unseen_rounds: int = 3
    unseen_mesh_samples: int = 16
    unseen_tolerance: float = 0.04
    unseen_samples: int = 64
    unseen_vertex_samples: int = 1 << 20
    unseen_fewest_samples: int = 8
    unseen_pairs: int = 1 << 21
    unseen_fewest_seen: int = 16
    same_plane: float = 0.1
    parallel: float = 0.95
    same_plane_weight: float = 100.0
    alike: float = 8.0
    glowing_share: float = 0.1
    largest_albedo: float = 1.0
    smallest_albedo: float = 1e-3
    gloss_points: int = 4096
    gloss_samples: int = 128
    gloss_broken: float = 0.05
    mirrored_height: int = 512
    mirrored_samples: int = 32
    mirrored_blur: int = 3


DEFAULT = RecoveryParameters()
"""What renderings use."""
