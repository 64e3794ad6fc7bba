"""Undo and redo, Escape, and a renderer that is killed: the pictures stay right and nothing is lost or left behind."""

from itertools import pairwise

import numpy as np
import pytest

from lightdepth.images.exr import read_exr

STAGES = ("exporting", "loading", "preparing", "progress", "writing")


@pytest.fixture(scope="module")
def made(blender, tmp_path_factory):
    folder = tmp_path_factory.mktemp("endurance")
    return folder, blender.run("endurance", folder)


def _picture(folder, name):
    (part,) = read_exr(folder / f"{name}.exr")
    return np.stack([part.channels[letter] for letter in "RGB"], axis=-1)


def test_pictures_are_those_of_the_step_that_is_undone_or_redone(made):
    folder, found = made
    steps = [_picture(folder, f"step {step}") for step in range(found["steps"] + 1)]
    for before, after in pairwise(steps):
        assert np.abs(before - after).max() > 0.05
    for step in range(found["steps"]):
        np.testing.assert_array_equal(_picture(folder, f"undone {step}"), steps[step])
        np.testing.assert_array_equal(_picture(folder, f"redone {step + 1}"), steps[step + 1])
    assert found["one process"]


def test_a_rendering_is_cancelled_in_every_stage(made):
    folder, found = made
    assert found["cancelled"] == {stage: [True, ""] for stage in STAGES}
    assert found["after cancelling"]  # the same process goes on
    np.testing.assert_array_equal(
        _picture(folder, "after being cancelled"), _picture(folder, f"redone {found['steps']}")
    )


def test_a_killed_renderer_is_told_in_every_stage_and_no_picture_is_written(made):
    folder, found = made
    happened, told = zip(*(found["killed"][stage] for stage in STAGES), strict=True)
    assert all(happened)
    # Killed while the scene is exported, it is started again and the picture is right.
    assert told[0] == ""
    assert found["said"].count("started again") == 1
    assert found["written"] == ["killed while exporting.exr"]
    for said in told[1:]:
        assert "SIGKILL" in said
    np.testing.assert_array_equal(_picture(folder, "after being killed"), _picture(folder, f"redone {found['steps']}"))


def test_nothing_is_lost_and_nothing_is_left(made):
    _, found = made
    assert found["data kept"]
    assert found["zombies"] == []
    assert found["children"] == 1  # the renderer that is kept
