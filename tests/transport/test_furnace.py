"""In light that is the same from everywhere nothing can be seen that neither absorbs nor glows."""

import numpy as np
import pytest

import lightdepth
from lightdepth.scene.materials import Glass, Metal, MitsubaMaterial, Principled
from lightdepth.scene.model import Gloss
from tests.transport.places import WHITE, ball, room

MIRROR = MitsubaMaterial(mitsuba={"type": "conductor", "material": "none"})
LOSSLESS = {
    "diffuse": WHITE,
    "mirror": MIRROR,
    "glass": Glass(type="glass", ior=1.5),
}
LOSSY = {
    "metal": Metal(type="metal", name="Ag", roughness=0.3),
    "rough glass": Glass(type="glass", ior=1.5, roughness=0.3),
    "principled": Principled(type="principled", base_color=(1.0, 1.0, 1.0), roughness=0.5),
    "principled metal": Principled(type="principled", base_color=(1.0, 1.0, 1.0), metallic=1.0, roughness=0.3),
}


@pytest.mark.parametrize("camera", ["pano", "dome", "view"])
@pytest.mark.parametrize("method", ["difference", "directional"])
def test_a_constant_map_without_objects_is_constant(camera, method):
    frame = lightdepth.render(room(0.7), camera, samples=4, method=method)
    np.testing.assert_allclose(frame.beauty[frame.alpha == 1], np.float32(0.7), rtol=1e-6)


@pytest.mark.parametrize("camera", ["pano", "dome", "view"])
@pytest.mark.parametrize("method", ["difference", "directional"])
def test_a_white_ball_in_a_white_room_is_invisible(camera, method):
    frame = lightdepth.render(room(1.0, [ball(WHITE)], max_bounces=200), camera, samples=64, method=method)
    inside = frame.alpha == 1
    assert frame.beauty[inside].mean() == pytest.approx(1.0, abs=0.01)
    blocks = frame.beauty[inside][: inside.sum() // 64 * 64].reshape(-1, 64, 3).mean(axis=(1, 2))
    np.testing.assert_allclose(blocks, 1.0, atol=0.06)


@pytest.mark.parametrize("name", LOSSLESS)
def test_lossless_materials_are_invisible(name):
    frame = lightdepth.render(room(1.0, [ball(LOSSLESS[name])], max_bounces=200), "view", samples=64)
    seen = frame.coverage == 1
    assert seen.sum() > 20
    assert frame.beauty[seen].mean() == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("name", LOSSY)
def test_other_materials_absorb_and_never_add(name):
    frame = lightdepth.render(room(1.0, [ball(LOSSY[name])], max_bounces=200), "view", samples=64)
    seen = frame.coverage == 1
    assert 0.5 < frame.beauty[seen].mean() < 1.01


def test_a_glossy_support_counts_its_reflection_once():
    scene = room(1.0, [ball(WHITE)], gloss=Gloss(roughness=0.3, specular=0.5), max_bounces=200)
    frame = lightdepth.render(scene, "view", samples=64)
    assert frame.beauty.mean() == pytest.approx(1.0, abs=0.015)
