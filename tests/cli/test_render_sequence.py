"""`lightdepth render --frames`: what is rendered, again, by whom, and how it ends."""

import json
import os
import shutil
import signal
import subprocess
import sys
from fractions import Fraction

import numpy as np
import OpenEXR
import pytest
from PIL import Image

from lightdepth.film.layers import read_frame
from lightdepth.images.exr import read_exr
from lightdepth.images.tonemapping import tone_map
from lightdepth.sequence.claims import take

from .room_folder import edit, make_room

PROGRAM = [sys.executable, "-c", "from lightdepth.cli.app import main; main()"]
LAST = 10
KEYS = f"{{{{ frame = [1, {LAST}], value = [{{}}, {{}}] }}}}"


def start(*arguments):
    return subprocess.Popen(
        [*PROGRAM, "render", *map(str, arguments)],
        env={**os.environ, "COLUMNS": "1000"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def render(*arguments):
    """Exit status, events, standard error."""
    process = start(*arguments, "--progress", "json")
    output, errors = process.communicate(timeout=500)
    assert "Traceback" not in errors
    return process.returncode, [json.loads(line) for line in output.splitlines()], errors


def states(events):
    return {event["frame"]: event["state"] for event in events if event["event"] == "frame"}


def pixels(path):
    parts = read_exr(path)
    return [(part.name, name, plane.tobytes()) for part in parts for name, plane in part.channels.items()]


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A camera travels past a ball that rolls."""
    scene = make_room(tmp_path_factory.mktemp("room"))
    edit(scene, "[panorama]", f"[sequence]\nframes = [1, {LAST}]\nfps = 23.976\n\n[panorama]")
    position = KEYS.format("[0, 0, 1.3]", "[0.6, -0.4, 1.3]")
    edit(scene, "height = 9", f"height = 9\nlook_at = [0.5, 1, 0.3]\nposition = {position}")
    edit(scene, "center = [0.5, 1.0, 0.3]", "center = " + KEYS.format("[0.5, 1.0, 0.3]", "[0.8, 1.0, 0.3]"))
    with scene.open("a") as file:
        file.write("\n[render]\nsamples = 4\nirradiance_samples = 16\n")
    return scene


@pytest.fixture(scope="module")
def shot(scene, tmp_path_factory):
    """The whole sequence by one process: its folder, and what was reported."""
    folder = tmp_path_factory.mktemp("shot")
    return folder, *render(scene, "--frames", f"1-{LAST}", "-o", folder / "shot.##.exr")


@pytest.fixture
def copied(shot, tmp_path):
    """A copy of the sequence to spoil."""
    shutil.copytree(shot[0], tmp_path, dirs_exist_ok=True)
    return tmp_path


def test_every_frame_is_there_and_says_what_it_is(shot):
    folder, status, events, errors = shot
    assert status == 0
    assert sorted(path.name for path in folder.iterdir()) == [
        f"shot.{n:02}.{kind}" for n in range(1, LAST + 1) for kind in ("exr", "png")
    ]
    assert states(events) == dict.fromkeys(range(1, LAST + 1), "rendered")
    assert [event["event"] for event in (events[0], events[-1])] == ["hello", "done"]
    assert [event["event"] for event in events].count("done") == 1
    progress = [event for event in events if event["event"] == "sequence"]
    assert [event["fraction"] for event in progress] == sorted(event["fraction"] for event in progress)
    assert (progress[-1]["done"], progress[-1]["fraction"], progress[-1]["seconds_left"]) == (LAST, 1.0, 0.0)
    frames = [read_frame(folder / f"shot.{n:02}.exr") for n in range(1, LAST + 1)]
    assert [frame.metadata["frame"] for frame in frames] == [str(n) for n in range(1, LAST + 1)]
    assert len({frame.metadata["fingerprint"] for frame in frames}) == LAST
    assert len({frame.metadata["seed"] for frame in frames}) == LAST
    assert len({frame.coverage.tobytes() for frame in frames}) == LAST
    with OpenEXR.File(str(folder / "shot.03.exr")) as file:
        assert Fraction(*map(int, str(file.header()["framesPerSecond"]).split("/"))) == Fraction(24000, 1001)


def test_a_moving_camera_has_one_exposure(shot):
    """Every PNG shows its frame at the exposure of the panorama, whatever the frame holds."""
    folder, *_ = shot
    frames = [read_frame(folder / f"shot.{n:02}.exr") for n in range(1, LAST + 1)]
    (exposure,) = {frame.metadata["exposure"] for frame in frames}
    assert len({float(frame.beauty.mean()) for frame in frames}) == LAST
    for n, frame in enumerate(frames, 1):
        shown = np.asarray(Image.open(folder / f"shot.{n:02}.png").convert("RGB")).astype(int)
        assert np.abs(shown - tone_map(frame.beauty, float(exposure))).max() <= 1


def test_a_frame_alone_is_that_of_the_sequence(scene, shot, tmp_path):
    status, *_ = render(scene, "--frames", "5", "-o", tmp_path / "shot.##.exr")
    assert status == 0
    assert pixels(tmp_path / "shot.05.exr") == pixels(shot[0] / "shot.05.exr")


def test_a_second_call_renders_what_is_missing_and_what_is_not_whole(scene, shot, copied):
    (copied / "shot.02.exr").unlink()
    whole = (copied / "shot.04.exr").read_bytes()
    (copied / "shot.04.exr").write_bytes(whole[: len(whole) * 9 // 10])
    (copied / "shot.06.exr").write_bytes(b"no picture")
    # Of a process that was killed between a frame and the end of its claim.
    take(copied / "shot.03.claim")
    facts = json.loads((copied / "shot.03.claim").read_text())
    (copied / "shot.03.claim").write_text(json.dumps({**facts, "began": "1"}))
    before = {path: path.stat().st_mtime_ns for path in copied.glob("*.exr")}
    pattern = copied / "shot.##.exr"
    expected = dict.fromkeys(range(1, LAST + 1), "current") | {2: "missing", 4: "damaged", 6: "damaged"}
    status, events, _ = render(scene, "--frames", f"1-{LAST}", "-o", pattern, "--verify")
    assert (status, states(events)) == (1, expected)
    assert {path: path.stat().st_mtime_ns for path in copied.glob("*.exr")} == before
    status, events, _ = render(scene, "--frames", f"1-{LAST}", "-o", pattern)
    assert status == 0
    assert states(events) == {n: "rendered" if n in (2, 4, 6) else "current" for n in range(1, LAST + 1)}
    assert list(copied.glob("*.claim")) == []
    for number in range(1, LAST + 1):
        assert pixels(copied / f"shot.{number:02}.exr") == pixels(shot[0] / f"shot.{number:02}.exr")


def test_only_frames_of_another_scene_are_rendered_again(scene, copied):
    """The last key of the ball moves: the first frame is as it was. Another number of samples changes all."""
    text = scene.read_text()
    try:
        edit(scene, "[0.8, 1.0, 0.3]", "[0.9, 1.0, 0.3]")
        options = ("--frames", "1-7", "--step", 3, "-o", copied / "shot.##.exr")
        _, events, _ = render(scene, *options, "--verify")
        assert states(events) == {1: "current", 4: "outdated", 7: "outdated"}
        _, events, _ = render(scene, *options, "--samples", 5, "--verify")
        assert set(states(events).values()) == {"outdated"}
        _, events, _ = render(scene, *options)
        assert states(events) == {1: "current", 4: "rendered", 7: "rendered"}
        _, events, _ = render(scene, *options, "--force")
        assert set(states(events).values()) == {"rendered"}
    finally:
        scene.write_text(text)


def test_where_the_scene_lies_does_not_matter(scene, shot, tmp_path):
    """Another machine may have the shared folder elsewhere."""
    shutil.copytree(scene.parent, tmp_path / "elsewhere")
    moved = tmp_path / "elsewhere" / "scene.toml"
    status, events, _ = render(moved, "--frames", f"1-{LAST}", "-o", shot[0] / "shot.##.exr", "--repair", "--verify")
    assert (status, set(states(events).values())) == (0, {"current"})


def test_three_processes_share_a_sequence_and_one_is_killed(scene, shot, tmp_path):
    """Whoever is killed in the middle of a frame, all are delivered, and are those of one process bit for bit."""
    options = (scene, "--frames", f"1-{LAST}", "-o", tmp_path / "shot.##.exr", "--progress", "json")
    victim = start(*options)
    for line in victim.stdout:  # It is stopped in a frame, before it could render all.
        if json.loads(line)["event"] == "stage":
            victim.send_signal(signal.SIGSTOP)
            break
    others = [start(*options) for _ in range(2)]
    events = {process: [] for process in others}
    for line in others[0].stdout:
        events[others[0]].append(json.loads(line))
        if events[others[0]][-1]["event"] == "done" or "rendered" in states(events[others[0]]).values():
            victim.kill()
            break
    victim.communicate()
    assert victim.returncode == -signal.SIGKILL
    rendered = []
    for process in others:
        output, errors = process.communicate(timeout=500)
        assert (process.returncode, "Traceback" in errors) == (0, False)
        events[process] += [json.loads(line) for line in output.splitlines()]
        rendered += [number for number, state in states(events[process]).items() if state == "rendered"]
        assert events[process][-1] == {**events[process][-1], "event": "done", "interrupted": False}
    assert len(set(rendered)) == len(rendered) >= LAST - 3  # Of so many, the victim may have got through two.
    assert not list(tmp_path.glob("*.claim"))
    for number in range(1, LAST + 1):
        assert pixels(tmp_path / f"shot.{number:02}.exr") == pixels(shot[0] / f"shot.{number:02}.exr")


def until_progress(process, events):
    """Take the events up to the next of progress."""
    for line in process.stdout:
        events.append(json.loads(line))
        if events[-1]["event"] == "progress":
            return


@pytest.mark.parametrize("signals", [["SIGINT"], ["SIGINT", "SIGINT"], ["SIGTERM"]], ids=str)
def test_ctrl_c_finishes_the_frame_and_the_second_one_drops_it(scene, tmp_path, signals):
    # One to be dropped must not be finished before the second signal comes, and the last one not before the first signal.
    samples = 10_000 if signals == ["SIGINT"] else 100_000_000
    options = (scene, "--frames", f"1-{LAST}", "-o", tmp_path / "shot.##.exr", "--samples", samples)
    process = start(*options, "--progress", "json")
    events = []
    for name in signals:
        # Twice, for the first may have been on its way: the signal before has been noted then.
        until_progress(process, events)
        until_progress(process, events)
        process.send_signal(signal.Signals[name])
    output, errors = process.communicate(timeout=300)
    assert process.returncode == 130, errors
    assert "Traceback" not in errors
    events += [json.loads(line) for line in output.splitlines()]
    assert events[-1]["interrupted"]
    assert f"the same command continues: lightdepth render {scene} --frames 1-{LAST}" in errors
    rendered = [number for number, state in states(events).items() if state == "rendered"]
    assert bool(rendered) == (signals == ["SIGINT"])
    files = {f"shot.{number:02}.{suffix}" for number in rendered for suffix in ("exr", "png")}
    assert {path.name for path in tmp_path.iterdir()} == files


def test_without_frames_the_first_one_is_rendered(scene, shot, command, tmp_path):
    status, *_ = command("render", scene, "-o", tmp_path / "x.exr", "--progress", "none")
    assert status == 0
    depth = read_frame(tmp_path / "x.exr").depth.tobytes()
    assert depth == read_frame(shot[0] / "shot.01.exr").depth.tobytes()
    assert depth != read_frame(shot[0] / "shot.02.exr").depth.tobytes()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--frames", "1-12"], "--frames 1-12: 12 is outside the [sequence], which has frames 1 to 10"),
        (["--frames", "5-2"], "5 comes after 2"),
        (["--frames", "one"], "write it as 1-240, or 7, or 1-10,20-30"),
        (["--frames", "1-2", "-o", "shot.exr"], "the name must have # for each digit"),
        (["--frames", "1-2", "-o", "shot.##.#.exr"], "in one place"),
        (["--frames", "1-2", "-o", "shot.##.png"], "frames are .exr files"),
        (["--frames", "1-2", "--share", "1/2", "--resume"], "--share, --resume: only for a still, not with --frames"),
        (["--verify"], "--force, --verify, --step and --steady go with --frames"),
        (["--steady", "4"], "--force, --verify, --step and --steady go with --frames"),
        (["--frames", "1-2", "--steady", "2", "--draft"], "--steady: not with --draft"),
        (["-o", "shot.##.exr"], "numbered files are for a sequence; give --frames"),
        (["--frames", "1-2", "--camera", "veiw"], "no camera 'veiw'; did you mean 'view'? allowed: view"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_wrong_arguments(scene, command, tmp_path, monkeypatch, arguments, message):
    monkeypatch.chdir(tmp_path)
    status, output, errors = command("render", scene, *arguments)
    assert status == 2
    assert message in errors
    assert "Traceback" not in output + errors
    assert list(tmp_path.iterdir()) == []


def test_what_would_stop_a_later_frame_is_found_before_the_first(command, tmp_path):
    scene = make_room(tmp_path)
    edit(scene, "[panorama]", "[sequence]\nframes = [1, 9]\n\n[panorama]")
    edit(scene, "center = [0.5, 1.0, 0.3]", "center = { frame = [1, 9], value = [[0.5, 1, 0.3], [9, 1, 0.3]] }")
    before = sorted(tmp_path.iterdir())
    status, _, errors = command("render", scene, "--frames", "1-9", "-o", tmp_path / "x.#.exr")
    assert status == 2
    assert '"ball": is outside the room' in errors
    assert "frames 3 to 9" in errors
    assert sorted(tmp_path.iterdir()) == before
