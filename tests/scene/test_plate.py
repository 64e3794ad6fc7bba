"""`[plate]` in a scene file: the picture of one camera."""

import numpy as np
import pytest

from lightdepth.errors import InputError
from lightdepth.images.exr import ExrPart, write_exr
from lightdepth.images.png import write_png
from lightdepth.scene import load_scene
from lightdepth.scene.identity import place_digest, scene_digest

CAMERA = (
    '[camera.photo]\ntype = "perspective"\nwidth = 6\nheight = 4\n[camera.all]\ntype = "equirectangular"\nwidth = 8\n'
)
PLATE = '[plate]\nimage = "photo.exr"\ncamera = "photo"\n'


@pytest.fixture
def radiance(scene_folder):
    """That of `photo.exr`, of 6 x 4 pixels; the noise of black is negative."""
    pixels = np.random.default_rng(0).normal(0.3, 0.2, (4, 6, 3)).astype(np.float32)
    write_exr(scene_folder / "photo.exr", [ExrPart({"RGB": pixels})])
    return pixels


def test_the_plate_is_the_file_bit_for_bit(write_scene, radiance):
    assert radiance.min() < 0.0
    plate = load_scene(write_scene(CAMERA + PLATE)).plate
    np.testing.assert_array_equal(plate.radiance, radiance)
    assert (plate.camera, plate.gain) == ("photo", None)
    assert load_scene(write_scene(CAMERA + PLATE + "gain = 2.0")).plate.gain == (2.0, 2.0, 2.0)


def test_a_picture_for_the_screen_is_linearised(write_scene, scene_folder):
    write_png(scene_folder / "photo.png", np.full((4, 6, 3), [255, 188, 0], np.uint8))
    plate = load_scene(write_scene(CAMERA + PLATE.replace(".exr", ".png"))).plate
    np.testing.assert_allclose(plate.radiance[2, 3], [1.0, 0.503, 0.0], atol=0.001)


def test_it_belongs_to_the_picture_and_not_to_the_place(write_scene, radiance):
    scenes = [load_scene(write_scene(CAMERA + text)) for text in ("", PLATE, PLATE + "gain = 2.0")]
    assert len({place_digest(scene) for scene in scenes}) == 1
    assert len({scene_digest(scene) for scene in scenes}) == 3


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            PLATE.replace('"photo"', '"foto"'),
            r"\.toml:\d+: \[plate\]: camera: there is no \[camera\.foto\].*all, photo",
        ),
        (PLATE.replace('"photo"', '"all"'), r"\[camera\.all\] is of type 'equirectangular'.*type 'perspective'"),
        (PLATE.replace("photo.exr", "p.exr"), r"p\.exr: is 16 x 8 pixels, but \[camera\.photo\] 6 x 4"),
        (PLATE.replace("photo.exr", "none.exr"), r"\[plate\]: image: .*none\.exr: no such file"),
        (PLATE.replace("photo.exr", "nan.exr"), r"nan\.exr: 1 of its pixels are NaN or infinite, .* row 1, column 2"),
        (
            PLATE.replace("photo.exr", "floor.ply"),
            r"'\.ply' is not a format for a plate; allowed are \.exr, \.hdr, \.jpg",
        ),
        (PLATE + "gain = [1, 0, 1]", r"\[plate\]: gain: must be one number or three, above 0"),
        (PLATE + "scale = 1", r"\[plate\]: unknown key 'scale'"),
    ],
)
def test_mistakes_name_the_table_and_what_is_allowed(write_scene, scene_folder, radiance, text, message):
    radiance[1, 2, 0] = np.nan
    write_exr(scene_folder / "nan.exr", [ExrPart({"RGB": radiance})])
    with pytest.raises(InputError, match=message):
        load_scene(write_scene(CAMERA + text))


def test_a_wrong_camera_is_reported_once(write_scene, radiance):
    with pytest.raises(InputError, match="height") as caught:
        load_scene(write_scene(CAMERA.replace("height = 4\n", "") + PLATE))
    assert len(str(caught.value).splitlines()) == 1
