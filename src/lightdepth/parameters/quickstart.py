"""The tuned constants of guessing a first scene from a panorama."""

from __future__ import annotations

from typing import Self

from pydantic import model_validator
from pydantic.dataclasses import dataclass

from lightdepth.parameters.ranges import CHECKED, Count, NotNegative, Positive, Share


@dataclass(frozen=True, config=CHECKED)
class QuickstartParameters:
    """What ``lightdepth new`` guesses.

    Attributes:
        camera_height: metres of a camera on its tripod above the floor, where nobody says.
        sure_directions: confidence from which directions that edges show are used.
        blue: natural logarithm of blue over red from which light is that of the sky, or of what the sky lights.
        blue_share: share of the directions above the horizon with such light from which on the place is in the open. Of
            the photographs looked at, five rooms have up to 0.17, two meadows and a courtyard 0.70 and more.
        grey_sky: a smooth zenith this many times as bright as the ground is an overcast sky where there are no
            walls.
        smooth: standard deviation of the logarithm of luminance within some degrees.
        ground_radius: of the ground in the open, metres.
        dome_radius: camera heights.
        dome_height: camera heights.
        fillet: share of the dome's radius over which its ground bends up into its wall.
        smallest_object: metres; a shorter longest side is taken for a mistake of units.
        largest_object: the same for a longer one.
        usual_object: metres; the longest side that is aimed at where no unit explains a size.
        ball: radius of the default objects, metres.
        gap: between neighbours, as a share of the larger one's width.
        nearest: camera heights from the point below the camera, at least, so that nobody looks straight down on the
            objects.
        around: points around a spot, on each of three rings, that are looked at.
        margin: metres between the objects and a guessed wall.
        forward: what looking toward the picture's middle is worth, beside differences of colour (natural logarithm).
        far: what each halving or doubling of the best distance costs.
        group_share: of the view's width that the objects take, and at most twice that of its height.
        below: share of the view's height below the objects; they stand low in it, so that more of the place is seen.
        aspect: the view's height over its width.
        smallest_fov: horizontal field of view, degrees.
        largest_fov: the same.
        smallest_width: of the view, pixels.
        largest_width: the same.
        finer: pixels of the view to one of the panorama, at most, between these widths.
    """

    camera_height: Positive = 1.6
    sure_directions: Share = 0.5
    blue: NotNegative = 0.1
    blue_share: Share = 0.45
    grey_sky: Positive = 1.5
    smooth: Positive = 0.1
    ground_radius: Positive = 50.0
    dome_radius: Positive = 4.0
    dome_height: Positive = 2.6
    fillet: Share = 0.3
    smallest_object: Positive = 0.03
    largest_object: Positive = 3.0
    usual_object: Positive = 0.4
    ball: Positive = 0.18
    gap: NotNegative = 0.35
    nearest: NotNegative = 0.5
    around: Count = 24
    margin: NotNegative = 0.1
    forward: NotNegative = 0.25
    far: NotNegative = 0.2
    group_share: Positive = 0.3
    below: Share = 0.15
    aspect: Positive = 0.625
    smallest_fov: Positive = 18.0
    largest_fov: Positive = 80.0
    smallest_width: Count = 640
    largest_width: Count = 1280
    finer: Positive = 3.0

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        for what in ("object", "fov", "width"):
            if getattr(self, f"smallest_{what}") > getattr(self, f"largest_{what}"):
                raise ValueError(f"smallest_{what} must be at most largest_{what}")
        return self


DEFAULT = QuickstartParameters()
"""What first scenes are guessed with."""
