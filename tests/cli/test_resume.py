"""Renderings that are killed and go on, and stills that several processes share."""

import os
import random
import subprocess
import sys
import time

import numpy as np
import pytest

from lightdepth.film.layers import read_frame

from .room_folder import edit, make_room

PROGRAM = [sys.executable, "-c", "from lightdepth.cli.app import main; main()"]
KILLS = 4
SMALL_PASSES = """
[render.parameters.film]
paths_at_once = 4096
light_list_paths = 32768
light_paths_at_once = 2048
"""
"""Small passes, of which a small picture then has many."""


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    scene = make_room(tmp_path_factory.mktemp("room"))
    edit(scene, "width = 16\nheight = 9", "width = 64\nheight = 36\nposition = [0, 0, 1.3]\nlook_at = [0.5, 1, 0.3]")
    with scene.open("a") as file:
        file.write("\n[render]\nsamples = 128\nirradiance_samples = 16\n" + SMALL_PASSES)
    return scene


def begin(*arguments):
    environment = {**os.environ, "COLUMNS": "1000"}
    return subprocess.Popen(
        [*PROGRAM, *map(str, arguments)],
        env=environment,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def run(*arguments):
    process = begin(*arguments)
    output, errors = process.communicate(timeout=500)
    assert "Traceback" not in errors
    return process.returncode, output, errors


@pytest.fixture(scope="module")
def uninterrupted(scene, tmp_path_factory):
    target = tmp_path_factory.mktemp("whole") / "x.exr"
    status, *_ = run("render", scene, "-o", target, "--progress", "none")
    assert status == 0
    return read_frame(target)


def test_killed_at_random_moments_nothing_is_lost(scene, uninterrupted, tmp_path):
    """After every pass there is a checkpoint; each life of the process must get further than the one before."""
    target, checkpoint = tmp_path / "x.exr", tmp_path / "x.checkpoint"
    arguments = ("render", scene, "-o", target, "--progress", "json", "--resume", "--checkpoint-seconds", "0")
    choose = random.Random(5)
    fractions = []
    for _ in range(KILLS):
        process = begin(*arguments)
        for line in process.stdout:
            if '"event": "progress"' in line:
                fractions.append(float(line.split('"fraction": ')[1].split(",")[0]))
                time.sleep(choose.uniform(0.0, 0.02))  # A pass or two, so that these lives are not enough to finish.
                process.kill()
                break
        process.communicate()
        if process.returncode == 0:  # Where the kill came too late, the next life would begin the picture again.
            break
    assert fractions
    assert fractions == sorted(fractions)
    status, *_ = run(*arguments)
    assert status == 0
    frame = read_frame(target)
    for layer in ("change", "synthetic", "coverage", "variance", "samples"):
        assert getattr(frame, layer).tobytes() == getattr(uninterrupted, layer).tobytes()
    assert not checkpoint.exists()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["x.exr", "x.png"]


def test_shares_of_several_processes_merge_to_the_picture_of_one(scene, uninterrupted, tmp_path, command):
    parts = [tmp_path / f"{index}.sums" for index in (1, 2)]
    for index, part in enumerate(parts, 1):
        status, _, errors = run("render", scene, "--share", f"{index}/2", "-o", part, "--progress", "none")
        assert status == 0
        assert f"wrote {part}" in errors
    status, _, errors = command("merge", parts[0], "-o", tmp_path / "x.exr")
    assert status == 2
    assert "the picture is not complete; missing: 2/2" in errors
    status, _, errors = command("merge", *parts, parts[0], "-o", tmp_path / "x.exr")
    assert status == 2
    assert "holds share 1/2, which is in" in errors
    status, _, errors = command("merge", *reversed(parts), "-o", tmp_path / "x.exr")
    assert status == 0, errors
    frame = read_frame(tmp_path / "x.exr")
    np.testing.assert_allclose(frame.beauty, uninterrupted.beauty, rtol=1e-6)
    assert frame.samples.tobytes() == uninterrupted.samples.tobytes()
    assert frame.depth.tobytes() == uninterrupted.depth.tobytes()
    assert {path.suffix for path in tmp_path.iterdir()} == {".exr", ".png", ".sums"}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--share", "3/2", "-o", "x.sums"], "the first number must be from 1 to the second"),
        (["--share", "two", "-o", "x.sums"], "write it as 2/4"),
        (["--share", "1/2", "-o", "x.exr"], "the output is an .sums file"),
        (["--share", "1/2", "-o", "x.sums", "--noise", "0.1"], "depend on all shares"),
        (["--region", "1,2,3", "-o", "x.exr"], "write it as left,top,right,bottom"),
        (["--region", "5,2,3,9", "-o", "x.exr"], "region = (5, 2, 3, 9)"),
    ],
)
def test_wrong_arguments(scene, tmp_path, monkeypatch, command, arguments, message):
    monkeypatch.chdir(tmp_path)
    status, _, errors = command("render", scene, *arguments)
    assert status == 2
    assert message in errors
    assert list(tmp_path.iterdir()) == []
