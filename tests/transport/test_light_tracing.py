"""Paths from the light against paths from the camera: the same light, however it is shared between the two."""

import numpy as np
import pytest
from scipy.stats import t as student_t

from lightdepth.api import begin_rendering
from lightdepth.kernel.start import start
from lightdepth.scene.materials import Glass, Metal, MitsubaBsdf, Principled
from tests.transport.places import WHITE, ball, room

start()
import drjit as dr  # noqa: E402 - where LLVM is was settled by start()
import mitsuba as mi  # noqa: E402 - needs a variant of Mitsuba

from lightdepth.film.light_image import LightImage  # noqa: E402
from lightdepth.place.object_bounds import ObjectBounds  # noqa: E402
from lightdepth.preparation import objects  # noqa: E402
from lightdepth.transport.light_tracing import LightTracer  # noqa: E402


def likelier(factor):
    """The weights that are used, as if there were this many times as many light paths."""
    return lambda pdf_ratio: dr.rcp(1.0 + dr.square(dr.minimum(factor * pdf_ratio, 1e15)))


WEIGHTS = {
    "camera alone": lambda pdf_ratio: mi.Float(1.0) + 0.0 * pdf_ratio,
    "light where it can": lambda pdf_ratio: dr.select(pdf_ratio > 0.0, 0.0, 1.0),
    "the likelier": likelier(1.0),
    "ten times as likely": likelier(10.0),
}
MATERIALS = {
    "matte": WHITE,
    "rough metal": Metal(type="metal", name="Ag", roughness=0.5),
    "glass": Glass(type="glass", ior=1.5),
    "rough glass": Glass(type="glass", ior=1.5, roughness=0.4),
    "mirror": MitsubaBsdf(type="mitsuba", mitsuba={"type": "conductor", "material": "none"}),
    "principled": Principled(type="principled", base_color=(0.9, 0.6, 0.3), metallic=0.5, roughness=0.4),
}


def lit_from_one_side():
    """A panorama with a broad light on one side and darkness elsewhere."""
    image = np.full((32, 64, 3), 0.05, np.float32)
    image[6:14, 10:22] = (9.0, 6.0, 4.0)
    return image


def pictures(scene, camera, method, seeds, samples):
    """Change and objects of several pictures, shape (seeds, height, width, 3)."""
    renderings = [begin_rendering(scene, camera, method=method, seed=seed) for seed in seeds]
    frames = [rendering.complete(samples, auxiliary=False) for rendering in renderings]
    return np.stack([frame.change + frame.synthetic for frame in frames])


LIGHTS = {"even": 1.0, "from one side": lit_from_one_side()}
SEEDS = range(16)
"""Of the pictures that are compared: the standard deviation of fewer is too uncertain itself."""
MORE_SEEDS = {("rough glass", "light where it can"): range(64)}
"""Where single pictures are noisiest: one of the two leaves nearly all light through rough glass to chance."""
FALSE_ALARM = 1e-6
"""Chance that a test fails by bad luck, by Student's test on pairs of pictures."""
CAUGHT = 0.25
"""Smallest error that is caught, relative to the light of splats."""
BESIDE, BEFORE = ball(WHITE, (-0.35, 1.1, 0.25), 0.25), ball(WHITE, (-0.2, 0.8, 0.9), 0.3)
"""Another ball, out of the light's way, or half in it."""


