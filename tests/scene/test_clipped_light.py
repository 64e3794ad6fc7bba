"""``[[light]]`` with ``type = "clipped"``."""

import numpy as np
import pytest

from lightdepth.errors import InputError
from lightdepth.images.radiance import write_radiance
from lightdepth.scene.load import load_scene

ROOM = """[panorama]
image = "pano.exr"
scale = 2.0
sky = true

[[real]]
name = "floor"
mesh = "floor.obj"
role = "support"
"""


@pytest.fixture
def room(tmp_path):
    radiance = np.ones((32, 64, 3), np.float32)
    radiance[8:10, 20:23] = 4.0
    write_radiance(tmp_path / "pano.exr", radiance)
    (tmp_path / "floor.obj").write_text("v -1 -1 -1\nv 1 -1 -1\nv 0 1 -1\nf 1 2 3\n")

    def write(light):
        (tmp_path / "room.toml").write_text(ROOM + "\n[[light]]\n" + light)
        return tmp_path / "room.toml"

    return write


def test_light_is_raised_and_the_plate_stays(room):
    panorama = load_scene(room('type = "clipped"\npixel = [21.5, 9.5]\nradiance = [80.0, 60.0, 40.0]\n')).panorama
    assert panorama.radiance.max() == 8.0
    np.testing.assert_array_equal(panorama.light_radiance[8:10, 20:23], np.broadcast_to([80.0, 60.0, 40.0], (2, 3, 3)))
    assert np.count_nonzero(panorama.light_radiance != panorama.radiance) == 18


def test_without_one_light_and_plate_are_the_same_array(room):
    panorama = load_scene(room('type = "sun"\nazimuth = 1.0\nelevation = 2.0\nirradiance = [1.0, 1.0, 1.0]\n')).panorama
    assert panorama.light_radiance is panorama.radiance


@pytest.mark.parametrize(
    ("light", "words"),
    [
        ('type = "clipped"\npixel = [64.5, 3.0]\nradiance = [1.0, 1.0, 1.0]\n', "pixel 64.5,3 is not on the panorama"),
        ('type = "clipped"\npixel = [4.5, 3.0]\n', "radiance"),
        ('type = "lamp"\n', "allowed: sun, clipped"),
    ],
)
def test_what_cannot_be_is_refused(room, light, words):
    with pytest.raises(InputError) as error:
        load_scene(room(light))
    assert words in str(error.value)
    assert "light" in str(error.value)
