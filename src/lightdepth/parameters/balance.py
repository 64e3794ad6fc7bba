"""The tuned constants of comparing photographs of one place, and a plate with them."""

from __future__ import annotations

from pydantic.dataclasses import dataclass

from lightdepth.parameters.ranges import CHECKED, Count, Depth, Positive, Ratio, Share


@dataclass(frozen=True, config=CHECKED)
class BalanceParameters:
    """How gains are solved, and what no gain explains.

    Attributes:
        grid_rows: rows of the grid of directions from each capture point, on the sphere: about two degrees.
        clear: clarity and mask from which on a photograph is sure to show a point.
        steep: cosine below which a surface is seen at too grazing an angle.
        fewest: points that two photographs, or blocks that plate and panoramas, must both see.
        dark: times the median radiance; what is darker is noise.
        bright: times the median radiance; what is brighter may be clipped, or shine to one side.
        bright_rim: pixels around what is bright that it may have spilled into.
        scale: deviation of logarithms up to which points count in full,
        rounds: and how often their weights are computed again.
        disagrees: ratio from which on two photographs disagree about a point.
        too_far: typical ratio that no gain explains: the photographs do not show the same.
        plate_blocks: blocks across a plate: their means are compared, so that a pixel's noise, or an edge beside its place,
            matters little.
        plate_points: along each side of a block, at which the panoramas are asked.
        plate_flat: cosine between the normals of a block's points from which on it shows one flat surface.
        plate_clipped: times a plate's largest value, from which on a pixel may be clipped.
        plate_contrast: contrast of the plate over that of the panoramas that no gain explains,
        plate_correlation: where they are so correlated.
    """

    grid_rows: Count = 96
    clear: Share = 0.5
    steep: Share = 0.2
    fewest: Count = 40
    dark: Share = 0.02
    bright: Positive = 10.0
    bright_rim: Depth = 2
    scale: Positive = 0.05
    rounds: Count = 20
    disagrees: Ratio = 1.25
    too_far: Ratio = 1.35
    plate_blocks: Count = 96
    plate_points: Count = 4
    plate_flat: Share = 0.999
    plate_clipped: Share = 0.98
    plate_contrast: Ratio = 1.25
    plate_correlation: Share = 0.8


DEFAULT = BalanceParameters()
"""What photographs are compared with."""
