"""`lightdepth where` and `lightdepth preview`: reading the place by its pixels."""

import json

import numpy as np
import pytest
from PIL import Image

from lightdepth.directions import direction_to_latlong
from tests.cli.room_folder import edit, make_room, write_panorama

POSITION = np.array([0.0, 0.0, 1.3])


@pytest.fixture
def scene(tmp_path):
    path = make_room(tmp_path)
    write_panorama(tmp_path / "room.exr", np.full((128, 256), 0.5, np.float32))
    return path


@pytest.mark.parametrize(
    ("point", "surface", "normal"),
    [
        ([1.2, 2.1, 0.0], "floor", [0, 0, 1]),
        ([-2.0, 0.4, 2.0], "walls", [1, 0, 0]),
        ([0, 0.3, 2.5], "walls", [0, 0, -1]),
    ],
)
def test_where_gives_the_place_within_a_millimetre(command, scene, point, surface, normal):
    u, v = direction_to_latlong(np.array(point) - POSITION)
    status, out, _ = command("where", scene, f"{float(u) * 256},{float(v) * 128}", "--json")
    assert status == 0
    (found,) = json.loads(out)["points"]
    assert found["surface"] == surface
    np.testing.assert_allclose(found["position"], point, atol=1e-3)
    np.testing.assert_allclose(found["normal"], normal, atol=1e-6)
    assert found["distance"] == pytest.approx(np.linalg.norm(np.array(point) - POSITION), abs=1e-3)
    # A room of radiance L all around: E = pi L, and what shows L must be white.
    np.testing.assert_allclose(found["irradiance"], [0.5 * np.pi] * 3, rtol=0.03)
    np.testing.assert_allclose(found["albedo"], [1.0] * 3, rtol=0.03)


def test_where_sees_the_power_of_a_small_lamp(command, tmp_path):
    scene = make_room(tmp_path)
    radiance = np.zeros((128, 256), np.float32)
    radiance[10:12, 30:32] = 50.0
    write_panorama(tmp_path / "room.exr", radiance)
    status, out, _ = command("where", scene, "140,100", "--json")
    (found,) = json.loads(out)["points"]
    from lightdepth.directions import latlong_to_direction, pixel_solid_angles

    lamp = latlong_to_direction(31 / 256, 11 / 128)
    distance = 1.2 / lamp[2]  # On the ceiling.
    toward = POSITION + distance * lamp - np.array(found["position"])
    reach = np.linalg.norm(toward)
    area = distance**2 * 2 * pixel_solid_angles(128, 256)[10:12].sum() / lamp[2]
    expected = 50.0 * area * (toward[2] / reach) ** 2 / reach**2
    np.testing.assert_allclose(found["irradiance"], [expected] * 3, rtol=0.03)


def test_where_accepts_several_points_and_negative_angles(command, scene):
    status, out, _ = command("where", scene, "--angles", "-30,-60", "10,-50", "--json")
    found = json.loads(out)["points"]
    assert status == 0
    assert [entry["surface"] for entry in found] == ["floor", "floor"]
    assert found[0]["position"][0] == pytest.approx(-1.3 / np.tan(np.radians(60)) * 0.5, abs=1e-6)


def test_where_says_sky(command, scene):
    edit(scene, "position = [0.0, 0.0, 1.3]", "position = [0.0, 0.0, 1.3]\nsky = true")
    edit(scene, '[[real]]\nname = "walls"\nmesh = "walls.ply"\nrole = "environment"\n', "")
    status, out, _ = command("where", scene, "--angles", "0,30", "0,-60")
    assert status == 0
    assert "0,30  sky" in out
    assert "floor" in out


def test_where_refuses_what_is_no_point(command, scene):
    assert command("where", scene, "12")[0] == 2
    status, _, err = command("where", scene, "300,400")
    assert status == 2
    assert "allowed are" in err


def test_preview_has_the_panoramas_size_and_a_grid(command, scene, tmp_path):
    write_panorama(tmp_path / "room.exr", np.full((256, 512), 0.2, np.float32))
    target = tmp_path / "look.png"
    status, _, _ = command("preview", tmp_path / "room.exr", "-o", target)
    assert status == 0
    picture = np.asarray(Image.open(target)).astype(int)
    assert picture.shape == (256, 512, 3)
    plain = picture[20, 20]
    assert np.abs(picture[200, 100] - plain).max() > 20  # x = 100 has a line,
    assert picture[200, 100, 0] > picture[200, 100, 2]  # which is yellow,
    assert picture[205, 256, 2] > picture[205, 256, 0]  # the centre column a blue one,
    np.testing.assert_array_equal(picture[203, 120], plain)  # and there is nothing between.


def test_preview_refuses_another_ending(command, scene, tmp_path):
    status, _, err = command("preview", tmp_path / "room.exr", "-o", tmp_path / "look.jpg")
    assert status == 2
    assert ".png" in err
