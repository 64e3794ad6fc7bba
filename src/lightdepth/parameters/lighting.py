"""The tuned constants of recovering light and gloss from what the photograph shows of them."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator
from pydantic.dataclasses import dataclass

from lightdepth.parameters.ranges import (
    CHECKED,
    Count,
    Counts,
    NotNegative,
    Positive,
    Positives,
    Probability,
    Ratio,
    Share,
    must_be_in_order,
)

Elevation = Annotated[float, Field(strict=True, ge=-90.0, le=90.0)]
Negative = Annotated[float, Field(strict=True, lt=0.0, allow_inf_nan=False)]


@dataclass(frozen=True, config=CHECKED)
class LightingParameters:
    """How ``lightdepth recover`` finds suns, their masks, clipped sources and gloss.

    Attributes:
        largest_width: pixels; wider panoramas are reduced to at most this: edges are found between pixels in any case.
        grazing: cosine below which a surface is taken to face away: there neither model nor brightness is exact.
        search_lowest: degrees of elevation down to which the sun is searched, so that a patch that no sun makes is
            recognised.
        search_spacing: degrees between the first directions.
        search_finer: degrees between the directions of each further round,
        search_finer_steps: steps that it goes to each side,
        search_finer_kept: directions that are looked at more closely between these rounds,
        search_apart: and degrees that they are apart, at least.
        search_half: directions from which on half of the points will do.
        search_neighbours: nearest coarse points that give a point's explained light.
        search_points: points that these are compared at, at most.
        search_fine_points: the same for those near the best.
        search_samples: of the irradiance at each point; what matters is the step between lit and shaded.
        search_kept: directions that are looked at more closely.
        search_fewest_lit: points that a direction must light.
        search_darkest: logarithm of brightness relative to the rest of the surface below which less does not count.
        search_brightest: the same above which more does not count.
        sun_least_agreement: correlation of what a direction lights with what is bright from which on a patch is taken
            to be sunlit.
        sun_least_clicked: the same with clicked outlines, which are all or nothing.
        sun_least_covered: share of each outline that the sun must light.
        sun_given_reach: heights of a pixel within which edges are looked for where the direction is given.
        sun_good_share: share of the predicted edges that the photograph shows for good confidence.
        sun_fair_share: the same for fair confidence.
        sun_good_deviation: typical relative deviation of a pair's irradiance, at most, for good confidence.
        sun_fair_deviation: the same for fair confidence.
        sun_good_error: relative standard error of a channel's irradiance, at most, for good confidence.
        sun_fair_error: the same for fair confidence.
        sun_good_uncertainty: degrees of the direction's standard error, at most, for good confidence.
        sun_fair_uncertainty: the same for fair confidence.
        edge_reaches: heights of a pixel within which edges are looked for, in each round.
        edge_most_turn: degrees by which a round turns the direction, at most.
        edge_same_normal: cosine between the normals of neighbouring pixels from which on an edge between them is one of
            light.
        edge_least_slope: of what is lit, blurred, per pixel; less has no direction.
        edge_alone: heights of a pixel to each side, besides the farthest that is looked at, where one side must be lit and
            the other not.
        edge_overshoot: share of its step up to which brightness beyond either side counts.
        edge_outlier: typical deviations from which on an edge does not count at all.
        edge_least_deviation: heights of a pixel of the typical deviation, at least.
        edge_stiffness: share of the typical determination that holds what the edges do not determine.
        edge_correlated: neighbouring edges share what is wrong with them: one in this many counts as independent.
        edge_sample_distance: heights of a pixel between samples across an edge.
        edge_blur: heights of a pixel over which an edge is blurred at most, to each side.
        edge_side: heights of a pixel beyond that, over which the brightness of either side is averaged.
        edge_least_contrast: how many times brighter the lit side is at least.
        edge_turn: degrees by which the direction is turned to see how edges move.
        edge_farthest: heights of a pixel by which they may do so.
        edge_agrees: heights of a pixel up to which a photographed edge counts as the predicted one.
        edge_exact: heights of a pixel off at which a predicted edge is worth half as much as one in the right place.
        edge_pole: share of the picture's height at the poles where edges are not used.
        most_edges: places on edges that are looked at.
        fewest_edges: that determine a direction.
        enough_edges: edges that stand alone, from which on those beside other edges are left out.
        pair_clear: heights of a pixel around the middle of either side of an edge that must be wholly lit or wholly shaded.
        pair_distances: heights of a pixel from an edge at which its sides are compared: the first that lies outside
            penumbra and blur.
        pair_samples: of the irradiance at each place.
        pair_correlated: neighbouring pairs share what is wrong with them: one in this many counts as independent.
        most_pairs: places on edges whose sides are compared.
        fewest_pairs: that determine an irradiance.
        mask_fineness: size of the mask's texels, relative to the patch's pixels as the sun sees them.
        mask_largest: texels along a side of the mask, at most.
        mask_margin: texels around what the sun shines through.
        mask_samples: of the irradiance at each point in the patch and beside it.
        mask_light_points: points at which it is estimated; the others take it from the nearest.
        mask_light_neighbours: nearest of these that give it.
        mask_reach: degrees from a patch up to which shade is looked for.
        mask_rim: pixels across the square around a patch's pixel that is left out of the shade.
        mask_brightest: share of a surface's places of a patch that are no brighter than its bright ones.
        mask_lit: share of their brightness from which on a place counts as wholly lit.
        mask_sure: standard errors by which what is wholly lit lets more through than is believed.
        mask_neighbours: nearest shaded pixels of the same surface that give a point's albedo.
        mask_fewest_pixels: of a patch, and of a surface's shade.
        plateau_level: share of the largest value of any channel from which on a pixel counts as clipped.
        plateau_least_share: of the solid angle of the largest plateau: smaller ones are left alone.
        plateau_fewest_pixels: of a plateau.
        most_plateaus: sources that are recovered.
        clipped_small: degrees of a plateau's angular radius up to which it alone gives the direction of the sun.
        clipped_beside: diameters of the sun's disc of a plateau's angular radius up to which its middle is the sun's.
        clipped_largest_glow: the same up to which its middle says where in it the sun stands.
        clipped_more_than_glow: times the clipped light of a large plateau of sky that, where they are missing, are the
            sun's.
        clipped_reach: heights of a pixel within which edges of shadows are looked for.
        clipped_darkest: albedo that the typical surface has at least: a bound where nothing else narrows it.
        clipped_whitest: albedo that every surface has at most.
        clipped_points: points that the bounds come from.
        clipped_samples: of the irradiance at each.
        clipped_surely: share of the lit ones whose albedo the lower bound makes possible.
        clipped_lit: share of the strongest irradiance from the source from which on a point contributes to them.
        clipped_rounds: in which several sources are recovered, each with what the last round found of the others.
        clipped_place_error: relative error of the light at a place of known albedo.
        clipped_good_error: relative standard error of the light, at most, for good confidence.
        clipped_fair_error: the same for fair confidence.
        clicked_grazing: cosine up to which a clicked place faces away from the source.
        clicked_too_dark: share of the source's clipped light by which a place of known albedo may be too dark.
        clicked_error: relative error of what fewer than three clicks say.
        clipped_contradiction: times the light that one click gives a source, or an albedo, from which on another one
            contradicts it.
        clipped_gain_spread: how much the gains of lamps of one room may differ, relative to their common one, where places
            do not distinguish them.
        clipped_largest_error: relative standard error of a gain from falloff beyond which the photograph does not
            determine it.
        not_clipped: share of a source's light up to which what is missing may be the recovery's own error.
        falloff_most: largest gain that is tried,
        falloff_gains: and gains between 1 and it, in equal ratios.
        falloff_glows: apparent albedo from which on a surface is taken to glow.
        falloff_points: points all around at which a source's falloff is looked at.
        falloff_samples: of the irradiance at each.
        falloff_fewest_points: on a surface.
        falloff_clearly: how much larger the misfit must be far beyond the gain that is found.
        falloff_correlated: neighbouring points share what is wrong with them: one in this many counts as independent.
        gloss_least_explained: share of the variation of albedo that must go with the highlights.
        gloss_least_certain: share of the bootstrap's resamples in which any of it must do so.
        gloss_widest: interval of roughness from which on the photograph does not determine it.
        gloss_good_width: of this interval, at most, for good confidence.
        gloss_fair_width: the same for fair confidence.
        gloss_good_spread: root mean square deviation of the sources among each other, at most, for good confidence.
        gloss_fair_spread: the same for fair confidence.
        gloss_differs: of what is shown, by which a lobe of 4 % must mirror more at one place of a pair than at the other.
        gloss_distances: cells between the cells of a pair.
        gloss_improves: share of a resample's variation that a lobe must explain to count.
        gloss_tile: cells along the side of the tiles that stand for themselves in the bootstrap.
        gloss_resamples: of the bootstrap.
        gloss_fewest_pairs: that determine a lobe.
        mirror_cells: cells of the panorama on one surface, at most.
        mirror_largest_cell: pixels along their side, at most.
        mirror_places: places along a cell's side at which its mirror image is estimated: pixels are means over their area.
        mirror_steepest: cosine between normal and line of sight below which cells are left out: a pixel is metres long
            there.
        mirror_samples: of what a lobe mirrors at each place.
        mirror_irradiance_samples: of the irradiance in each cell.
        mirror_sources: bright sources whose highlights are looked for.
        mirror_near: degrees beside a source from which its light may still reach the eye by way of a rough surface.
    """

    largest_width: Count = 2048
    grazing: Share = 0.03
    search_lowest: Elevation = -30.0
    search_spacing: Positive = 2.5
    search_finer: Positives = (1.0, 0.35)
    search_finer_steps: Count = 3
    search_finer_kept: Count = 3
    search_apart: Positive = 1.5
    search_half: Count = 200
    search_neighbours: Count = 3
    search_points: Count = 4000
    search_fine_points: Count = 30000
    search_samples: Count = 64
    search_kept: Count = 6
    search_fewest_lit: Count = 6
    search_darkest: Negative = -1.0
    search_brightest: Positive = 2.0
    sun_least_agreement: Share = 0.12
    sun_least_clicked: Share = 0.5
    sun_least_covered: Share = 0.3
    sun_given_reach: Positive = 6.0
    sun_good_share: Share = 0.6
    sun_fair_share: Share = 0.3
    sun_good_deviation: Positive = 0.15
    sun_fair_deviation: Positive = 0.4
    sun_good_error: Positive = 0.05
    sun_fair_error: Positive = 0.15
    sun_good_uncertainty: Positive = 0.25
    sun_fair_uncertainty: Positive = 0.75
    edge_reaches: Positives = (8.0, 6.0, 4.0, 3.0, 3.0, 2.5, 2.5)
    edge_most_turn: Positive = 1.5
    edge_same_normal: Share = 0.99
    edge_least_slope: NotNegative = 0.02
    edge_alone: Positives = (1.5, 3.0)
    edge_overshoot: NotNegative = 0.3
    edge_outlier: Positive = 4.0
    edge_least_deviation: Positive = 0.08
    edge_stiffness: Positive = 1e-3
    edge_correlated: Positive = 5.0
    edge_sample_distance: Positive = 0.5
    edge_blur: Positive = 2.5
    edge_side: Positive = 2.0
    edge_least_contrast: Positive = 1.12
    edge_turn: Positive = 0.15
    edge_farthest: Positive = 4.0
    edge_agrees: Positive = 1.0
    edge_exact: Positive = 0.3
    edge_pole: Share = 0.06
    most_edges: Count = 4000
    fewest_edges: Count = 12
    enough_edges: Count = 60
    pair_clear: NotNegative = 1.25
    pair_distances: Positives = (2.5, 3.5, 5.0, 7.0, 10.0)
    pair_samples: Count = 512
    pair_correlated: Positive = 5.0
    most_pairs: Count = 1200
    fewest_pairs: Count = 6
    mask_fineness: Positive = 0.8
    mask_largest: Count = 2048
    mask_margin: NotNegative = 4.0
    mask_samples: Count = 128
    mask_light_points: Count = 3000
    mask_light_neighbours: Count = 6
    mask_reach: Positive = 15.0
    mask_rim: Count = 5
    mask_brightest: Share = 0.95
    mask_lit: Share = 0.5
    mask_sure: NotNegative = 2.0
    mask_neighbours: Count = 40
    mask_fewest_pixels: Count = 30
    plateau_level: Share = 0.98
    plateau_least_share: Share = 0.01
    plateau_fewest_pixels: Count = 2
    most_plateaus: Count = 8
    clipped_small: Positive = 2.0
    clipped_beside: Positive = 0.75
    clipped_largest_glow: Positive = 25.0
    clipped_more_than_glow: Positive = 4.0
    clipped_reach: Positive = 6.0
    clipped_darkest: Probability = 0.02
    clipped_whitest: Share = 0.95
    clipped_points: Count = 1500
    clipped_samples: Count = 64
    clipped_surely: Share = 0.95
    clipped_lit: Share = 0.3
    clipped_rounds: Count = 3
    clipped_place_error: Positive = 0.05
    clipped_good_error: Positive = 0.05
    clipped_fair_error: Positive = 0.15
    clicked_grazing: Share = 0.05
    clicked_too_dark: Share = 0.1
    clicked_error: Positive = 0.1
    clipped_contradiction: Ratio = 3.0
    clipped_gain_spread: Positive = 1.0
    clipped_largest_error: Positive = 0.3
    not_clipped: Share = 0.1
    falloff_most: Ratio = 1e5
    falloff_gains: Annotated[Count, Field(ge=3)] = 301
    falloff_glows: Positive = 50.0
    falloff_points: Count = 2000
    falloff_samples: Count = 512
    falloff_fewest_points: Count = 40
    falloff_clearly: Positive = 1.05
    falloff_correlated: Positive = 10.0
    gloss_least_explained: Share = 0.03
    gloss_least_certain: Share = 0.95
    gloss_widest: Positive = 0.25
    gloss_good_width: Positive = 0.08
    gloss_fair_width: Positive = 0.15
    gloss_good_spread: Positive = 0.06
    gloss_fair_spread: Positive = 0.12
    gloss_differs: Positive = 0.03
    gloss_distances: Counts = (1, 2, 4, 7, 11)
    gloss_improves: Share = 1e-3
    gloss_tile: Count = 12
    gloss_resamples: Count = 200
    gloss_fewest_pairs: Count = 60
    mirror_cells: Count = 6000
    mirror_largest_cell: Count = 8
    mirror_places: Count = 2
    mirror_steepest: Share = 0.08
    mirror_samples: Count = 32
    mirror_irradiance_samples: Count = 256
    mirror_sources: Count = 8
    mirror_near: Positive = 20.0

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        for what in ("sun_{}_deviation", "sun_{}_error", "sun_{}_uncertainty", "clipped_{}_error", "gloss_{}_width"):
            must_be_in_order(self, (what.format("good"), what.format("fair")))
        must_be_in_order(self, ("sun_fair_share", "sun_good_share"), ("clipped_darkest", "clipped_whitest"))
        return self


DEFAULT = LightingParameters()
"""What light is recovered with."""
