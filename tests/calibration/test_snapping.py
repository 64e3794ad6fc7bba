"""Clicked corners moved to where the picture's edges meet."""

import numpy as np
import pytest

from lightdepth.calibration.rectangle import FloorRectangle
from lightdepth.calibration.snapping import snap_rectangle
from lightdepth.calibration.solve import Cues, calibrate
from lightdepth.directions import rotation_to_euler
from lightdepth.parameters import CalibrationParameters
from tests.calibration.calibration_helpers import Poses, angle_between, seen_from

CLICK_ERROR = 3.0 * 360 / 2048
"""Degrees: three pixels at 2k."""


def sides(points):
    return {"width": np.ptp(points[:, 0]), "length": np.ptp(points[:, 1])}


@pytest.fixture(scope="module")
def view(room):
    """The room from a random pose, as a panorama of 2048 pixels, and that pose."""
    poses = Poses(11)
    rotation, position = poses.rotation(), room.POSITION + poses.random.uniform(-0.5, 0.5, 3)
    return room.radiance(2048, position, rotation_to_euler(rotation)), position, rotation


@pytest.mark.parametrize("name", ["FLOOR", "RUG"])
def test_noisy_clicks_snapped_give_the_rotation_within_a_degree(room, view, poses, name):
    """Clicks off by a standard deviation of three pixels along either axis at 2k: more than one could hope for alone."""
    radiance, position, rotation = view
    points = getattr(room, name)
    alone, snapped, unmoved = [], [], 0
    for _ in range(8):
        clicks = poses.click(seen_from(position, rotation, points), deviation=3.0)
        clicked = FloorRectangle(clicks, **sides(points))
        rectangle, warnings = snap_rectangle(radiance, clicked, None, CLICK_ERROR)
        alone.append(angle_between(calibrate(Cues(clicked, click_error=CLICK_ERROR)).rotation, rotation))
        if warnings:
            unmoved += 1
        else:
            snapped.append(angle_between(calibrate(Cues(rectangle, click_error=CLICK_ERROR)).rotation, rotation))
    print(f"{name}: clicked {np.round(alone, 2)}, snapped {np.round(snapped, 2)}, {unmoved} not moved")
    assert unmoved <= 2
    assert max(snapped) < 1.0
    assert np.median(snapped) < np.median(alone) / 3


def test_a_side_without_an_edge_is_reported_and_the_clicks_stay(room, view):
    radiance, position, rotation = view
    clicked = FloorRectangle(seen_from(position, rotation, room.RUG), **sides(room.RUG))
    rectangle, warnings = snap_rectangle(np.ones_like(radiance), clicked, None, CLICK_ERROR)
    assert rectangle is clicked
    assert warnings == ["no edge is seen from corner 1 to 2; the clicks were not moved"]


def test_edges_that_are_no_such_rectangle_are_reported_and_the_clicks_stay(room, view):
    """The rug is not as long as was said."""
    radiance, position, rotation = view
    clicked = FloorRectangle(seen_from(position, rotation, room.RUG), width=2.0, length=4.0)
    rectangle, warnings = snap_rectangle(radiance, clicked, None, CLICK_ERROR / 3)
    assert rectangle is clicked
    assert "are not those of such a rectangle" in warnings[0]
    about = CalibrationParameters(rectangle_measure=1.0, snap_error=0.25)
    rectangle, warnings = snap_rectangle(radiance, clicked, None, CLICK_ERROR / 3, about)
    assert not warnings
    assert rectangle.error == 0.25 * 360 / 2048
