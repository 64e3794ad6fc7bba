"""Cycles as a referee: the same scene in the same light looks the same, or a note names what is missing."""

import math

import numpy as np
import pytest

import lightdepth
from lightdepth.film.frame import Frame
from lightdepth.images.radiance import read_radiance
from lightdepth.scene.frames import SceneFrames
from lightdepth.sequence.shutter import Shutter
from lightdepth.session.displays import MemoryDisplay
from lightdepth.session.session import Job

BLOCK = 4
SAMPLES = 64
MODELS = 0.02
"""Of the scene's mean radiance: what the two renderers' reflection models and texture filters may differ by."""
ORDINARY = ["clipped_image", "far_from_the_origin"]
"""Scenes that the ordinary run looks at; the others are for ``pytest -m truth``."""


def _blocks(pixels: np.ndarray) -> np.ndarray:
    """Means of blocks of pixels; what is left over at the right and lower edge is left out."""
    height, width = (size // BLOCK * BLOCK for size in pixels.shape[:2])
    blocks = pixels[:height, :width].reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK, 3)
    return blocks.mean(axis=(1, 3))


def compare(folder, name: str) -> tuple[float, float]:
    """Root mean square difference of blocks, and how much of it is noise, as shares of the mean radiance."""
    frame = _rendered(folder / f"{name}.toml")
    seeds = [read_radiance(folder / f"{name}.{seed}.exr") for seed in (0, 1)]
    truth = 0.5 * (seeds[0] + seeds[1])
    assert frame.beauty.shape == truth.shape
    # The seeds' mean has a quarter of the variance of their difference.
    noise = 0.25 * np.mean(_blocks(seeds[0] - seeds[1]) ** 2) + np.mean(_blocks(frame.variance)) / BLOCK**2
    difference = np.mean(_blocks(frame.beauty - truth) ** 2)
    return math.sqrt(difference) / truth.mean(), math.sqrt(noise) / truth.mean()


def _rendered(path) -> Frame:
    """The scene's picture, of the middle frame of a sequence with its motion blur."""
    frames, job = SceneFrames(path), Job(camera="Camera", samples=SAMPLES)
    if frames.text.sequence is None:
        return lightdepth.render(lightdepth.load_scene(path), camera="Camera", samples=SAMPLES)
    number, shown = frames.sequence.first + 1, MemoryDisplay(layers=["variance"])
    shutter = Shutter(frames.sequence, job, "cpu", lambda _, instant: frames.scene(instant))
    shutter.blurred(number, frames.scene(number), job).render([shown], "cpu", lambda event: None)
    return shown.frame


def _judge(blender, folder, names: list[str]) -> None:
    found = blender.run("referee", folder, *names)["scenes"]
    wrong = []
    for name, scene in found.items():
        if scene["failed"]:
            wrong.append(f"{name}: {scene['failed']}")
            continue
        difference, noise = compare(folder, name)
        print(f"{name:28} difference {difference:7.2%}, noise {noise:7.2%}  {'; '.join(scene['notes'])}")
        if scene["missing"] is not None:
            if not any(scene["missing"] in note for note in scene["notes"]):
                wrong.append(f"{name}: no note on '{scene['missing']}': {scene['notes']}")
        elif difference > MODELS + 2.0 * noise:
            wrong.append(f"{name}: {difference:.2%} off, noise {noise:.2%}")
    assert not wrong, "\n".join(wrong)


def test_a_few_scenes_are_as_cycles_shows_them(blender, tmp_path):
    _judge(blender, tmp_path, ORDINARY)


def test_a_moving_ball_is_blurred_as_in_cycles(blender, tmp_path):
    _judge(blender, tmp_path, ["moving_ball"])


@pytest.mark.truth
def test_every_scene_is_as_cycles_shows_it_or_told(blender, tmp_path):
    _judge(blender, tmp_path, [])
