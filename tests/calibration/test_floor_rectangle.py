"""The pose from four corners of a rectangle on the floor."""

import numpy as np
import pytest

from lightdepth.calibration.arcs import Arcs
from lightdepth.calibration.rectangle import FloorRectangle
from lightdepth.calibration.solve import Cues, calibrate
from lightdepth.directions import euler_rotation
from lightdepth.errors import InputError
from lightdepth.parameters import CalibrationParameters
from tests.calibration.calibration_helpers import angle_between, seen_from

CAMERA = np.array([-0.7, -0.9, 1.5])
ROTATION = euler_rotation([4.0, -7.0, 130.0])
RUG = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [2.0, 3.0, 0.0], [0.0, 3.0, 0.0]])


def rug(order=(0, 1, 2, 3), points=RUG, **known) -> FloorRectangle:
    return FloorRectangle(seen_from(CAMERA, ROTATION, points)[list(order)], **known)


@pytest.mark.parametrize("known", ["width", "length", "camera_height"])
def test_exact_clicks_give_the_exact_pose(poses, known):
    for _ in range(15):
        corners, camera = poses.room_floor()
        rotation = poses.rotation()
        sides = {"width": corners[1, 0], "length": corners[2, 1]}
        rectangle = FloorRectangle(
            seen_from(camera, rotation, corners), **{k: v for k, v in sides.items() if k == known}
        )
        found = calibrate(Cues(rectangle, camera_height=camera[2] if known == "camera_height" else None))
        assert angle_between(found.rotation, rotation) < 1e-4
        np.testing.assert_allclose(found.position, camera, atol=1e-5)
        np.testing.assert_allclose(found.corners, corners, atol=1e-5)
        assert found.residual < 1e-5
        assert found.warnings == ()


def test_clicks_three_pixels_off_give_the_rotation_within_a_degree(poses):
    errors = []
    for _ in range(80):
        corners, camera = poses.room_floor()
        rotation = poses.rotation()
        clicks = poses.click(seen_from(camera, rotation, corners), within=3.0)
        found = calibrate(Cues(FloorRectangle(clicks, width=corners[1, 0], length=corners[2, 1])))
        errors.append(angle_between(found.rotation, rotation))
    assert max(errors) < 1.0
    assert np.median(errors) < 0.5


def test_the_expected_error_is_the_error(poses):
    """With normally distributed clicks the error is, in its root mean square, what the result says about itself."""
    ratios, errors, misses = [], [], []
    for _ in range(80):
        corners, camera = poses.room_floor()
        rotation = poses.rotation()
        clicks = poses.click(seen_from(camera, rotation, corners), deviation=3.0)
        cues = Cues(FloorRectangle(clicks, width=corners[1, 0]), click_error=3.0 * 360 / 2048)
        found = calibrate(cues)
        errors.append(angle_between(found.rotation, rotation))
        ratios.append(errors[-1] / found.expected_error)
        misses.append(found.position - camera)
    assert 0.8 < np.sqrt(np.mean(np.square(ratios))) < 1.2
    assert np.median(errors) < 1.0
    assert np.median(np.linalg.norm(misses, axis=1)) < 0.1
    # Without a bias: the mean miss is within four of its standard errors of nothing.
    spread = np.std(misses, axis=0) / np.sqrt(len(misses))
    assert (np.abs(np.mean(misses, axis=0)) < 4 * spread).all()


def test_more_known_lengths_and_verticals_help(poses):
    alone, together = [], []
    for _ in range(40):
        corners, camera = poses.room_floor()
        corners = 0.4 * corners + [0.8 * camera[0], 0.8 * camera[1], 0.0]  # A rug beside the camera.
        rotation = poses.rotation()
        clicks = poses.click(seen_from(camera, rotation, corners), deviation=3.0)
        verticals = poses.click(seen_from(camera, rotation, poses.plumb_edges(camera, 4)), deviation=3.0)
        rectangle = FloorRectangle(clicks, width=np.ptp(corners[:, 0]), length=np.ptp(corners[:, 1]))
        click_error = 3.0 * 360 / 2048
        alone.append(angle_between(calibrate(Cues(rectangle, click_error=click_error)).rotation, rotation))
        cues = Cues(rectangle, Arcs(verticals), camera_height=camera[2], click_error=click_error)
        together.append(angle_between(calibrate(cues).rotation, rotation))
    assert np.median(together) < 0.75 * np.median(alone)


