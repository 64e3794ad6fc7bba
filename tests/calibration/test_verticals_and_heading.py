"""The level from plumb edges, the heading from a click, and what arcs of great circles are."""

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from lightdepth.calibration.arcs import Arcs
from lightdepth.calibration.solve import Cues, calibrate
from lightdepth.directions import euler_rotation, latlong_to_direction
from lightdepth.errors import InputError
from tests.calibration.calibration_helpers import angle_between, seen_from

CAMERA = np.array([0.0, 0.0, 1.6])


def test_deviation_is_the_least_movement_of_the_ends():
    """Against a numerical search for the smallest shifts across the arc that bring it through the direction."""
    random = np.random.default_rng(4)
    for _ in range(5):
        ends = random.normal(size=(2, 3))
        ends /= np.linalg.norm(ends, axis=1, keepdims=True)
        arc = Arcs(ends)
        point = ends[0] + random.uniform(-1, 2) * (ends[1] - ends[0]) + 0.004 * arc.normal[0]
        point /= np.linalg.norm(point)
        normal = arc.normal[0]

        def missed(shift, ends=ends, normal=normal, point=point):
            moved = ends + np.asarray(shift)[:, None] * normal
            return np.cross(moved[0], moved[1]) @ point

        least = minimize(
            lambda shift: np.sum(np.square(shift)) * 1e4,
            [0.01, 0.01],
            constraints={"type": "eq", "fun": missed},
            method="SLSQP",
            options={"ftol": 1e-14},
        )
        expected = np.degrees(np.linalg.norm(least.x))
        assert abs(arc.deviation(point)[0]) == pytest.approx(expected, rel=2e-3)


def test_verticals_and_a_heading_give_the_rotation(poses):
    for _ in range(20):
        rotation = poses.rotation()
        verticals = Arcs(seen_from(CAMERA, rotation, poses.plumb_edges(CAMERA, 3)))
        heading = seen_from(CAMERA, rotation, np.array([2.0, 2.0, 1.0]))
        found = calibrate(Cues(verticals=verticals, heading=heading, bearing=45.0, camera_height=1.6))
        assert angle_between(found.rotation, rotation) < 1e-4
        np.testing.assert_allclose(found.position, CAMERA, atol=1e-12)
        assert found.residual < 1e-4


def test_verticals_clicked_three_pixels_off_give_the_level_within_a_degree(poses):
    errors = []
    for _ in range(100):
        rotation = poses.rotation()
        verticals = Arcs(poses.click(seen_from(CAMERA, rotation, poses.plumb_edges(CAMERA, 4)), within=3.0))
        errors.append(angle_between(calibrate(Cues(verticals=verticals)).rotation[2], rotation[2]))
    assert np.quantile(errors, 0.95) < 1.0


def test_without_a_heading_the_centre_column_keeps_looking_along_y(poses):
    rotation = poses.rotation()
    verticals = Arcs(seen_from(CAMERA, rotation, poses.plumb_edges(CAMERA, 5)))
    found = calibrate(Cues(verticals=verticals))
    assert angle_between(found.rotation[2], rotation[2]) < 1e-4
    x, y, _ = found.rotation @ [0.0, 1.0, 0.0]
    assert abs(np.degrees(np.arctan2(x, y))) < 1e-6
    assert found.position is None


def test_hand_clicked_verticals_of_a_real_room(shared_data):
    """Four corners and frames of a real living room, clicked by eye; the photographer levelled it."""
    if not (shared_data / "hdr/lebombo_1k.hdr").is_file():
        pytest.skip("the real panorama is absent")
    pixels = np.array(
        [
            [[170, 152.5], [170, 337]],
            [[448.5, 220], [448, 325]],
            [[735.75, 175], [735.25, 318]],
            [[969.5, 183], [968.75, 312]],
        ]
    )
    directions = latlong_to_direction(pixels[..., 0] / 1024, pixels[..., 1] / 512)
    level = calibrate(Cues(verticals=Arcs(directions)))
    assert level.tilt < 0.5
    # The same clicks on the panorama turned by a known rotation.
    turn = Rotation.from_rotvec([0.4, -0.2, 1.0]).as_matrix()
    turned = calibrate(Cues(verticals=Arcs(directions @ turn.T)))
    assert angle_between(turned.rotation[2] @ turn, level.rotation[2]) < 0.01


def test_verticals_that_all_stand_in_one_plane_are_reported():
    foot = np.array([[0.0, 2.0, 0.0], [0.0, 4.0, 0.0], [0.0, -3.0, 0.0]])
    verticals = Arcs(seen_from(CAMERA, np.eye(3), np.stack([foot, foot + np.array([0, 0, 2.5])], axis=1)))
    assert any("only known to about" in warning for warning in calibrate(Cues(verticals=verticals)).warnings)


def test_too_few_and_too_short_verticals_are_refused(poses):
    edges = seen_from(CAMERA, np.eye(3), poses.plumb_edges(CAMERA, 3))
    with pytest.raises(InputError, match="2 verticals are not enough: give three or more"):
        calibrate(Cues(verticals=Arcs(edges[:2])))
    edges[1, 1] = edges[1, 0]
    with pytest.raises(InputError, match="vertical 2: its two points are less than a degree apart"):
        calibrate(Cues(verticals=Arcs(edges)))


def test_a_heading_straight_up_is_refused(poses):
    edges = Arcs(seen_from(CAMERA, np.eye(3), poses.plumb_edges(CAMERA, 3)))
    with pytest.raises(InputError, match="heading points straight up or down"):
        calibrate(Cues(verticals=edges, heading=np.array([0.0, 0.0, 1.0])))


def test_a_wrong_vertical_is_reported(poses):
    rotation = euler_rotation([3.0, 5.0, 20.0])
    edges = seen_from(CAMERA, rotation, poses.plumb_edges(CAMERA, 5))
    edges[0, 1] = seen_from(CAMERA, rotation, np.array([3.0, 1.5, 2.5]))
    assert any("the verticals miss the solution" in w for w in calibrate(Cues(verticals=Arcs(edges))).warnings)
