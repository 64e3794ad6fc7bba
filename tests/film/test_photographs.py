"""A picture of a place with two photographs: plate, shares, change, and the file."""

from dataclasses import replace

import numpy as np
import pytest

import lightdepth
from lightdepth.cameras import Equirectangular, Perspective
from lightdepth.directions import look_at_rotation
from lightdepth.errors import InputError
from lightdepth.film.layers import read_frame, write_frame
from lightdepth.kernel.start import start
from lightdepth.scene.materials import Diffuse
from lightdepth.scene.model import CameraView, RenderSettings, Scene
from tests.place.virtual_room import CAPTURES, REAL, photograph
from tests.transport.places import ball

start("cpu")

from lightdepth.preparation.place import prepare_place  # noqa: E402

GAIN = np.float32([0.5, 0.8, 1.25])
SETTINGS = RenderSettings(irradiance_samples=32, max_bounces=3)


@pytest.fixture(scope="module")
def scene():
    """A grey ball on the floor; the second photograph has another white balance."""
    first, second = photograph(CAPTURES[0], 64), photograph(CAPTURES[1], 64, balanced=False)
    second = replace(second, radiance=second.radiance / GAIN)
    position = np.array([1.0, 1.2, 1.4])
    small = Perspective(type="perspective", width=40, height=30, fov=70)
    cameras = {
        "view": CameraView(small, position, look_at_rotation(position, (0.9, -0.6, 0.3))),
        "second": CameraView(Equirectangular(type="equirectangular", width=128), second.position, second.rotation),
    }
    thing = ball(Diffuse(type="diffuse", color=(0.5, 0.5, 0.5)), (1.0, -0.7, 0.3), 0.3)
    return Scene(first, REAL, (thing,), cameras, SETTINGS, further=(second,))


@pytest.fixture(scope="module")
def frame(scene):
    return lightdepth.render(scene, camera="view", samples=16)


def test_the_plate_is_the_photographs_in_shares(frame):
    shares = frame.photograph
    assert shares.shape == (30, 40, 2)
    total = shares.sum(axis=2)
    assert total.max() < 1.0 + 1e-5
    assert (total > 0.99).mean() > 0.8
    assert shares[..., 1].mean() > 0.7  # It is made from nearer.


def test_the_shadow_is_dark_and_never_below_black(frame):
    shadowed = (frame.change < -0.02 * frame.plate).all(axis=2)
    assert shadowed.mean() > 0.02
    assert (frame.beauty > -1e-3).all()


def test_at_the_second_capture_point_its_photograph_is_the_plate(scene):
    plate = lightdepth.begin_rendering(scene, camera="second").plate
    given = scene.further[0].radiance
    gain = prepare_place(scene).gains[1]
    np.testing.assert_allclose(gain, GAIN, rtol=0.02)
    np.testing.assert_array_equal(plate, given * gain)


def test_the_file_keeps_the_shares(frame, tmp_path):
    write_frame(tmp_path / "x.exr", frame)
    np.testing.assert_array_equal(read_frame(tmp_path / "x.exr").photograph, frame.photograph)


def test_what_shares_nothing_is_refused(scene):
    mask = np.zeros((64, 128), np.float32)
    mask[:2] = 1.0
    masked = replace(scene, further=(replace(scene.further[0], mask=mask),))
    with pytest.raises(InputError, match=r"\[\[panorama\]\] 2: .*next to nothing that another panorama sees"):
        lightdepth.render(masked, camera="view", samples=1)


def test_the_method_of_the_paper_refuses_several(scene):
    with pytest.raises(InputError, match="'envpath' uses one panorama"):
        lightdepth.render(scene, camera="view", samples=1, method="envpath")
