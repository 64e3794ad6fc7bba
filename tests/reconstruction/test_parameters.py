"""The tuned constants of reconstruction are arguments, and do what their documentation says."""

import numpy as np
import pytest

from lightdepth.errors import InputError
from lightdepth.parameters.reconstruction import (
    ClickParameters,
)
from lightdepth.reconstruction.layout import Clicked, surfaces_from_layout
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
