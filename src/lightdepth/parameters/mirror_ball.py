"""The tuned constants of making a panorama of photographs of a mirror ball."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator
from pydantic.dataclasses import dataclass

from lightdepth.parameters.ranges import (
    CHECKED,
    Count,
    Depth,
    NotNegative,
    Positive,
    Positives,
    Ratio,
    Share,
    must_be_in_order,
)

Angle = Annotated[float, Field(strict=True, ge=0.0, le=180.0)]
Tilts = Annotated[tuple[Annotated[float, Field(strict=True, ge=-90.0, le=90.0)], ...], Field(min_length=1)]


@dataclass(frozen=True, config=CHECKED)
class MirrorBallParameters:
    """How ``lightdepth capture mirror-ball`` finds balls, turns them to each other and unwraps them.

    Attributes:
        plateau_level: share of an HDR image's largest value from which on a pixel was clipped, if more than a few are,
        plateau_fewest_pixels: which side by side are as bright.
        find_side: pixels of the longer side in which circles are searched.
        find_smallest: radius of the smallest ball that is searched, as share of the photograph's longer side.
        find_contrasts: edges of how many levels count in each of the searches for circles.
        find_votes: of edges for a circle's centre, at least.
        find_candidates: circles from each of these searches,
        find_fitted: of which so many are fitted.
        find_coarse: width of the first search for the outline around a circle, in radii,
        find_fine: and of the last.
        find_rated: width of the step at the outline by which fitted circles are compared, in radii.
        find_iterations: of each fit, at most.
        outline_cap: step of the logarithm of radiance from which on an edge is as good as any: one lamp is no outline.
        outline_edge: step that counts as an edge of the outline,
        outline_stronger: if it exceeds the one just outside by this factor.
        outline_width: of these steps, in radii.
        outline_least_share: of the outline that must be an edge.
        outline_beyond: widths of a step outside the outline, at which the photograph is compared with it.
        rim_within: pixels inside the outline that are explained: farther in, the place is too compressed for a curve,
        rim_beyond: and outside it.
        rim_piece: pixels along the outline of a piece that has its own background.
        rim_slope: what a piece's background changes by in a pixel, relative to itself.
        rim_reflected_slope: the same of what the ball reflects, in a radian of deflection,
        rim_reflected_curvature: and what its slope changes by.
        rim_noise: in each round, the relative difference from which on a pixel counts less: what the pieces do not explain
            is texture, or a stand. Each takes the pixels near the last outline.
        rim_starts: steps to each side by which the outline is moved and widened for a start, in each round,
        rim_start_step: each so many pixels.
        rim_evaluations: of the differences in each round, at most.
        rim_step: pixels over which derivatives are taken.
        rim_sample: pixels between the samples of the profile across the outline.
        rim_blur: pixels by which a lens blurs it, standard deviation.
        turn_points: directions at which photographs are compared; one in six while turns are tried.
        turn_nearest: degrees from a camera from which on its photograph is compared: not the photographer,
        turn_farthest: and up to which: not the edge.
        turn_clipped: share of clipped pixels up to which a direction is compared.
        turn_least_shared: share of the directions that two photographs must both show.
        turn_step: degrees between the turns that are tried.
        turn_around: degrees around a stated turn that are tried.
        turn_tilts: pitches in degrees that both cameras may have had.
        turn_blurs: degrees, from the coarsest to the finest comparison.
        turn_scale: difference of logarithms from which on a direction counts less.
        turn_evaluations: of the differences at each blur, at most.
        turn_unit: radians, and of the gain's logarithm, of a parameter that begins at 1, so that differences are taken
            over 0.14 degrees: lookups are exact to 1/32 of a pixel.
        turn_disagreement: median difference of the logarithms of radiance, after alignment and one gain a channel, beyond
            which it is no gain.
        unwrap_supersampling: samples of a texel each way; near the direction behind the ball many pixels lie side by side
            in a texel.
        unwrap_sharpness: the weight of a photograph is its resolution to this power: each direction is mostly one's.
        unwrap_none: pixels inside the outline up to which nothing counts, as the background shines in,
        unwrap_all: and from which on all does.
        unwrap_photographer: weight of the photographer's reflection: it counts where nothing else does.
        unwrap_nearer: share of a distance by which something must be nearer to be in front.
        large_gain: stops between the photographs that are worth a warning.
        grey_points: on the half of the grey ball toward the camera.
        grey_blur: standard deviation of the blur of its photograph, in radii.
        grey_grazing: cosine to the camera below which the grey ball's rim is left out.
        grey_irradiance_width: pixels across the panorama of which irradiance is the sum.
        grey_most_sources: that are solved for; the others stay as they are.
        grey_least_source: share of the largest source's solid angle that the others have at least.
        grey_least_gain: from which on a source was clipped.
        grey_scale: relative difference from which on a point of the grey ball counts less.
        grey_correlated: neighbouring points share what is wrong with them: one in this many counts as independent.
        grey_darker: by how much the grey ball may be darker than the panorama's light makes it.
    """

    plateau_level: Share = 0.999
    plateau_fewest_pixels: Count = 4
    find_side: Count = 640
    find_smallest: Share = 0.03
    find_contrasts: Positives = (120.0, 50.0)
    find_votes: Positive = 8.0
    find_candidates: Count = 16
    find_fitted: Count = 4
    find_coarse: Positive = 0.06
    find_fine: Positive = 0.02
    find_rated: Positive = 0.015
    find_iterations: Count = 60
    outline_cap: Positive = 0.25
    outline_edge: Positive = 0.03
    outline_stronger: Positive = 1.5
    outline_width: Positive = 0.012
    outline_least_share: Share = 0.65
    outline_beyond: Positive = 2.5
    rim_within: Positive = 1.5
    rim_beyond: Positive = 3.0
    rim_piece: Positive = 4.0
    rim_slope: Positive = 0.05
    rim_reflected_slope: Positive = 1.5
    rim_reflected_curvature: Positive = 2.0
    rim_noise: Positives = (0.02, 0.01, 0.01)
    rim_starts: tuple[Depth, ...] = (4, 1, 0)
    rim_start_step: Positive = 0.3
    rim_evaluations: Count = 20
    rim_step: Positive = 0.03
    rim_sample: Positive = 0.02
    rim_blur: Positive = 0.15
    turn_points: Count = 3000
    turn_nearest: Angle = 12.0
    turn_farthest: Angle = 150.0
    turn_clipped: Share = 0.1
    turn_least_shared: Share = 0.05
    turn_step: Positive = 4.0
    turn_around: Positive = 20.0
    turn_tilts: Tilts = (-25.0, -12.0, 0.0, 12.0, 25.0)
    turn_blurs: Positives = (8.0, 3.0, 1.0)
    turn_scale: Positive = 0.1
    turn_evaluations: Count = 20
    turn_unit: Positive = 0.05
    turn_disagreement: Positive = 0.25
    unwrap_supersampling: Count = 2
    unwrap_sharpness: Positive = 4.0
    unwrap_none: NotNegative = 1.0
    unwrap_all: Positive = 3.0
    unwrap_photographer: Positive = 1e-4
    unwrap_nearer: Share = 0.03
    large_gain: Positive = 0.5
    grey_points: Count = 600
    grey_blur: Positive = 0.01
    grey_grazing: Share = 0.35
    grey_irradiance_width: Count = 128
    grey_most_sources: Count = 4
    grey_least_source: Share = 0.02
    grey_least_gain: Ratio = 1.1
    grey_scale: Positive = 0.03
    grey_correlated: Positive = 10.0
    grey_darker: Positive = 0.25

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if len(self.rim_noise) != len(self.rim_starts):
            raise ValueError("rim_noise and rim_starts must have as many rounds")
        must_be_in_order(self, ("turn_nearest", "turn_farthest"), ("unwrap_none", "unwrap_all"), strictly=True)
        return self


DEFAULT = MirrorBallParameters()
"""What photographs of balls are unwrapped with."""
