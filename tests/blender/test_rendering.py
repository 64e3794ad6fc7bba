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
    "Shadow": "shadow",
    "Synthetic": "synthetic",
    "Coverage": "coverage",
    "Object ID": "object_id",
    "Depth": "depth",
    "Normal": "normal",
    "Albedo": "albedo",
    "Variance": "variance",
}


@pytest.fixture(scope="module")
def animated(blender, tmp_path_factory):
    """What the script answered, its folder, and the channels of both frames of Ctrl-F12."""
    folder = tmp_path_factory.mktemp("render")
    found = blender.run("render", folder)
    assert len(found["frames"]) == 2
    frames = []
    for name in found["frames"]:
        channels = {}
        for part in read_exr(folder / name):
            channels |= {channel.removeprefix("ViewLayer."): pixels for channel, pixels in part.channels.items()}
        frames.append(channels)
    return found, folder, frames


@pytest.mark.parametrize("frame", [1, 2])
def test_frames_have_the_pixels_of_the_command_line(animated, command, tmp_path, frame):
    _, folder, frames = animated
    rendered, output = frames[frame - 1], tmp_path / "command-line.exr"
    status, _, errors = command("render", folder / f"scene{frame}.toml", "--camera", "Camera", "-o", output)
    assert status == 0, errors
    for part in read_exr(output):
        names = [name for name, counterpart in PASSES.items() if counterpart == part.name]
        for name in names:
            for channel, pixels in part.channels.items():
                if channel.startswith("Crypto"):  # Mattes are not among Blender's passes.
                    continue
                channel = channel.rpartition(".")[2]
                key = f"{name}.{channel if f'{name}.{channel}' in rendered else 'X'}"
                np.testing.assert_array_equal(rendered[key], pixels.astype(np.float32), err_msg=key)
    assert {key.split(".")[0] for key in rendered} == set(PASSES)


def test_motion_and_materials_are_animated(animated):
    _, _, (first, second) = animated
    assert not np.array_equal(first["Coverage.Y"], second["Coverage.Y"])  # the ball rolls
    for frame, expected in ((first, (0.8, 0.2, 0.1)), (second, (0.1, 0.2, 0.8))):
        albedo = np.stack([frame[f"Albedo.{channel}"] for channel in "RGB"], axis=-1)
        ball = albedo[(frame["Coverage.Y"] == 1.0) & (albedo.max(axis=-1) > 0.5)]
        assert len(ball) > 20
        assert np.median(ball, axis=0) == pytest.approx(expected, abs=0.02)
    brightest = [np.sort(frame["Synthetic.G"], axis=None)[-5] for frame in (first, second)]
    assert brightest[1] / brightest[0] == pytest.approx(3.0, rel=0.1)


def test_a_renderer_that_fails_is_told_in_its_own_words(animated):
    found = animated[0]
    assert found["coverage"] == pytest.approx(1.0)
    assert found["notes"] == ["Material 'Plane': sheen ('Sheen Weight') is not supported"]
    assert "the lamp is broken" in found["crashing"]
    assert "SIGKILL" in found["killed"]
    assert "odd number" in found["traceback"]
    assert "I am a web browser" in found["garbage"]
    assert "exited with status" in found["silent"]
    for name in ("missing", "missing for the test"):
        assert "not there" in found[name]
        assert "preferences" in found[name]
    assert "garbage.txt" in found["no program"]
    for said in found["stranger"]:
        assert "I am a calculator" in said
    assert len(found["hanging"]) == 3
    for said in found["hanging"]:
        assert "did not answer for 1 seconds" in said
    assert any("did not answer" in line for line in found["hanging told"])
    assert found["left hanging"] == []
    assert any("trial" in line for line in found["doctor"])


def _processes(**wanted: int) -> list[int]:
    """Running processes with a given parent or group: ``ppid`` or ``pgid``."""
    listed = subprocess.run(
        ["ps", "-e", "-o", "pid=", *(f"-o{name}=" for name in wanted), "-o", "stat="],
        capture_output=True,
        text=True,
        check=True,
    )
    rows = [line.split() for line in listed.stdout.splitlines()]
    return [int(pid) for pid, *found, state in rows if [*map(int, found)] == [*wanted.values()] and state[0] != "Z"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGKILL], ids=["interrupted", "killed"])
def test_no_renderer_is_left_behind(blender, tmp_path, number):
    with subprocess.Popen(
        blender.command("endless", tmp_path),
        env=blender.environment | {"TMPDIR": str(tmp_path)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        # What a shell starts in the background ignores interrupts, and so would Blender.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    ) as process:
        try:
            deadline = time.monotonic() + 300
            while not list(tmp_path.glob("*/picture.exr")) and time.monotonic() < deadline:
                time.sleep(0.1)  # until it is in the middle of its work
            renderers = _processes(ppid=process.pid)
            assert len(renderers) == 1
            os.kill(process.pid, number)
            process.wait(timeout=120)
        finally:
            process.kill()
    deadline = time.monotonic() + 60  # Only a busy machine needs more than moments.
    while (left := _processes(pgid=renderers[0])) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert not left
