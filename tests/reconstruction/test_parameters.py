"""The tuned constants of reconstruction are arguments, and do what their documentation says."""

import numpy as np
import pytest

from lightdepth.calibration.line_detection import detect_arcs
from lightdepth.calibration.room_frame import find_room_frame
from lightdepth.errors import InputError
from lightdepth.parameters.reconstruction import (
    BoxParameters,
    ClickParameters,
)
from lightdepth.quickstart.place import guess_place
from lightdepth.quickstart.pose import GuessedPose
from lightdepth.reconstruction.layout import Clicked, surfaces_from_layout
from lightdepth.reconstruction.room_box import fit_room_box
from tests.quickstart.painted_room import CAPTURE as PAINTED
from tests.quickstart.painted_room import painted_room
from tests.reconstruction.test_layout import FLOOR, PLAN, SOURCE, click, level

COARSE = {"rows": 128, "walls": 16, "ceilings": 12, "starts": 1}


def test_clicks_fit_together_as_exactly_as_is_asked_for():
    corner = np.array([*PLAN[0], FLOOR + 2.4])
    beside = corner + [0.6, 0.0, 0.0]
    clicked = Clicked(click(level(PLAN, FLOOR)), ceiling_corner=click([beside]))
    with pytest.raises(InputError, match="within 5 degrees"):
        surfaces_from_layout(clicked, SOURCE, camera_height=1.5)
    surfaces_from_layout(clicked, SOURCE, camera_height=1.5, tuned=ClickParameters(ceiling_corner=12.0))
    middle = np.array([2.0, 0.4, FLOOR + 1.9])
    lamp = Clicked(click(level(PLAN, FLOOR)), lamps=[f"lamp: at={click([middle])} height=1.9 radius=0.1"])
    finer = ClickParameters(lamp_subdivisions=3)
    counts = [
        len(surfaces_from_layout(lamp, SOURCE, camera_height=1.5, ceiling=2.4, tuned=tuned)[-1].mesh.faces)
        for tuned in (ClickParameters(), finer)
    ]
    assert counts == [20 * 4**2, 20 * 4**3]


@pytest.fixture(scope="module")
def painted():
    radiance = painted_room(128)
    return radiance, find_room_frame(detect_arcs(radiance))


def test_a_box_is_as_high_as_is_expected_where_nothing_else_counts(painted):
    radiance, frame = painted
    for height in (2.0, 3.5):
        sure = BoxParameters(**COARSE, usual_height=height, height_weight=1e6, low_weight=0.0, settled=0.0)
        box = fit_room_box(radiance, frame, PAINTED[2], sure)
        assert (box.high[2] - box.low[2]) * PAINTED[2] == pytest.approx(height, rel=0.01)


def test_a_box_is_taken_for_the_room_from_the_evidence_on_that_is_asked_for(painted):
    radiance, frame = painted
    pose = GuessedPose(frame.rotation, float(PAINTED[2]), "", "", frame)
    kinds = [guess_place(radiance, pose, boxes=BoxParameters(**COARSE, likely=share)).kind for share in (0.2, 1.0)]
    assert kinds == ["box", "dome"]
