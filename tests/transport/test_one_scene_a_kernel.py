"""How a GPU has to trace, one scene in a kernel, tried on the CPU; and that nothing traces past it."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest

import lightdepth
from lightdepth.kernel.start import start
from lightdepth.scene.materials import Metal, MitsubaBsdf
from tests.transport.places import ball, room

SOURCES = Path(lightdepth.__file__).parent


def test_intersections_evaluated_one_by_one_give_the_same_pixels(monkeypatch: pytest.MonkeyPatch) -> None:
    start("cpu")
    from lightdepth.kernel import tracing

    lamp = np.full((16, 32, 3), 0.05, np.float32)
    lamp[3:7, 5:11] = 9.0
    leaf = MitsubaBsdf(type="mitsuba", mitsuba={"type": "mask", "opacity": 0.5, "bsdf": {"type": "diffuse"}})
    polished = Metal(type="metal", name="Ag", roughness=0.3)
    scene = room(lamp, [ball(polished), ball(leaf, (-0.2, 0.8, 0.9), 0.3)])
    together = lightdepth.render(scene, "view", 2, cache=False).beauty
    monkeypatch.setattr(tracing, "ONE_SCENE_A_KERNEL", True)
    assert tracing.loop_mode() == "evaluated"
    one_by_one = lightdepth.render(scene, "view", 2, cache=False).beauty
    np.testing.assert_array_equal(one_by_one, together)


def test_only_the_tracing_module_calls_mitsubas_ray_tracing() -> None:
    calls = re.compile(r"\.ray_(?:intersect|test)\w*\(")
    files = {file.relative_to(SOURCES).as_posix() for file in SOURCES.rglob("*.py") if calls.search(file.read_text())}
    assert files == {"kernel/tracing.py"}
