"""Paths from the light against paths from the camera: the same light, however it is shared between the two."""

import numpy as np
import pytest

from lightdepth.api import begin_rendering
from lightdepth.kernel.start import start
from lightdepth.scene.materials import Glass, Metal, MitsubaBsdf, Principled
from tests.transport.places import WHITE, ball, room

start()
import drjit as dr  # noqa: E402 - where LLVM is was settled by start()
import mitsuba as mi  # noqa: E402 - needs a variant of Mitsuba

from lightdepth.transport.bounds import ObjectBounds  # noqa: E402
from lightdepth.transport.light_paths import LightPaths  # noqa: E402

SHARES = {"camera": lambda odds: mi.Float(1.0) + 0.0 * odds, "light": lambda odds: dr.select(odds > 0.0, 0.0, 1.0)}
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


def changes(scene, camera, method, seeds, samples=64):
    """Mean change of each pixel, and the variance of that, from several pictures."""
    pictures = []
    for seed in seeds:
        rendering = begin_rendering(scene, camera, method=method, seed=seed)
        pictures.append(rendering.complete(samples, auxiliary=False).change)
    return np.mean(pictures, axis=0), np.var(pictures, axis=0, ddof=1) / len(pictures)


@pytest.mark.parametrize(
    ("material", "camera", "method"),
    [
        *((name, "view", "difference") for name in MATERIALS),
        ("rough metal", "dome", "difference"),
        ("rough metal", "pano", "difference"),
        ("rough metal", "view", "directional"),
    ],
)
def test_both_bring_the_same_light(material, camera, method, monkeypatch):
    found = {}
    for share, weight in SHARES.items():
        monkeypatch.setattr(LightPaths, "weight", staticmethod(weight))
        scene = room(lit_from_one_side(), [ball(MATERIALS[material])], max_bounces=4)
        found[share] = changes(scene, camera, method, range(4))
    difference = found["camera"][0] - found["light"][0]
    variance = found["camera"][1] + found["light"][1]
    rows, columns = (length // 8 for length in difference.shape[:2])
    blocks = (slice(0, rows * 8), slice(0, columns * 8))

    def summed(values):
        return values[blocks].reshape(rows, 8, columns, 8, 3).sum(axis=(1, 3))

    z = summed(difference) / np.sqrt(np.maximum(summed(variance), 1e-12))
    assert np.abs(z.mean()) < 0.35
    assert np.sqrt(np.mean(np.square(z))) < 1.4


def test_light_paths_make_what_polished_metal_throws_less_noisy(monkeypatch):
    scene = room(lit_from_one_side(), [ball(Metal(type="metal", name="Ag", roughness=0.3))])
    _, together = changes(scene, "view", "difference", range(4), samples=16)
    monkeypatch.setattr(LightPaths, "weight", staticmethod(SHARES["camera"]))
    _, camera_alone = changes(scene, "view", "difference", range(4), samples=16)
    assert together.mean() < 0.6 * camera_alone.mean()


def test_beams_are_drawn_with_the_density_that_they_say():
    bounds = ObjectBounds([(np.array([0.0, 0.0, 1.0]), 0.5), (np.array([1.2, 0.3, 0.8]), 0.3)])
    count = 1 << 18
    random = mi.PCG32(count)
    numbers = [random.next_float32() for _ in range(3)]
    toward_sky = dr.normalize(mi.Vector3f(0.4, -0.2, 0.9))
    for place, finite in ((mi.Vector3f(3.0, 2.0, 2.5), mi.Bool(True)), (toward_sky, mi.Bool(False))):
        beams = bounds.beams(place, finite)
        origin, direction = beams.sample(numbers[0], mi.Point2f(numbers[1], numbers[2]))
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
