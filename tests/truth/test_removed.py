"""A box photographed in a path-traced room with patterns, and removed: what is around it against the room without."""

import numpy as np
import pytest
from bench.places.objects import Matte, block

from lightdepth.api import render
from lightdepth.directions import euler_rotation, pixel_directions
from lightdepth.scene.model import Panorama, RealSurface, RenderSettings, Role, Scene
from tests.support import textured_room as room

pytestmark = pytest.mark.truth
WIDTH, HALF, PLACE, TURN = 384, 0.2, (1.2, 1.6), 25.0
SUPPORT = ("floor", "rug", "front", "back", "left", "right", "ceiling")


@pytest.mark.parametrize("albedo", [0.15, 0.7])
def test_shadow_and_light_of_a_box_go(albedo):
    box = block("box", PLACE, (2.0 * HALF, 2.0 * HALF, 0.8), Matte(color=(albedo,) * 3), TURN)
    view = room.panorama_view(WIDTH)
    photograph, empty = room.trace(view, 96, [box], seed=2), room.trace(view, 192, seed=3)
    standing = RealSurface("box", box.parts[0].geometry, Role.ENVIRONMENT, removed=True)
    panorama = Panorama(photograph.mean.astype(np.float32), room.CAPTURE, euler_rotation(room.ROTATION))
    settings = RenderSettings(irradiance_samples=512)
    scene = Scene(panorama, (*room.true_surfaces(SUPPORT), standing), (), {"pano": view}, settings)
    frame = render(scene, "pano", samples=32)
    before, after, truth = (each.mean(axis=-1) for each in (photograph.mean, frame.beauty, empty.mean))
    directions = pixel_directions(WIDTH // 2, WIDTH) @ euler_rotation(room.ROTATION).T
    points = room.CAPTURE + directions * frame.depth[..., None]
    turned = (points - (*PLACE, 0.0)) @ euler_rotation((0.0, 0.0, TURN))
    distance = np.hypot(*np.moveaxis(np.maximum(np.abs(turned[..., :2]) - HALF, 0.0), -1, 0))
    floor = (np.abs(points[..., 2]) < 0.01) & (frame.coverage == 0.0)
    for nearest, farthest in ((0.1, 0.3), (0.3, 0.6), (0.6, 1.2)):
        ring = floor & (distance > nearest) & (distance <= farthest)
        total = truth[ring].sum()
        noise = np.sqrt((photograph.variance + empty.variance).mean(axis=-1)[ring].sum()) / total
        print(
            f"{nearest} to {farthest} m: {before[ring].sum() / total - 1:+.4f} -> {after[ring].sum() / total - 1:+.4f}"
        )
        assert after[ring].sum() / total == pytest.approx(1.0, abs=0.006 + 2.0 * noise)
    assert before[ring].sum() < 0.998 * total or albedo > 0.5
    # What nobody saw has the mean colour of what is seen near by.
    hidden = frame.coverage > 0.0
    assert after[hidden].sum() / truth[hidden].sum() == pytest.approx(1.0, abs=0.1)
