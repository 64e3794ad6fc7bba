"""Four clicked corners, and the pose that the real ``lightdepth calibrate`` finds from them."""

import json

import numpy as np
import pytest

from lightdepth.directions import euler_rotation, latlong_to_direction
from lightdepth.images.radiance import write_radiance

WIDTH = 256


@pytest.fixture(scope="module")
def found(blender, room, tmp_path_factory):
    folder = tmp_path_factory.mktemp("calibrate")
    write_radiance(folder / "room.exr", room.radiance(WIDTH))
    corners = room.pixels(room.RUG, WIDTH) / (WIDTH, WIDTH / 2)
    (folder / "truth.json").write_text(json.dumps({"corners": corners.tolist(), "width": 2.0}))
    return blender.run("calibrate", folder)


@pytest.mark.parametrize("editor", ["image editor", "viewport"])
def test_clicked_corners_give_the_pose(found, room, editor):
    solved = found[editor]
    # Blender computes a viewport's rays in single precision; this is a twentieth of one of its pixels.
    np.testing.assert_allclose(solved["corners"], room.pixels(room.RUG, WIDTH) / (WIDTH, WIDTH / 2), atol=5e-5)
    pose = np.array(solved["matrix"])
    off = euler_rotation(room.ROTATION).T @ pose[:3, :3]
    assert np.degrees(np.arccos(np.clip((np.trace(off) - 1.0) / 2.0, -1.0, 1.0))) < 0.2
    np.testing.assert_allclose(pose[:3, 3], room.POSITION, atol=0.01)
    assert 0.0 <= solved["residual"] < 0.05
    assert f"Pose solved, residual {solved['residual']:.2f} degrees" in found["said"]


def test_a_grid_lies_on_the_floor(found):
    low, high = np.array(found["grid"]["bounds"])
    np.testing.assert_array_equal([low[2], high[2]], [0.0, 0.0])
    assert max(low[:2]) <= -5.0
    assert min(high[:2]) >= 5.0
    np.testing.assert_array_equal(found["grid"]["matrix"], np.eye(4))
    assert found["grid"]["visible"]
    assert not found["grid"]["rendered"]


def test_a_click_in_the_viewport_means_what_is_seen_there(found):
    points, places, pose = map(np.array, found["on the floor"])
    toward = latlong_to_direction(*points.T) @ pose[:3, :3].T
    meant = pose[:3, 3] - pose[2, 3] / toward[:, 2:] * toward
    # Half of one of the viewport's pixels there.
    np.testing.assert_allclose(meant, places, atol=0.008)
    np.testing.assert_allclose(found["floor tool"], places[:, :2], atol=0.008)


def test_what_is_no_click_or_no_rectangle_is_refused(found):
    assert found["beside the picture"] is None
    assert found["outside the editor"] is None
    assert found["before a panorama"]
    assert found["before clicking"]
    assert "corner" in found["no floor"]
    np.testing.assert_array_equal(found["pose after refusal"], found["on the floor"][2])
