"""The renderer that stays for a whole animation, and for what is rendered afterwards."""

import numpy as np
import pytest

from lightdepth.images.exr import read_exr

FRAMES = 2


@pytest.fixture(scope="module")
def made(blender, tmp_path_factory):
    folder = tmp_path_factory.mktemp("animation")
    return folder, *(blender.run("animation", folder, kind, FRAMES) for kind in ("kept", "apart"))


def _channels(path):
    return {f"{part.name}.{name}": pixels for part in read_exr(path) for name, pixels in part.channels.items()}


def _assert_equal(path, expected):
    found, expected = _channels(path), _channels(expected)
    assert found.keys() == expected.keys()
    for name, pixels in expected.items():
        np.testing.assert_array_equal(found[name], pixels, err_msg=name)


def test_one_process_renders_the_pictures_of_several(made):
    folder, kept, apart = made
    assert len(kept["pids"]) == len(apart["pids"]) == FRAMES
    assert len(set(kept["pids"])) == 1
    assert len(set(apart["pids"])) == FRAMES
    assert len(kept["frames"]) == FRAMES
    for number in range(1, FRAMES + 1):
        _assert_equal(folder / f"kept{number:04}.exr", folder / f"apart{number:04}.exr")


def test_meshes_that_only_move_are_written_once(made):
    _, kept, _ = made
    first, second = kept["files"]
    assert {name.partition(".")[2] for name in first} == {"glb", "ply"}
    assert first == second  # the same files, by name and by their place on the disk


def test_a_process_that_was_killed_between_two_pictures_is_replaced(made):
    folder, kept, _ = made
    assert kept["after kill"] != kept["pids"][-1]
    assert kept["said"].count("started again") == 1
    _assert_equal(folder / "after kill.exr", folder / "kept0002.exr")


def test_another_version_is_told_apart_and_nothing_is_left(made):
    _, kept, _ = made
    assert "9.8.7" in kept["other version"]
    assert "same version" in kept["other version"]
    assert not kept["left"]
