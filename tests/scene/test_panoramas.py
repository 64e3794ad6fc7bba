"""Several panoramas of one place in a scene file, and a picture that is not the light."""

import numpy as np
import pytest

from lightdepth.errors import InputError
from lightdepth.images.exr import ExrPart, write_exr
from lightdepth.images.png import write_png
from lightdepth.scene import load_scene
from lightdepth.scene.identity import place_digest

REAL = '[[real]]\nname = "floor"\nmesh = "floor.ply"\nrole = "support"\n'
FIRST = '[[panorama]]\nimage = "p.exr"\nposition = [0, 0, 1.5]\n'


@pytest.fixture
def load(scene_folder):
    """Loads a scene with these tables; `q.exr` is a second panorama, half as bright."""
    write_exr(scene_folder / "q.exr", [ExrPart({c: np.full((16, 32), 0.25, np.float32) for c in "RGB"})])

    def read(text):
        path = scene_folder / "scene.toml"
        path.write_text(f"{text}\n{REAL}")
        return load_scene(path)

    return read


def test_a_list_of_one_is_the_single_table(load):
    one, same = load(FIRST), load(FIRST.replace("[[panorama]]", "[panorama]"))
    assert one.further == ()
    assert place_digest(one) == place_digest(same)
    np.testing.assert_array_equal(one.cameras["pano"].position, [0.0, 0.0, 1.5])


def test_further_panoramas_have_their_own_pose_gain_and_depth(load, scene_folder):
    np.save(scene_folder / "z.npy", np.full((4, 8), 2.0, np.float32))
    second = '[[panorama]]\nimage = "q.exr"\nposition = [2, 1, 1.4]\nrotation = [0, 0, 90]\nscale = 2.0\n'
    scene = load(FIRST + second + 'gain = [1, 2, 4]\ndepth = "z.npy"\n' + second)
    first, given, open_ = scene.panoramas
    np.testing.assert_array_equal(given.position, [2.0, 1.0, 1.4])
    np.testing.assert_allclose(given.rotation @ [0, 1, 0], [-1, 0, 0], atol=1e-15)
    np.testing.assert_array_equal(given.radiance[3, 5], np.float32([0.5, 1.0, 2.0]))
    np.testing.assert_array_equal(open_.radiance[3, 5], np.float32(0.5))
    assert given.depth is not None
    assert open_.depth is None
    assert (first.balanced, given.balanced, open_.balanced) == (True, True, False)
    assert first.unclipped is None
    assert scene.panorama is first


def test_picture_and_light_apart(load, scene_folder):
    write_exr(scene_folder / "clean.exr", [ExrPart({c: np.full((8, 16), 0.75, np.float32) for c in "RGB"})])
    mask = np.full((8, 16, 3), 255, np.uint8)
    mask[2] = 0
    write_png(scene_folder / "m.png", mask)
    panorama = load(FIRST + 'plate = "clean.exr"\nmask = "m.png"\nscale = 2.0\n').panorama
    np.testing.assert_array_equal(panorama.shown_radiance, np.float32(1.5))
    np.testing.assert_array_equal(panorama.light_radiance, np.float32(1.0))
    np.testing.assert_array_equal(panorama.mask, np.repeat(np.float32([1, 1, 0, 1, 1, 1, 1, 1])[:, None], 16, axis=1))


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ('image = "none.exr"', r'scene.toml:6: \[\[panorama\]\] 2 \("none.exr"\): image: .*no such file'),
        ('image = "q.exr"\nscal = 2', r'scene.toml:7: .*2 \("q.exr"\): unknown key .scal.; did you mean .scale.'),
        ('image = "q.exr"\ngain = [1, 0, 1]', r"gain: must be one number or three, above 0"),
        ('image = "q.exr"\nplate = "p.exr"', r"plate: .*p.exr: is 16 x 8 pixels, but the panorama 32 x 16"),
        ('image = "q.exr"\nmask = "bright.exr"', r"mask: .*white \(1\) where .* has values from 4 to 4"),
        ('image = "q.exr"\nmask = "black.exr"', r"mask: .*black everywhere"),
    ],
)
def test_mistakes_name_the_panorama_and_the_key(load, scene_folder, keys, message):
    for name, value in (("bright", 4.0), ("black", 0.0)):
        write_exr(scene_folder / f"{name}.exr", [ExrPart({c: np.full((16, 32), value, np.float32) for c in "RGB"})])
    with pytest.raises(InputError, match=message):
        load(FIRST + "\n[[panorama]]\n" + keys)


def test_no_panorama_at_all(load):
    for text, message in (("", "the key 'panorama' is missing"), ("panorama = []", "panorama: .*at least 1")):
        with pytest.raises(InputError, match=message):
            load(text)
