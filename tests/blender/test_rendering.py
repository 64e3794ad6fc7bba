"""F12 through the real renderer, and what happens when it is stopped, missing or mad."""

import os
import signal
import subprocess
import time

import numpy as np
import pytest

from lightdepth.images.exr import read_exr

PASSES = {
    "Combined": "beauty",
    "Plate": "plate",
    "Change": "change",
    "Synthetic": "synthetic",
    "Coverage": "alpha",
    "Object ID": "object_id",
    "Depth": "depth",
    "Normal": "normal",
    "Albedo": "albedo",
    "Variance": "variance",
}


def test_f12_gives_the_pixels_of_the_command_line(blender, renderer, tmp_path):
    found = blender.run("render", tmp_path)
    assert len(found["frames"]) == 2
    frames = []
    for name in found["frames"]:
        channels = {}
        for part in read_exr(tmp_path / name):
            channels |= {channel.removeprefix("ViewLayer."): pixels for channel, pixels in part.channels.items()}
        frames.append(channels)
    output = tmp_path / "command-line.exr"
    subprocess.run(
        [renderer, "render", tmp_path / "scene.toml", "--camera", "Camera", "-o", output, "--progress", "none"],
        check=True,
    )
    for part in read_exr(output):
        names = [name for name, counterpart in PASSES.items() if counterpart == part.name]
        for name in names:
            for channel, pixels in part.channels.items():
                key = f"{name}.{channel if f'{name}.{channel}' in frames[0] else 'X'}"
                np.testing.assert_array_equal(frames[0][key], pixels.astype(np.float32), err_msg=key)
    assert {key.split(".")[0] for key in frames[0]} == set(PASSES)
    assert not np.array_equal(frames[0]["Combined.R"], frames[1]["Combined.R"])
    assert not np.array_equal(frames[0]["Coverage.Y"], frames[1]["Coverage.Y"])  # the ball rolls

    assert found["coverage"] == pytest.approx(1.0)
    assert "the lamp is broken" in found["crashing"]
    assert "SIGKILL" in found["killed"]
    assert "odd number" in found["traceback"]
    assert "I am a web browser" in found["garbage"]
    assert "without a picture" in found["silent"]
    for name in ("missing", "missing for the test"):
        assert "not there" in found[name]
        assert "preferences" in found[name]
    assert "garbage.txt" in found["no program"]
    assert "region" in found["region"]


def _renderers(blender_process: int) -> list[int]:
    """Processes that a Blender process started."""
    listed = subprocess.run(
        ["ps", "-o", "pid=", "--ppid", str(blender_process)], capture_output=True, text=True, check=False
    )
    return [int(pid) for pid in listed.stdout.split()]


def _is_running(pid: int) -> bool:
    try:
        with open(f"/proc/{pid}/stat") as status:
            return status.read().rsplit(")", 1)[1].split()[0] != "Z"
    except FileNotFoundError:
        return False


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL], ids=["interrupted", "killed"])
def test_no_renderer_is_left_behind(blender, tmp_path, number):
    with subprocess.Popen(
        blender.command("endless", tmp_path),
        env=blender.environment,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    ) as process:
        try:
            deadline = time.monotonic() + 120
            while not (renderers := _renderers(process.pid)) and time.monotonic() < deadline:
                time.sleep(0.2)
            assert renderers
            os.kill(process.pid, number)
            process.wait(timeout=30)
        finally:
            process.kill()
    deadline = time.monotonic() + 240  # a renderer whose Blender was killed ends when it next tells its progress
    while any(map(_is_running, renderers)) and time.monotonic() < deadline:
        time.sleep(0.5)
    assert not any(map(_is_running, renderers))
