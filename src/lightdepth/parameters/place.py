"""The tuned constants of what the place is taken to be: its lights, its photographs, its reflectance."""

from __future__ import annotations

from pydantic.dataclasses import dataclass

from lightdepth.parameters.ranges import CHECKED, Count, NotNegative, Positive, Probability, Share


@dataclass(frozen=True, config=CHECKED)
class PlaceParameters:
    """How the place is made of its photographs, and how often its lights are sampled.

    Attributes:
        sun_light_share: of the light samples for irradiance, for each declared sun.
        most_suns_light_share: the same for all suns together, at most.
        least_path_share: of the light paths, for all declared suns together, at least; what of the photograph's light
            stands out decides.
        least_photograph_share: of the light samples, for each of several photographs, at least.
        least_importance: of a pixel that counts at all, relative to one of a point that no other photograph sees.
        feather: degrees over which a photograph fades out toward an edge of what hides something from it,
        fewest_feather_pixels: but at least this many pixels.
        unsure_pixels: pixels beside an edge that may lie on either side of it.
        depth_jump: relative deviation of a distance's reciprocal from its continuation along the surface, above which
            another surface begins.
        glowing: ratio ``pi M / E`` above which a surface is taken to emit light by itself.
        least_diffuse: share of its typical diffuse radiance that a glossy surface keeps wherever its lobe would mirror more
            than is shown.
        always_mirrored: share of its radiance that may be mirrored even there, where its texture is dark.
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
    least_photograph_share: Share = 0.05
    least_importance: Share = 0.05
    feather: NotNegative = 1.5
    fewest_feather_pixels: Positive = 4.0
    unsure_pixels: NotNegative = 1.0
    depth_jump: Positive = 0.03
    glowing: Positive = 1.5
    least_diffuse: Share = 0.5
    always_mirrored: Share = 0.3
    sky_elevation_weight: Positive = 10.0
    sky_nearest: Positive = 1.0
    sky_near: Positive = 15.0
    sky_brightest: Positive = 4.0
    fewest_sky_pixels: Count = 8


DEFAULT = PlaceParameters()
"""What places are made with."""
