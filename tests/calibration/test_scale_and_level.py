"""What is done with little: the camera's height alone, one known length, and uncertain directions."""

import json
import tomllib

import numpy as np
import pytest
from PIL import Image

from lightdepth.calibration.scale import height_from_length, read_known_length
from lightdepth.directions import direction_to_latlong, euler_rotation
from lightdepth.errors import InputError
from lightdepth.images.radiance import write_radiance

TILT = euler_rotation([4.0, -3.0, 50.0])


@pytest.fixture
def plain(tmp_path):
    """Noise, in which there are no edges that agree."""
    radiance = np.random.default_rng(0).random((64, 128, 3), dtype=np.float32)
    write_radiance(tmp_path / "plain.exr", radiance)
    return tmp_path / "plain.exr"


def clicked(points, height, rotation=TILT):
    """Where world points are seen from ``height`` above the origin, degrees."""
    u, v = direction_to_latlong((np.asarray(points, float) - [0, 0, height]) @ rotation)
    return " ".join(f"{360 * (a - 0.5)!r},{180 * (0.5 - b)!r}" for a, b in zip(u.tolist(), v.tolist()))


@pytest.mark.parametrize(
    ("points", "length"),
    [
        ([[2.0, 1.0, 0.0], [2.0, 1.0, 2.03]], 2.03),  # A door, taller than the camera,
        ([[2.0, 1.0, 0.74], [2.0, 1.0, 0.0]], 0.74),  # a table's leg, clicked from above,
        ([[2.0, 1.0, 0.0], [-1.0, 1.5, 0.0]], float(np.hypot(3.0, 0.5))),  # and two points on the floor.
    ],
)
def test_a_known_length_gives_the_height(points, length):
    known = read_known_length(f"{clicked(points, 1.37)} = {length!r} m", None)
    assert height_from_length(known, TILT) == pytest.approx(1.37, rel=1e-9)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("0,-10 0,10", "write two points and the length between them"),
        ("0,-10 0,10 = wide", "write two points and the length"),
        ("0,-10 0,10 = -2", "write two points and the length"),
        ("0,-10 = 2", "1 points, 2 are needed"),
        ("0,20 0,10 = 2 m", "neither point lies below the horizon"),
        ("0,-10 40,10 = 2 m", "40.0 degrees of azimuth apart"),
        ("0,-10 0,-10 = 2 m", "coincide"),
    ],
)
def test_lengths_that_say_nothing_are_refused(text, words):
    with pytest.raises(InputError, match=words):
        height_from_length(read_known_length(text, None), np.eye(3))


def test_the_height_alone_takes_the_panorama_as_level(command, plain, tmp_path):
    status, out, err = command("calibrate", plain, "--camera-height", 1.5, "--write", tmp_path / "new.toml", "--json")
    found = json.loads(out)
    assert status == 0
    assert found["rotation"] == [0.0, 0.0, 0.0]
    assert found["position"] == [0.0, 0.0, 1.5]
    assert found["expected_error"] is None
    assert any("taken as level" in warning for warning in found["warnings"])
    assert "new.toml does not exist and will be created" in err
    written = tomllib.loads((tmp_path / "new.toml").read_text())
    assert written == {"panorama": {"image": "plain.exr", "position": [0.0, 0.0, 1.5], "rotation": [0.0, 0.0, 0.0]}}


def test_a_heading_turns_a_level_panorama(command, plain):
    status, out, _ = command("calibrate", plain, "--camera-height", 1.5, "--heading", "30,0", "--angles", "--json")
    assert status == 0
    np.testing.assert_allclose(json.loads(out)["rotation"], [0, 0, 30], atol=1e-4)


def test_the_metadata_of_a_photograph_is_used(command, tmp_path):
    xmp = b'<rdf GPano:PosePitchDegrees="7" GPano:PoseRollDegrees="-4" GPano:PoseHeadingDegrees="0"/>'
    Image.fromarray(np.full((64, 128, 3), 90, np.uint8)).save(tmp_path / "p.jpg", xmp=xmp)
    status, out, _ = command("calibrate", tmp_path / "p.jpg", "--camera-height", 1.5, "--json")
    found = json.loads(out)
    assert status == 0
    level = euler_rotation(found["rotation"])
    assert (level @ [0, 1, 0])[2] == pytest.approx(np.sin(np.radians(7)), abs=1e-6)


def test_a_door_gives_the_height_on_the_command_line(command, plain):
    door = clicked([[2.0, 1.0, 0.0], [2.0, 1.0, 2.0]], 1.4, np.eye(3))
    status, out, _ = command("calibrate", plain, "--angles", "--scale-from", f"{door} = 2.0 m", "--json")
    assert status == 0
    np.testing.assert_allclose(json.loads(out)["position"], [0, 0, 1.4], atol=1e-4)
    status, _, err = command("calibrate", plain, "--scale-from", "1,40 1,20 = 2", "--camera-height", 2)
    assert status == 2
    assert "leave out --camera-height" in err


def test_uncertain_directions_are_proposed_and_not_written(command, tmp_path, shared_data):
    scene = tmp_path / "meadow.toml"
    meadow = shared_data / "hdr" / "noon_grass_1k.hdr"
    scene.write_text(f'[panorama]\nimage = "{meadow.resolve()}"\nrotation = [1.0, 2.0, 3.0]\n')
    status, out, err = command("calibrate", meadow, "--auto", "--camera-height", 1.6, "--write", scene, "--json")
    found = json.loads(out)
    assert status == 0
    assert found["confidence"] < 0.5
    written = tomllib.loads(scene.read_text())["panorama"]
    assert written["rotation"] == [1.0, 2.0, 3.0]
    assert written["position"] == [0.0, 0.0, 1.6]
    assert any("was not written" in warning for warning in found["warnings"])
