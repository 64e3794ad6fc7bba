"""In light that is the same from everywhere nothing can be seen that neither absorbs nor glows."""

import numpy as np
import pytest

import lightdepth
from lightdepth.kernel.start import start
from lightdepth.scene.materials import Glass, Metal, MitsubaBsdf, Principled
from lightdepth.scene.model import Gloss
from tests.chance import Seen, check_mean, check_seen, enough, standard_errors
from tests.transport.places import HIGH, LOW, WHITE, ball, one_pass, room, with_floor_alone_as_support

start()
from lightdepth.transport.difference import DifferenceIntegrator  # noqa: E402 - needs a variant of Mitsuba

MIRROR = MitsubaBsdf(type="mitsuba", mitsuba={"type": "conductor", "material": "none"})
LOSSLESS = {
    "diffuse": WHITE,
    "mirror": MIRROR,
    "glass": Glass(type="glass", ior=1.5),
    "principled": Principled(type="principled", base_color=(1.0, 1.0, 1.0), roughness=0.5),
    "principled metal": Principled(type="principled", base_color=(1.0, 1.0, 1.0), metallic=1.0, roughness=0.3),
    "metal in part": Principled(type="principled", base_color=(1.0, 1.0, 1.0), metallic=0.5, roughness=0.9),
}
LOSSY = {
    "metal": Metal(type="metal", name="Ag", roughness=0.3),
    "rough glass": Glass(type="glass", ior=1.5, roughness=0.3),
}


@pytest.mark.parametrize("camera", ["pano", "dome", "view"])
@pytest.mark.parametrize("method", ["difference", "directional"])
def test_a_constant_map_without_objects_is_constant(camera, method):
    frame = lightdepth.render(room(0.7), camera, samples=4, method=method)
    np.testing.assert_allclose(frame.beauty[frame.alpha == 1], np.float32(0.7), rtol=1e-6)


def furnace(material, gloss=None):
    """Only the floor is support: a closed room of white support would keep light for ever."""
    return with_floor_alone_as_support(room(1.0, [ball(material)], gloss=gloss, max_bounces=200))


def ball_mean(scene):
    """Mean radiance of a picture's ball, by seed."""

    def mean(seed):
        frame = one_pass(scene, "view", seed)
        seen = frame.coverage == 1
        assert seen.sum() > 20
        return frame.beauty[seen].mean()

    return mean


@pytest.mark.parametrize("camera", ["pano", "dome", "view"])
@pytest.mark.parametrize("method", ["difference", "directional"])
def test_a_white_ball_is_invisible(camera, method):
    scene = furnace(WHITE)

    def means(seed):
        """Of the whole picture, of the ball, and of parts."""
        frame = one_pass(scene, camera, seed, method=method)
        inside = frame.alpha == 1
        blocks = np.array_split(frame.beauty[inside], 6)
        ball = frame.beauty[frame.coverage == 1]
        return frame.beauty[inside].mean(), ball.mean(), *(block.mean() for block in blocks)

    check_mean(means, 1.0, caught=[0.003] + [0.05] * 7)


@pytest.mark.parametrize("name", LOSSLESS)
def test_lossless_materials_are_invisible(name):
    check_mean(ball_mean(furnace(LOSSLESS[name])), 1.0, caught=0.02)


@pytest.mark.parametrize("name", LOSSY)
def test_other_materials_absorb_and_never_add(name):
    """A mean that is 0.06 too high is caught."""
    radiance = ball_mean(furnace(LOSSY[name]))
    first = [radiance(seed) for seed in range(12)]
    count = enough(first, 0.06)
    assert count < 16 * 48  # Four times the error would not be caught.
    count = min(count, 48)
    mean = np.mean([*first, *(radiance(seed) for seed in range(len(first), count))])
    limit = standard_errors(len(first) - 1) * np.std(first, ddof=1) / np.sqrt(count)
    assert 0.5 < mean < 1.0 + limit


def test_a_glossy_support_counts_its_reflection_once():
    """From the capture point; from elsewhere, a floor that mirrors more or less is not of radiance 1."""
    scene = furnace(WHITE, gloss=Gloss(roughness=0.3, specular=0.5))
    check_mean(lambda seed: one_pass(scene, "pano", seed).beauty.mean(), 1.0, caught=0.005)


@pytest.mark.parametrize("cells", [False, True])
def test_a_white_room_of_support_keeps_its_light_and_paths_their_weight(cells, monkeypatch):
    """The hardest case: nothing absorbs, so that any weight that grows from vertex to vertex would show as an outlier.

    Where paths are cut off after some bounces, those that end on the ball have lost the light that it blocks and not
    got back the light that it scatters; after a few bounces in white, vertices lie anywhere with the same density.
    What cells remember, the paths of a picture share, so that its mean varies more from picture to picture.
    """
    if not cells:
        monkeypatch.setattr(DifferenceIntegrator, "new_cache", lambda self: None)
    radius = 0.4
    scene = room(1.0, [ball(WHITE, radius=radius)], max_bounces=16)
    means = []

    def mean(seed):
        means.append(one_pass(scene, "view", seed, training=1 << 16).beauty.mean(dtype=np.float64))
        return means[-1]

    width, depth, height = HIGH - LOW
    walls = 2.0 * (width * depth + width * height + depth * height)
    on_the_ball = 4.0 * np.pi * radius**2 / (4.0 * np.pi * radius**2 + walls)
    check_mean(mean, 1.0 - on_the_ball, caught=0.005)
    spread = np.log(np.std(means, ddof=1))
    if cells:
        check_seen(spread, Seen(12, -5.05, -5.05, 0.0631), high=np.log(0.02))
    else:
        check_seen(spread, Seen(25, -5.82, -5.82, 0.098), high=np.log(0.007))
