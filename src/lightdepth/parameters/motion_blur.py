"""The tuned constants of motion blur: at how many instants a frame is rendered."""

from __future__ import annotations

from pydantic.dataclasses import dataclass

from lightdepth.parameters.ranges import CHECKED, Count, Positive, Share


@dataclass(frozen=True, config=CHECKED)
class MotionBlurParameters:
    """How many instants show a motion smoothly.

    Attributes:
        step: pixels of the way on the film from one instant to the next; beyond two, edges show steps, and less is lost in
            the noise.
        fewest_instants: of a frame in which something moves.
        points: of an object's part, or of all real surfaces, that are followed.
        followed_share: share of the points of real surfaces that count where the camera moves: the nearest ones move
            without end.
    """

    step: Positive = 1.5
    fewest_instants: Count = 4
    points: Count = 512
    followed_share: Share = 0.98


DEFAULT = MotionBlurParameters()
"""What frames of a shot are blurred with."""
