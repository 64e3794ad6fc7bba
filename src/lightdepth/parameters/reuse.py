"""The tuned constants of frames that share samples."""

from __future__ import annotations

from pydantic.dataclasses import dataclass

from lightdepth.parameters.ranges import CHECKED, Count, Positive, Share


@dataclass(frozen=True, config=CHECKED)
class ReuseParameters:
    """What a frame takes over from other ones.

    Attributes:
        most_coverage: of a pixel by objects; what is left of it tells little of the support.
        least_albedo: by which an object's radiance is divided; what is darker shows what it mirrors.
        dark: radiance relative to the photograph's median below which a relative change means nothing.
        plane: distance from the plane of a pixel's surface at which others still show the same one, in pixels there.
        same_normal: cosine between the normals of two pixels that show the same surface.
        fewest_taps: share of the four pixels around a point, by their weight, that must show its surface.
        largest_window: side of the largest square of pixels over which differences are tested; each is a third of the one
            before, for edges.
        rejected: squared differences above this many times their variance are no noise;
        around: nothing within a square of this many pixels around is taken over: where edges have moved, some pixels agree
            by chance.
        mirroring: share of an object's pixels that are rejected above which it mirrors too much to believe the rest.
    """

    most_coverage: Share = 0.75
    least_albedo: Share = 0.02
    dark: Positive = 1e-4
    plane: Positive = 0.1
    same_normal: Share = 0.9
    fewest_taps: Share = 0.5
    largest_window: Count = 9
    rejected: Positive = 9.0
    around: Count = 5
    mirroring: Share = 0.2


DEFAULT = ReuseParameters()
"""What frames of a shot share samples with."""
