"""`lightdepth recover` as a user runs it."""

import json
import shutil

import cv2
import numpy as np
import pytest

from lightdepth.images.radiance import read_radiance
from lightdepth.lighting.scene_file import write_light
from lightdepth.scene.load import load_scene


@pytest.fixture
def room(barred_folder, tmp_path):
    shutil.copytree(barred_folder, tmp_path / "room")
    return tmp_path / "room"


def test_recover_sun_writes_the_light_and_keeps_the_rest(command, room, barred):
    before = (room / "room.toml").read_text()
    status, out, _ = command(
        "recover", "sun", room / "room.toml", "--write", "--json",
        "--picture", room / "sun.png", "--mask", room / "mask.exr",
    )  # fmt: skip
    assert status == 0
    report = json.loads(out)
    after = (room / "room.toml").read_text()
    assert after.startswith(before.rstrip("\n"))
    (light,) = load_scene(room / "room.toml").lights
    np.testing.assert_allclose(light.direction, report["direction"], atol=1e-6)
    np.testing.assert_allclose(light.irradiance, barred.sun().irradiance, rtol=0.05)
    mask = read_radiance(room / "mask.exr")
    assert mask.min() >= 0.0
    assert mask.max() <= 1.0
    picture = cv2.imread(str(room / "sun.png"))
    assert picture.shape == (512, 1024, 3)
    # The outline is drawn where the floor's patch is, in its own colour.
    assert np.count_nonzero(np.all(np.abs(picture.astype(int) - (200, 60, 255)) < 40, axis=2)) > 200


def test_a_second_run_changes_the_same_table(command, room):
    for azimuth in (30.0, 35.03):
        write_light(
            room / "room.toml",
            "sun",
            {"type": "sun", "azimuth": azimuth, "elevation": 30.0, "irradiance": [1.0, 1.0, 1.0]},
        )
    write_light(room / "room.toml", "sun", {"direction": [0.0, 0.6, 0.8], "irradiance": [2.0, 2.0, 2.0]})
    (light,) = load_scene(room / "room.toml").lights
    np.testing.assert_allclose(light.direction, [0.0, 0.6, 0.8])
    assert "azimuth" not in (room / "room.toml").read_text()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--azimuth", "10"), "--azimuth and --elevation go together"),
        (("--direction", "0,0,0"), "must not be 0,0,0"),
        (("--direction", "0,0,1", "--azimuth", "1", "--elevation", "2"), "either --direction or"),
        (("--mask", "mask.png"), "'.png' is not a format for masks"),
        (("--patch", "10,20 30"), "'30' is not a point"),
        (("--patch", " "), "patch 1 is empty"),
        (("--azimuth", "35", "--elevation", "-5"), "5.0 degrees below the horizon"),
    ],
)
def test_bad_options_are_refused_in_words(command, room, options, words):
    status, _, err = command("recover", "sun", room / "room.toml", *options)
    assert status == 2
    assert words in err
