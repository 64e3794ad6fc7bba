"""Paths from the light against paths from the camera: the same light, however it is shared between the two."""

import numpy as np
import pytest

from lightdepth.api import begin_rendering
from lightdepth.kernel.start import start
from lightdepth.parameters import FilmParameters, Parameters
from lightdepth.scene.materials import Glass, Metal, MitsubaBsdf, Principled
from tests.chance import Seen, check_seen, enough, standard_errors
from tests.transport.places import WHITE, ball, room

start()
import drjit as dr  # noqa: E402 - where LLVM is was settled by start()
import mitsuba as mi  # noqa: E402 - needs a variant of Mitsuba

from lightdepth.place.object_bounds import ObjectBounds  # noqa: E402
from lightdepth.preparation import objects  # noqa: E402
from lightdepth.transport.light_tracing import LightTracer  # noqa: E402

WEIGHTS = {"light where it can": 1e30, "the likelier": 1.0}
"""Ways to share the light, as if there were this many times as many light paths; without any, the camera is alone.

The first finds paths that one of the two lacks or counts twice, the other whatever is wrong with their pdf ratios.
"""


def share_light(monkeypatch, factor):
    """Weigh paths from the camera as if there were ``factor`` times as many light paths."""
    factor = dr.opaque(mi.Float, factor)  # Not part of the program, which is compiled once.

    def weight(pdf_ratio):
        return dr.rcp(1.0 + dr.square(dr.minimum(factor * pdf_ratio, 1e15)))

    monkeypatch.setattr(LightTracer, "weight", staticmethod(weight))


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
    """Change and objects of several pictures, shape (seeds, height, width, 3), and the splats among them."""
    renderings = [begin_rendering(scene, camera, method=method, seed=seed) for seed in seeds]
    for (
        rendering
    ) in renderings:  # The first of two equal rounds, which is one pass: more passes take longer than samples.
        next(rendering.run(2 * samples))
    frames = [rendering.frame(auxiliary=False) for rendering in renderings]
    splats = [sum(rendering._light.means(slice(None))[:2]).sum(dtype=np.float64) for rendering in renderings]
    return np.stack([frame.change + frame.synthetic for frame in frames]), np.array(splats)


LIGHTS = {"even": 1.0, "from one side": lit_from_one_side()}
SAMPLES = 16
"""Of a picture: the most of a first round."""
FIRST = {"rough glass": 24}
"""Pictures that say how many are needed, 12 for other materials.

Where that is far more, twice as many first ones save more than they cost: Student's limit is narrower with them.
"""
MOST = 128
"""Pictures at most. Where one of the first is an outlier and more would be wanted, a larger error is let pass that once."""
CAUGHT = 0.25
"""Smallest error that is caught, relative to the light of splats."""
FEW_TRAINING_PATHS = Parameters(film=FilmParameters(first_training_paths=1 << 12, fewest_training_paths=1 << 12))
"""The radiance cache is right however it is trained, and trains longer than these pictures take."""
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
        pytest.param("rough metal", "from one side", BESIDE, "stereo dome", "difference", marks=pytest.mark.truth),
        ("rough metal", "from one side", BESIDE, "cubemap", "difference"),
        ("rough metal", "from one side", BESIDE, "view", "directional"),
        ("rough metal", "from one side", BEFORE, "view", "directional"),
    ],
)
def test_every_weighting_gives_the_same_light(material, light, other, camera, method, monkeypatch):
    """An error of a quarter of the splats' light is caught, with a false alarm once in a million cases.

    As many pairs of pictures as that needs, by the spread of the first ones.
    """
    # Light paths toward matte objects too: pdf ratios differ from material to material.
    monkeypatch.setattr(objects, "is_polished", lambda shape: True)
    scene = room(LIGHTS[light], [ball(MATERIALS[material]), other], max_bounces=4, parameters=FEW_TRAINING_PATHS)

    def sums(factor, seeds):
        share_light(monkeypatch, factor)
        images, splats = pictures(scene, camera, method, seeds, SAMPLES)
        return images.sum(axis=(1, 2, 3), dtype=np.float64), splats

    first = FIRST.get(material, 12)
    expected, _ = sums(0.0, range(first))
    found = {name: sums(factor, range(first)) for name, factor in WEIGHTS.items()}
    splatted = found["light where it can"][1].mean()
    assert splatted > 0.0
    for name, (values, splats) in found.items():
        assert splats.any()
        pairs = values - expected[:first]
        count = enough(pairs, CAUGHT * splatted, len(WEIGHTS))
        assert count < 16 * MOST, f"{name}: {count} pictures are needed"  # Four times the error would not be caught.
        count = min(count, MOST)
        if len(expected) < count:
            expected = np.append(expected, sums(0.0, range(len(expected), count))[0])
        rest, _ = sums(WEIGHTS[name], range(first, count)) if count > first else (values[:0], None)
        pairs = np.append(values, rest) - expected[:count]
        limit = standard_errors(first - 1, len(WEIGHTS)) * pairs[:first].std(ddof=1) / np.sqrt(count)
        assert abs(pairs.mean()) < limit, name


def test_light_tracing_makes_caustics_of_polished_metal_less_noisy(monkeypatch):
    metal = ball(Metal(type="metal", name="Ag", roughness=0.3))
    scene = room(lit_from_one_side(), [metal, BESIDE])
    ids = begin_rendering(scene, "view").complete(1).object_id

    def deviation(factor):
        """Mean standard deviation of a pixel. Of variances, a few outliers would be most of the mean."""
        share_light(monkeypatch, factor)
        return pictures(scene, "view", "difference", range(8), SAMPLES)[0].std(axis=0, ddof=1)[ids != 1].mean()

    # On real surfaces and on the matte ball it is half as noisy; a quarter of the samples does.
    check_seen(np.log(deviation(1.0) / deviation(0.0)), Seen(12, -0.711, -0.711, 0.0628), high=0.0)


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
        assert size == pytest.approx(wanted, rel=1e-5)  # Both parts have one density: no chance is in it.