@pytest.mark.parametrize(
    ("material", "light", "other", "camera", "method"),
    [
        *((name, "even", BESIDE, "view", "difference") for name in MATERIALS),
        ("rough metal", "from one side", BESIDE, "view", "difference"),
        ("rough metal", "from one side", BESIDE, "dome", "difference"),
        ("rough metal", "from one side", BESIDE, "pano", "difference"),
        ("rough metal", "from one side", BESIDE, "stereo", "difference"),
        ("rough metal", "from one side", BESIDE, "cubemap", "difference"),
        ("rough metal", "from one side", BESIDE, "view", "directional"),
        ("rough metal", "from one side", BEFORE, "view", "directional"),
    ],
)
def test_every_weighting_gives_the_same_light(material, light, other, camera, method, monkeypatch):
    # Light paths toward matte objects too: pdf ratios differ from material to material.
    monkeypatch.setattr(objects, "is_polished", lambda shape: True)
    scene = room(LIGHTS[light], [ball(MATERIALS[material]), other], max_bounces=4)
    seeds = {name: MORE_SEEDS.get((material, name), SEEDS) for name in WEIGHTS}
    seeds["camera alone"] = max(seeds.values(), key=len)

    def sums(name):
        monkeypatch.setattr(LightTracer, "weight", staticmethod(WEIGHTS[name]))
        return pictures(scene, camera, method, seeds[name], 32).sum(axis=(1, 2, 3), dtype=np.float64)

    found = {name: sums(name) for name in WEIGHTS}
    # The same without splats: how much they add.
    monkeypatch.setattr(LightImage, "add", lambda *_: None)
    seeds["light where it can"] = SEEDS
    expected = found.pop("camera alone")
    splatted = np.mean(expected[: len(SEEDS)] - sums("light where it can"))
    for name, values in found.items():
        difference = values - expected[: len(values)]
        standard_error = difference.std(ddof=1) / np.sqrt(len(difference))
        tolerance = student_t.isf(0.5 * FALSE_ALARM, len(difference) - 1) * standard_error
        assert tolerance < CAUGHT * splatted, name
        assert np.abs(difference.mean()) < tolerance, name


def test_light_tracing_makes_caustics_of_polished_metal_less_noisy(monkeypatch):
    metal = ball(Metal(type="metal", name="Ag", roughness=0.3))
    scene = room(lit_from_one_side(), [metal, BESIDE])
    ids = begin_rendering(scene, "view").complete(1).object_id
    together = pictures(scene, "view", "difference", range(4), 16).var(axis=0, ddof=1)
    monkeypatch.setattr(LightTracer, "weight", staticmethod(WEIGHTS["camera alone"]))
    camera_alone = pictures(scene, "view", "difference", range(4), 16).var(axis=0, ddof=1)
    for seen in (ids == 0, ids == 2):  # On real surfaces, and on the matte ball.
        assert together[seen].mean() < 0.6 * camera_alone[seen].mean()


def test_beams_are_drawn_with_the_density_that_they_say():
    bounds = ObjectBounds([(np.array([0.0, 0.0, 1.0]), 0.5), (np.array([1.2, 0.3, 0.8]), 0.3)])
    count = 1 << 18
    random = mi.PCG32(count)
    u = [random.next_float32() for _ in range(3)]
    toward_sky = dr.normalize(mi.Vector3f(0.4, -0.2, 0.9))
    for position, finite in ((mi.Vector3f(3.0, 2.0, 2.5), mi.Bool(True)), (toward_sky, mi.Bool(False))):
        beams = bounds.beams(position, finite)
        origin, direction = beams.sample(u[0], mi.Point2f(u[1], u[2]))
        density = beams.pdf(origin, direction).numpy()
        assert (density > 0.0).mean() > 0.999
        # The mean of 1 / p is the size of all that can be drawn, here of two parts that do not overlap.
        size = np.mean(1.0 / density[density > 0.0])
        if finite.numpy().all():
            offsets = [np.array([0.0, 0.0, 1.0]) - [3.0, 2.0, 2.5], np.array([1.2, 0.3, 0.8]) - [3.0, 2.0, 2.5]]
            sines = [0.5 / np.linalg.norm(offsets[0]), 0.3 / np.linalg.norm(offsets[1])]
            wanted = sum(2.0 * np.pi * (1.0 - np.sqrt(1.0 - sine**2)) for sine in sines)
        else:
            wanted = np.pi * (0.5**2 + 0.3**2)
        assert size == pytest.approx(wanted, rel=1e-2)