@pytest.mark.parametrize(
    ("order", "words"),
    [
        ((1, 0, 3, 2), "in clockwise order seen from above"),
        ((3, 2, 1, 0), "in clockwise order seen from above"),
        ((0, 1, 3, 2), "sides cross"),
        ((2, 3, 1, 0), "sides cross"),
    ],
)
def test_wrong_order_is_put_right_with_a_warning(order, words):
    found = calibrate(Cues(rug(order, width=2.0)))
    assert len(found.warnings) == 1
    assert words in found.warnings[0]
    assert found.rotation[2] @ ROTATION[2] > 1 - 1e-9
    np.testing.assert_allclose(found.rectangle_size, [2.0, 3.0], atol=1e-5)
    assert found.position[2] == pytest.approx(1.5, abs=1e-5)


def test_a_diagonal_given_as_first_side_is_put_right_with_a_warning():
    found = calibrate(Cues(rug((0, 2, 1, 3)), camera_height=1.5))
    assert "sides cross" in found.warnings[0]
    assert sorted(found.rectangle_size) == pytest.approx([2.0, 3.0], abs=1e-5)


def test_corners_that_are_no_rectangle_are_reported():
    leaning = RUG + np.array([[0, 0, 0], [0, 0, 0], [1.0, 0, 0], [1.0, 0, 0]])
    found = calibrate(Cues(rug(points=leaning, width=2.0)))
    assert any("its sides meet at 71.6 degrees" in warning for warning in found.warnings)
    assert found.residual > 0.5


def test_measures_that_contradict_the_clicks_are_reported():
    assert calibrate(Cues(rug(width=2.0, length=3.0), camera_height=1.5)).warnings == ()
    assert any("length / width" in w for w in calibrate(Cues(rug(width=2.0, length=4.0))).warnings)
    about = CalibrationParameters(rectangle_measure=0.3)
    assert not any("length / width" in w for w in calibrate(Cues(rug(width=2.0, length=4.0)), tuned=about).warnings)
    assert any("camera height" in w for w in calibrate(Cues(rug(width=2.0), camera_height=2.2)).warnings)
    assert any("camera height" in w for w in calibrate(Cues(rug(length=3.0), camera_height=2.2)).warnings)


def test_a_small_far_rectangle_is_reported_as_uncertain():
    tile = FloorRectangle(seen_from(np.array([-4.0, -4.0, 1.5]), ROTATION, 0.3 * RUG), width=0.6)
    assert any("only known to about" in warning for warning in calibrate(Cues(tile)).warnings)


@pytest.mark.parametrize(
    ("origin", "zero"), [("corner", [0, 0, 0]), ("centre", [1.0, 1.5, 0]), ("camera", [-0.7, -0.9, 0])]
)
def test_origin(origin, zero):
    found = calibrate(Cues(rug(width=2.0)), origin)
    np.testing.assert_allclose(found.position, CAMERA - zero, atol=1e-5)
    np.testing.assert_allclose(found.corners, RUG - zero, atol=1e-5)


def test_a_heading_turns_the_world_off_the_rectangle():
    bearing = 25.0
    toward = CAMERA + np.array([np.sin(np.radians(40.0)), np.cos(np.radians(40.0)), 0.1])
    cues = Cues(rug(width=2.0), heading=seen_from(CAMERA, ROTATION, toward), bearing=bearing)
    found = calibrate(cues)
    # What was at 40 degrees clockwise of y is at 25 now: the world turned clockwise by 15.
    turn = euler_rotation([0, 0, 15.0])
    np.testing.assert_allclose(found.rotation, turn @ ROTATION, atol=1e-6)
    np.testing.assert_allclose(found.position, turn @ CAMERA, atol=1e-5)
    np.testing.assert_allclose(found.corners, RUG @ turn.T, atol=1e-5)


def test_what_cannot_be_solved_is_refused():
    inner = np.array([[0, 0, 0], [2, 0, 0], [0.7, 0.7, 0], [0, 3, 0]])
    with pytest.raises(InputError, match="one lies between the other three"):
        calibrate(Cues(rug(points=inner, width=2.0)))
    level = RUG * [1, 1, 0] + [0, 0, CAMERA[2]]
    with pytest.raises(InputError, match="on one line or on the horizon"):
        calibrate(Cues(rug(points=level, width=2.0)))
    with pytest.raises(InputError, match="needs its width, its length or the camera's height"):
        calibrate(Cues(rug()))
    with pytest.raises(InputError, match="width -2: a finite number above 0"):
        calibrate(Cues(rug(width=-2.0)))
    with pytest.raises(InputError, match="origin 'door': allowed are corner, centre, camera"):
        calibrate(Cues(rug(width=2.0)), "door")
