"""The example of docs/sequences.md, in the room of the demo."""

import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

from lightdepth.checks import frames_problems
from lightdepth.kernel.start import start
from lightdepth.scene.frames import SceneFrames

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def frames():
    return SceneFrames(ROOT / "examples/lounge/scene.toml")


def test_the_page_shows_what_is_in_the_scene_file(frames):
    shown = tomllib.loads(re.search(r"```toml\n(.*?)```", (ROOT / "docs/sequences.md").read_text(), re.DOTALL)[1])
    scene = tomllib.loads(frames.path.read_text())
    assert shown == {"sequence": scene["sequence"], "camera": {"travel": scene["camera"]["travel"]}}


def test_the_camera_travels_and_looks_at_the_vase(frames):
    views = [frames.scene(number).cameras["travel"] for number in range(1, 49)]
    path = np.array([view.position for view in views])
    assert (np.diff(path[:, 0]) > 0.0).all()
    assert np.abs(np.diff(path, n=2, axis=0)).max() < 0.003  # It neither starts nor turns with a jolt.
    vase = np.array([-0.17, 1.10, 0.3])
    for view in views:
        x, y, z = (vase - view.position) @ view.rotation
        assert np.hypot(x, z) / y < 0.3


def test_nothing_is_wrong_with_it(frames):
    start("cpu")
    assert frames.table_problems() == ()
    assert frames_problems(frames) == []
