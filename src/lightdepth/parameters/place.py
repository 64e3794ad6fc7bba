"""The tuned constants of what the place is taken to be: its lights, its photographs, its reflectance."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass

from lightdepth.parameters.ranges import CHECKED, Count, Depth, NotNegative, Positive, Probability, Ratio, Share


@dataclass(frozen=True, config=CHECKED)
class PlaceParameters:
    """How the place is made of its photographs, and how often its lights are sampled.

    Attributes:
        sun_light_share: of the light samples for irradiance, for each declared sun.
        most_suns_light_share: the same for all suns together, at most.
        least_path_share: of the light paths, for all declared suns together, at least; what of the photograph's light
            stands out decides.
        sun_map_texels: texels of a declared sun's shadow map along its longer side.
        sun_map_lit: texels across the square in which one lit texel counts for all: the map steers sampling, and must miss
            nothing.
        sun_map_tolerance: metres by which a point may lie behind the first surface that the sun meets and still count as
            lit by the map.
        even: where what stands out is less than this share of the photograph's light, the map is taken to be even, and all
            of it is sampled.
        least_photograph_share: of the light samples, for each of several photographs, at least.
        least_importance: of a pixel that counts at all, relative to one of a point that no other photograph sees.
        feather: degrees over which a photograph fades out toward an edge of what hides something from it,
        fewest_feather_pixels: but at least this many pixels.
        unsure_pixels: pixels beside an edge that may lie on either side of it.
        depth_jump: relative deviation of a distance's reciprocal from its continuation along the surface, above which
            another surface begins.
        edge_weight: of the weights of the four nearest pixels, below which those farther away are taken that show the right
            surface.
        seen_depth: relative difference of distances up to which the capture point is taken to see a real point,
        grazing: cosine at which surfaces count as no more slanted: within a pixel, these change their depth.
        off_plane: pixels of the map from a real point's plane up to which a surface does not certainly occlude it.
        measured_before: times the model's distance; where several photographs are weighted, what was measured nearer is
            something else.
        removed_rim: pixels of the map around what is removed that count as showing it.
        removed_slant: cosine between a vertex's normal and its faces, below which it is not moved farther to enclose that
            rim: it stands at a tip.
        removed_depth: times nearer to the depth of what is removed than to that of what stays there, a point is taken to be
            removed.
        sky_distance: metres to which the sky is brought for comparing directions, so that a nearer capture point counts for
            more.
        depth_angle: degrees of the view to the line between neighbouring pixels of a depth image from which on they are
            joined without question.
        depth_unexplained: share of a flatter step that a plane through either side's neighbours need not explain for them
            to be joined even so.
        depth_width: columns to which wider depth images are thinned out for meshes.
        depth_same: relative difference of distances, besides that within a pixel, up to which another depth image shows
            the same surface.
        depth_step: ratio of neighbouring distances of a depth image from which on none is interpolated between them: they
            may belong to different surfaces.
        glowing: ratio ``pi M / E`` above which a surface is taken to emit light by itself.
        least_diffuse: share of its typical diffuse radiance that a glossy surface keeps wherever its lobe would mirror more
            than is shown.
        always_mirrored: share of its radiance that may be mirrored even there, where its texture is dark.
        most_sky_rows: rows of the photograph from which unseen sky is guessed, at most.
        sky_map_rows: rows of the map of the sky; its cells are 5 degrees wide.
        sky_elevation_weight: how many times more a degree of elevation counts than one around where unseen sky is
            interpolated: skies differ with elevation first.
        sky_nearest: degrees, added to distances there.
        sky_near: degrees around a pixel of which the median limits the radiance that it contributes,
        sky_brightest: to this many times it: bright clouds count, the sun does not.
        fewest_sky_pixels: pixels of sky without which there is no guess.
    """

    sun_light_share: Probability = 0.125
    most_suns_light_share: Probability = 0.5
    least_path_share: Probability = 0.05
    sun_map_texels: Count = 1024
    sun_map_lit: Count = 5
    sun_map_tolerance: NotNegative = 0.02
    even: Share = 0.01
    least_photograph_share: Share = 0.05
    least_importance: Share = 0.05
    feather: NotNegative = 1.5
    fewest_feather_pixels: Positive = 4.0
    unsure_pixels: NotNegative = 1.0
    depth_jump: Positive = 0.03
    edge_weight: Share = 0.05
    seen_depth: Positive = 0.01
    grazing: Probability = 0.05
    off_plane: Positive = 2.0
    measured_before: Share = 0.9
    removed_rim: Depth = 2
    removed_slant: Probability = 0.4
    removed_depth: Positive = 4.0
    sky_distance: Positive = 100.0
    depth_angle: Annotated[Positive, Field(lt=90.0)] = 10.0
    depth_unexplained: NotNegative = 0.25
    depth_width: Count = 1024
    depth_same: NotNegative = 0.02
    depth_step: Ratio = 1.1
    glowing: Positive = 1.5
    least_diffuse: Share = 0.5
    always_mirrored: Share = 0.3
    most_sky_rows: Count = 256
    sky_map_rows: Count = 36
    sky_elevation_weight: Positive = 10.0
    sky_nearest: Positive = 1.0
    sky_near: Positive = 15.0
    sky_brightest: Positive = 4.0
    fewest_sky_pixels: Count = 8


DEFAULT = PlaceParameters()
"""What places are made with."""
