"""The tuned constants of recovering light and gloss from what the photograph shows of them."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field
from pydantic.dataclasses import dataclass

from lightdepth.parameters.ranges import CHECKED, Count, NotNegative, Positive, Probability, Ratio, Share

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
        pair_samples: of the irradiance at each place.
        pair_correlated: neighbouring pairs share what is wrong with them: one in this many counts as independent.
        most_pairs: places on edges whose sides are compared.
        fewest_pairs: that determine an irradiance.
        mask_fineness: size of the mask's texels, relative to the patch's pixels as the sun sees them.
        mask_largest: texels along a side of the mask, at most.
        mask_margin: texels around what the sun shines through.
        mask_samples: of the irradiance at each point in the patch and beside it.
        mask_light_points: points at which it is estimated; the others take it from the nearest.
        mask_neighbours: nearest shaded pixels of the same surface that give a point's albedo.
        mask_fewest_pixels: of a patch, and of a surface's shade.
        plateau_level: share of the largest value of any channel from which on a pixel counts as clipped.
        plateau_least_share: of the solid angle of the largest plateau: smaller ones are left alone.
        plateau_fewest_pixels: of a plateau.
        most_plateaus: sources that are recovered.
        clipped_small: degrees of a plateau's angular radius up to which it alone gives the direction of the sun.
        clipped_largest_glow: the same up to which its middle says where in it the sun stands.
        clipped_more_than_glow: times the clipped light of a large plateau of sky that, where they are missing, are the
            sun's.
        clipped_reach: heights of a pixel within which edges of shadows are looked for.
        clipped_darkest: albedo that the typical surface has at least: a bound where nothing else narrows it.
        clipped_whitest: albedo that every surface has at most.
        clipped_points: points that the bounds come from.
        clipped_lit: share of the strongest irradiance from the source from which on a point contributes to them.
        clipped_rounds: in which several sources are recovered, each with what the last round found of the others.
        clipped_place_error: relative error of the light at a place of known albedo.
        clipped_contradiction: times the light that one click gives a source, or an albedo, from which on another one
            contradicts it.
        clipped_gain_spread: how much the gains of lamps of one room may differ, relative to their common one, where places
            do not distinguish them.
        clipped_largest_error: relative standard error of a gain from falloff beyond which the photograph does not
            determine it.
        not_clipped: share of a source's light up to which what is missing may be the recovery's own error.
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
    pair_samples: Count = 512
    pair_correlated: Positive = 5.0
    most_pairs: Count = 1200
    fewest_pairs: Count = 6
    mask_fineness: Positive = 0.8
    mask_largest: Count = 2048
    mask_margin: NotNegative = 4.0
    mask_samples: Count = 128
    mask_light_points: Count = 3000
    mask_neighbours: Count = 40
    mask_fewest_pixels: Count = 30
    plateau_level: Share = 0.98
    plateau_least_share: Share = 0.01
    plateau_fewest_pixels: Count = 2
    most_plateaus: Count = 8
    clipped_small: Positive = 2.0
    clipped_largest_glow: Positive = 25.0
    clipped_more_than_glow: Positive = 4.0
    clipped_reach: Positive = 6.0
    clipped_darkest: Probability = 0.02
    clipped_whitest: Share = 0.95
    clipped_points: Count = 1500
    clipped_lit: Share = 0.3
    clipped_rounds: Count = 3
    clipped_place_error: Positive = 0.05
    clipped_contradiction: Ratio = 3.0
    clipped_gain_spread: Positive = 1.0
    clipped_largest_error: Positive = 0.3
    not_clipped: Share = 0.1
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


DEFAULT = LightingParameters()
"""What light is recovered with."""
