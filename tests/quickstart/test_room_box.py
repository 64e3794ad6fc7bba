"""The box that is fitted to a room's edges."""

import numpy as np
import pytest

from lightdepth.calibration.line_detection import detect_arcs
from lightdepth.calibration.room_frame import find_room_frame
from lightdepth.directions import euler_rotation
from lightdepth.reconstruction.room_box import fit_room_box
from tests.quickstart.painted_room import CAPTURE, HIGH, LOW, ROTATION, painted_room


@pytest.fixture(scope="module")
def fitted():
    radiance = painted_room(256)
    frame = find_room_frame(detect_arcs(radiance))
    return frame, fit_room_box(radiance, frame, CAPTURE[2])


def test_a_painted_room_is_found_within_three_percent(fitted):
    frame, box = fitted
    assert np.degrees(np.arccos(np.clip((np.trace(frame.rotation @ euler_rotation(ROTATION).T) - 1) / 2, -1, 1))) < 0.5
    low, high = box.low * CAPTURE[2] + CAPTURE, box.high * CAPTURE[2] + CAPTURE
    np.testing.assert_allclose(high - low, HIGH - LOW, rtol=0.03)
    np.testing.assert_allclose([low, high], [LOW, HIGH], atol=0.1)


def test_noise_does_not_hide_the_rooms_directions():
    radiance = painted_room(256)
    grain = np.exp(0.2 * np.random.default_rng(0).standard_normal(radiance.shape[:2]))[..., None]
    frame = find_room_frame(detect_arcs((radiance * grain).astype(np.float32)))
    assert frame.confidence > 0.9
    assert np.degrees(np.arccos(np.clip((np.trace(frame.rotation @ euler_rotation(ROTATION).T) - 1) / 2, -1, 1))) < 0.5


def test_its_edges_are_evident(fitted):
    assert fitted[1].is_likely
    assert fitted[1].evidence > 0.7
