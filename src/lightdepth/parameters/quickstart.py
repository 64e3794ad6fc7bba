"""The tuned constants of guessing a first scene from a panorama."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator
from pydantic.dataclasses import dataclass

from lightdepth.parameters.ranges import CHECKED, Count, NotNegative, Positive, Share, must_be_in_order


@dataclass(frozen=True, config=CHECKED)
class QuickstartParameters:
    """What ``lightdepth new`` guesses.

    Attributes:
        camera_height: metres of a camera on its tripod above the floor, where nobody says.
        lowest_camera: metres above the floor below which a given height is unusual,
        highest_camera: and above which.
        sure_directions: confidence from which directions that edges show are used.
        blue: natural logarithm of blue over red from which light is that of the sky, or of what the sky lights.
        blue_share: share of the directions above the horizon with such light from which on the place is in the open. Of
            the photographs looked at, five rooms have up to 0.17, two meadows and a courtyard 0.70 and more.
        sky_rows: of the small panorama by whose colours it is guessed whether a place is in the open.
        grey_sky: a smooth zenith this many times as bright as the ground is an overcast sky where there are no
            walls.
        smooth: standard deviation of the logarithm of luminance around a pixel of a smooth sky,
        smooth_window: pixels across the square in which it is taken,
        smooth_share: and share of the zenith that must be so smooth.
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
        floor_rows: of the small panorama in which empty floor is looked for.
        closest: times the best distance from which on spots are tried,
        farthest: up to which,
        distances: at how many distances in equal ratios,
        turn: and degrees from one direction to the next.
        around: points around a spot, on each of three rings, that are looked at.
        margin: metres between the objects and a guessed wall.
        free: mean difference of colours from the floor beside the camera up to which a spot seems to be free.
        most_unlike: difference (natural logarithm) of a point, at most: all that is no floor is alike.
        forward: what looking toward the picture's middle is worth, beside differences of colour (natural logarithm).
        far: what each halving or doubling of the best distance costs.
        room_share: of a room's shorter side that an object may take, at most.
        shortest_view: camera heights to the objects, at least, beside half of their own width;
        longest_view: the same at most.
        group_share: of the view's width that the objects take, and at most twice that of its height.
        below: share of the view's height below the objects; they stand low in it, so that more of the place is seen.
        aspect: the view's height over its width.
        samples: of each pixel of the first picture.
        smallest_fov: horizontal field of view, degrees.
        largest_fov: the same.
        smallest_width: of the view, pixels.
        largest_width: the same.
        finer: pixels of the view to one of the panorama, at most, between these widths.
    """

    camera_height: Positive = 1.6
    lowest_camera: Positive = 0.2
    highest_camera: Positive = 10.0
    sure_directions: Share = 0.5
    blue: NotNegative = 0.1
    blue_share: Share = 0.45
    sky_rows: Annotated[Count, Field(multiple_of=16)] = 256
    grey_sky: Positive = 1.5
    smooth: Positive = 0.1
    smooth_window: Count = 9
    smooth_share: Share = 0.8
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
    floor_rows: Count = 512
    closest: Positive = 0.3
    farthest: Positive = 1.6
    distances: Count = 11
    turn: Positive = 7.5
    around: Count = 24
    margin: NotNegative = 0.1
    free: Positive = 0.9
    most_unlike: Positive = 1.5
    forward: NotNegative = 0.25
    far: NotNegative = 0.2
    room_share: Share = 0.6
    shortest_view: Positive = 0.8
    longest_view: Positive = 1.7
    group_share: Positive = 0.3
    below: Share = 0.15
    aspect: Positive = 0.625
    samples: Count = 32
    smallest_fov: Positive = 18.0
    largest_fov: Positive = 80.0
    smallest_width: Count = 640
    largest_width: Count = 1280
    finer: Positive = 3.0

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        for what in ("object", "fov", "width"):
            must_be_in_order(self, (f"smallest_{what}", f"largest_{what}"))
        must_be_in_order(
            self, ("closest", "farthest"), ("shortest_view", "longest_view"), ("lowest_camera", "highest_camera")
        )
        return self


DEFAULT = QuickstartParameters()
"""What first scenes are guessed with."""
