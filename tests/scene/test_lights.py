"""``[[light]]`` tables."""

import numpy as np
import pytest
from pydantic import ValidationError

from lightdepth.errors import InputError
from lightdepth.scene.lights import SunTable
from lightdepth.scene.lights.frame import azimuth_and_elevation

STRENGTH = {"type": "sun", "irradiance": [3.0, 2.5, 2.0]}


def test_three_ways_to_say_where_the_sun_is():
    by_direction = SunTable.model_validate({**STRENGTH, "direction": [0.0, 2.0, 2.0]})
    np.testing.assert_allclose(by_direction.toward(), [0.0, np.sqrt(0.5), np.sqrt(0.5)])
    by_angles = SunTable.model_validate({**STRENGTH, "azimuth": 0.0, "elevation": 45.0})
    np.testing.assert_allclose(by_angles.toward(), by_direction.toward(), atol=1e-12)


def test_the_sun_at_a_time():
    pytest.importorskip("pvlib", reason="the extra 'sun' is not installed")
    noon = {"latitude": 48.0, "longitude": 0.0, "time": "2026-06-21T12:02:00+00:00", "north": 30.0}
    azimuth, elevation = azimuth_and_elevation(SunTable.model_validate({**STRENGTH, **noon}).toward())
    # At solar noon of the solstice it stands in the south, the latitude less the axis's tilt off the zenith.
    assert azimuth == pytest.approx(210.0, abs=0.5)
    assert elevation == pytest.approx(90.0 - 48.0 + 23.44, abs=0.1)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({}, "give one of"),
        ({"azimuth": 3.0}, "give one of"),
        ({"azimuth": 3.0, "elevation": 3.0, "direction": [0, 0, 1.0]}, "give one of"),
        ({"direction": [0.0, 0.0, 0.0]}, "must not be"),
        ({"latitude": 4.0, "longitude": 4.0, "time": "2026-06-21T12:02:00"}, "offset from UTC"),
        ({"azimuth": 3.0, "elevation": 3.0, "north": 3.0}, "north goes with"),
        ({"azimuth": 3.0, "elevation": 3.0, "irradiance": [0.0, 0.0, 0.0]}, "irradiance"),
        ({"azimuth": 3.0, "elevation": 3.0, "irradiance": [1.0, -1.0, 0.0]}, "irradiance"),
        ({"azimuth": 3.0, "elevation": 3.0, "mask_extent": [0.0, 0.0, 1.0, 1.0]}, "go together"),
        (
            {"azimuth": 3.0, "elevation": 3.0, "mask": "recover", "mask_extent": [0.0, 0.0, 1.0, 1.0]},
            "finds the extent",
        ),
        ({"azimuth": 3.0, "elevation": 3.0, "mask": "recovered"}, "recovered"),
    ],
)
def test_contradictions_are_refused(values, words):
    with pytest.raises(ValidationError, match=words):
        SunTable.model_validate({**STRENGTH, **values})


def test_a_sun_below_the_horizon_is_refused():
    with pytest.raises(InputError, match="5.0 degrees below the horizon"):
        SunTable.model_validate({**STRENGTH, "azimuth": 3.0, "elevation": -5.0}).toward()
