"""What is rendered onto the photograph of an ordinary camera, against path tracing through the same lens."""

from dataclasses import replace

import numpy as np
import pytest
from bench.places.polished_room import polished_room
from bench.truth import truth as bench_truth

import lightdepth
from lightdepth.cameras import Perspective
from lightdepth.directions import euler_rotation, look_at_rotation
from lightdepth.kernel.start import start
from lightdepth.scene.materials import Diffuse
from lightdepth.scene.model import CameraView, Gloss, Panorama, Plate, RenderSettings, Scene
from tests.support.textured_room import CAPTURE, ROTATION, panorama_view, trace, true_surfaces
from tests.transport.places import ball

GAIN = np.float32([0.4, 0.3, 0.25])
POSITION = np.array([-0.9, -1.2, 1.45])
LENS = Perspective(
    type="perspective", width=144, height=108, fov=70, distortion=(-0.18, 0.04), principal_point=(0.51, 0.49)
)
VIEW = CameraView(LENS, POSITION, look_at_rotation(POSITION, (1.0, 1.1, 0.25)))
SUPPORT = ("floor", "rug", "ceiling", "front", "back", "left", "right")


@pytest.mark.truth
def test_change_and_object_are_within_two_per_cent() -> None:
    start("cpu")
    things = (ball(Diffuse(type="diffuse", color=(0.6, 0.15, 0.1)), (1.2, 1.0, 0.3), 0.3),)
    panorama = trace(panorama_view(1024), 64)
    empty, full = trace(VIEW, 1024, seed=5), trace(VIEW, 1024, things, seed=6)
    scene = Scene(
        Panorama(panorama.mean.astype(np.float32), CAPTURE, euler_rotation(ROTATION)),
        true_surfaces(SUPPORT),
        things,
        {"photo": VIEW},
        RenderSettings(irradiance_samples=256),
        plate=Plate(empty.mean.astype(np.float32) * GAIN, "photo"),
    )
    frame = lightdepth.render(scene, camera="photo", samples=256)
    gain = np.array(frame.metadata["plate_gain"].split(), float)
    np.testing.assert_allclose(gain, GAIN, rtol=0.005)
    change, true_change = frame.beauty / GAIN - empty.mean, full.mean - empty.mean
    changed = (full.coverage == 0.0) & (np.abs(true_change).mean(axis=2) > 0.05 * empty.mean.mean(axis=2))
    assert changed.mean() > 0.02
    np.testing.assert_allclose(change[changed].sum(axis=0), true_change[changed].sum(axis=0), rtol=0.02)
    assert np.abs(change - true_change)[changed].mean() < 0.02 * empty.mean[changed].mean()
    covered = full.coverage == 1.0
    np.testing.assert_allclose((frame.beauty / GAIN)[covered].mean(axis=0), full.mean[covered].mean(axis=0), rtol=0.02)


@pytest.mark.truth
@pytest.mark.parametrize("roughness", [0.25, 0.12])
def test_change_on_a_polished_floor_is_within_two_per_cent(roughness: float) -> None:
    start("cpu")
    gloss = Gloss(roughness, 0.5)
    place = polished_room("matte", gloss)
    view = place.camera("view", 160)
    empty, full = (bench_truth(place, "view", 160, 512, objects) for objects in (False, True))
    scene = place.scene(512, 256)
    real = tuple(replace(each, gloss=gloss) if each.name == "floor" else each for each in scene.real)
    scene = replace(
        scene,
        real=real,
        cameras={"photo": view},
        render=RenderSettings(irradiance_samples=256),
        plate=Plate(empty.mean.astype(np.float32) * GAIN, "photo"),
    )
    frame = lightdepth.render(scene, camera="photo", samples=256)
    change, true_change = frame.beauty / GAIN - empty.mean, full.mean - empty.mean
    changed = (full.coverage == 0.0) & (np.abs(true_change).mean(axis=2) > 0.05 * empty.mean.mean(axis=2))
    np.testing.assert_allclose(change[changed].sum(axis=0), true_change[changed].sum(axis=0), rtol=0.02)
    assert np.abs(change - true_change)[changed].mean() < 0.02 * empty.mean[changed].mean()
