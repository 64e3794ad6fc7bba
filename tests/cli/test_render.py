"""`lightdepth render` as a person or a program runs it: what it writes, what it says, how it ends."""

import json
import os
import resource
import signal
import subprocess
import sys
import threading
from importlib.metadata import version
from importlib.util import find_spec

import numpy as np
import pytest
from PIL import Image

from lightdepth.cli.render import Reporter
from lightdepth.film.layers import read_frame
from lightdepth.images.exr import ExrPart, read_exr, write_exr
from lightdepth.images.ocio import OcioView
from lightdepth.images.tonemapping import AVERAGE_LUMINANCE
from lightdepth.session.events import Done
from tests.support.picture_file import undocumented

from .room_folder import edit, make_room
from .test_bad_input import MEANINGLESS

PROGRAM = [sys.executable, "-c", "from lightdepth.cli.app import main; main()"]


def start_render(scene, *arguments, **options):
    return subprocess.Popen(
        [*PROGRAM, "render", str(scene), *map(str, arguments)],
        env={**os.environ, "COLUMNS": "1000"},
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **options,
    )


def render(scene, *arguments, **options):
    """Exit status, events, standard error."""
    process = start_render(scene, *arguments, **options)
    output, errors = process.communicate(timeout=500)
    return process.returncode, [json.loads(line) for line in output.splitlines()], errors


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A room with clipped lamps (a warning) in a spoilt panorama, which only `--repair` renders."""
    folder = tmp_path_factory.mktemp("room")
    scene = make_room(folder)
    radiance = np.full((16, 32), 0.5, np.float32)
    radiance[4:8, 7:11], radiance[3, 5] = 20.0, np.nan
    write_exr(folder / "room.exr", [ExrPart(dict.fromkeys("RGB", radiance))])
    edit(scene, "width = 16\nheight = 9", "width = 64\nheight = 36\nposition = [0, 0, 1.3]\nlook_at = [0.5, 1, 0.3]")
    with scene.open("a") as file:
        file.write("\n[render]\nsamples = 16\nirradiance_samples = 16\nclamp_indirect = 5.0\n")
    return scene


@pytest.fixture(scope="module")
def first(scene, tmp_path_factory):
    target = tmp_path_factory.mktemp("first") / "made" / "picture.exr"
    options = ("--seed", 3, "--repair", "--progress", "json", "--preview-seconds", 0.1, "--samples", 100)
    return target, *render(scene, "-o", target, *options)


def test_a_program_is_informed_of_progress(first):
    target, status, events, _ = first
    assert status == 0
    kinds = [event["event"] for event in events]
    pid = events[0].pop("pid")
    assert pid > 0
    assert events[0] == {"event": "hello", "version": version("lightdepth"), "schema": 1}
    assert [event["stage"] for event in events if event["event"] == "stage"] == ["preparing", "rendering", "writing"]
    assert events[1] == {"event": "stage", "stage": "preparing"}
    assert kinds[-1] == "done"
    prepared = [event["fraction"] for event in events if event["event"] == "preparing"]
    assert len(prepared) > 1
    assert prepared == sorted(prepared)
    assert 0.0 < prepared[0] <= prepared[-1] <= 1.0
    assert set(kinds) <= {"hello", "stage", "preparing", "warning", "progress", "picture", "done"}
    pictures = [event for event in events if event["event"] == "picture"]
    assert len(pictures) > 1
    assert [event["finished"] for event in pictures] == [False] * (len(pictures) - 1) + [True]
    assert {event["file"] for event in pictures} == {str(target)}
    assert 0.0 < events[-1]["error"] < 0.5
    assert events[-1]["exposure"] == pytest.approx(np.log2(AVERAGE_LUMINANCE / 0.5), abs=0.01)
    progress = [event for event in events if event["event"] == "progress"]
    assert [event["fraction"] for event in progress] == sorted(event["fraction"] for event in progress)
    assert progress[-1]["fraction"] == 1.0
    assert progress[-1]["seconds_left"] == 0.0
    assert progress[-1]["samples"] == pytest.approx(100, rel=0.05)
    assert 0.0 < progress[-1]["error"] < progress[0]["error"]
    assert events[-1]["file"] == str(target)


def test_warnings_and_repairs_are_reported_once(first):
    *_, errors = first
    assert errors.count("lights that were clipped") == 1
    assert errors.count("1 pixel has NaN radiance") == 1
    assert "row 3, column 5" in errors
    assert "Traceback" not in errors


def test_the_file_has_all_layers_and_says_how_it_was_made(first):
    target, *_ = first
    frame = read_frame(target)
    assert frame.object_names == ("ball",)
    for layer in ("object_id", "depth", "normal", "albedo", "variance", "samples"):
        assert getattr(frame, layer) is not None
    assert np.isfinite(frame.beauty).all()
    assert frame.metadata["method"] == "difference"
    assert frame.metadata["seed"] == "3"
    assert float(frame.metadata["samples"]) == pytest.approx(100, rel=0.05)
    assert float(frame.metadata["clamp_indirect"]) == 5.0
    assert float(frame.metadata["error"]) > 0.0
    # But for few clipped pixels, the panorama's radiance is 0.5.
    assert float(frame.metadata["exposure"]) == pytest.approx(np.log2(AVERAGE_LUMINANCE / 0.5), abs=0.01)
    assert float(frame.metadata["irradiance_error"]) >= 0.0
    assert undocumented(target) == set()
    assert sorted(path.name for path in target.parent.iterdir()) == ["picture.exr", "picture.png"]


def test_a_draft_is_one_sample_of_the_same_picture(first, scene, tmp_path):
    full = read_frame(first[0])
    options = ["--draft", "--exr", "single"]
    if colour := find_spec("PyOpenColorIO") is not None:
        options += ["--ocio", "ocio://default", "--exposure", 1]
    status, _, errors = render(scene, "-o", tmp_path / "draft.exr", "--repair", "--progress", "none", *options)
    assert (status, "Traceback" in errors) == (0, False)
    (beauty,) = read_exr(tmp_path / "draft.exr", interleaved=True)
    assert float(beauty.header["lightdepth:samples"]) == 1.0
    picture = beauty.channels["RGBA"][..., :3]
    untouched = (full.change == 0).all(axis=-1) & (full.coverage == 0)
    np.testing.assert_array_equal(picture[untouched], full.plate[untouched])
    assert picture.mean() == pytest.approx(full.beauty.mean(), rel=0.1)
    if colour:
        with Image.open(tmp_path / "draft.png") as image:
            shown = OcioView("ocio://default")(picture, float(beauty.header["lightdepth:exposure"]) + 1.0)
            np.testing.assert_allclose(np.asarray(image) / 255.0, shown, atol=1.1 / 255)


def test_another_process_with_the_same_seed_makes_the_same_picture(first, scene, tmp_path):
    target, *_ = first
    options = ("--seed", 3, "--repair", "--progress", "none", "--layers", "change, depth", "--samples", 100)
    status, events, errors = render(scene, "-o", tmp_path / "again.exr", *options)
    assert status == 0
    assert events == []
    assert f"wrote {tmp_path / 'again.exr'} and {tmp_path / 'again.png'}" in errors
    parts = {part.name: part for part in read_exr(tmp_path / "again.exr", interleaved=True)}
    assert list(parts) == ["beauty", "change", "depth"]
    before = {part.name: part for part in read_exr(target, interleaved=True)}
    for name, part in parts.items():
        for channel, pixels in part.channels.items():
            assert pixels.tobytes() == before[name].channels[channel].tobytes()


def test_ctrl_c_writes_what_there_is(scene, tmp_path):
    target = tmp_path / "picture.exr"
    process = start_render(scene, "-o", target, "--repair", "--progress", "json", "--samples", 10_000_000)
    for line in process.stdout:
        if json.loads(line)["event"] == "progress":
            process.send_signal(signal.SIGINT)
            break
    output, errors = process.communicate(timeout=300)
    assert process.returncode == 130
    done = json.loads(output.splitlines()[-1])
    assert done.pop("exposure") == pytest.approx(-1.0)
    assert done.pop("error") > 0.0
    assert done == {"event": "done", "file": str(target), "interrupted": True, "denoised": False}
    assert "Traceback" not in errors
    assert target.with_suffix(".checkpoint").exists()
    frame = read_frame(target)
    assert 0 < float(frame.metadata["samples"]) < 10_000_000
    assert (frame.coverage > 0).any()


def test_an_interrupted_still_names_the_command_that_continues_it(tmp_path, capsys):
    target, command = tmp_path / "a [b].exr", "lightdepth render 'my scene.toml' --resume"
    for kept in (False, True):
        if kept:
            target.with_suffix(".checkpoint").touch()
        with Reporter("none", [target], 0.0, command) as reporter:
            reporter.report(Done(str(target), interrupted=True, error=0.5))
        errors = capsys.readouterr().err
        assert f"what was rendered so far is in {target}\n" in errors
        assert (f"this command continues: {command}\n" in errors) == kept


def test_ctrl_c_while_preparing_writes_nothing(scene, tmp_path):
    target, slow = tmp_path / "made" / "picture.exr", scene.with_name("slow.toml")
    slow.write_text(scene.read_text().replace("irradiance_samples = 16", f"irradiance_samples = {1 << 20}"))
    process = start_render(slow, "-o", target, "--repair", "--progress", "json")
    killer = threading.Timer(300, process.kill)
    killer.start()
    for line in process.stdout:
        if json.loads(line) == {"event": "stage", "stage": "preparing"}:
            break
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate()
    killer.cancel()
    assert process.returncode == 130
    assert "interrupted while preparing; nothing was written" in errors
    assert "Traceback" not in errors
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_fills_up_leaves_nothing_half_written(first, scene, tmp_path):
    """The kernels are in the cache by now, so that the picture is the only large file."""
    limits = lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))  # noqa: E731
    target = tmp_path / "picture.exr"
    status, events, errors = render(scene, "-o", target, "--repair", "--progress", "json", preexec_fn=limits)
    assert status == 2
    assert f"{target}: cannot be written" in errors
    assert "Traceback" not in errors
    assert events[-1]["event"] == "failure"
    assert f"{target}: cannot be written" in events[-1]["message"]
    assert list(tmp_path.iterdir()) == []


def test_denoising_leaves_the_photograph_alone(command, tmp_path):
    pytest.importorskip("mitsuba_oidn", reason="Open Image Denoise is not installed")
    scene = make_room(tmp_path)
    edit(scene, "width = 16\nheight = 9", "width = 64\nheight = 36\nposition = [0, 0, 1.3]\nlook_at = [0.5, 1, 0.3]")
    frames = []
    for name, more in (("noisy", []), ("clean", ["--denoise"])):
        status, *_ = command("render", scene, "-o", tmp_path / f"{name}.exr", "--samples", "4", *more)
        assert status == 0
        frames.append(read_frame(tmp_path / f"{name}.exr"))
    noisy, clean = frames
    assert "denoised" not in noisy.metadata
    assert clean.metadata["denoised"] == "change, synthetic"
    assert undocumented(tmp_path / "clean.exr") == set()
    assert clean.plate.tobytes() == noisy.plate.tobytes()
    untouched = (noisy.coverage == 0) & (noisy.change == 0).all(axis=2)
    assert untouched.any()
    assert clean.beauty[untouched].tobytes() == noisy.plate[untouched].tobytes()
    assert np.abs(np.diff(clean.synthetic, axis=1)).sum() < np.abs(np.diff(noisy.synthetic, axis=1)).sum()


@pytest.mark.parametrize("spoil", MEANINGLESS, ids=lambda spoil: spoil.__name__)
def test_what_would_make_the_picture_meaningless_stops_it(command, tmp_path, spoil):
    scene = make_room(tmp_path)
    spoil(scene)
    before = sorted(tmp_path.rglob("*"))
    status, output, errors = command("render", scene, "-o", tmp_path / "made" / "picture.exr", "--samples", "1")
    assert status == 2
    assert errors.count("error:") == 1
    assert MEANINGLESS[spoil] in errors
    assert "Traceback" not in output + errors
    assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--camera", "veiw"], "no camera 'veiw'; did you mean 'view'? allowed: view"),
        (["--method", "magic"], "method 'magic' is unknown; allowed are difference, directional, envpath"),
        (["--layers", "change,colour"], "--layers: 'colour' is unknown; allowed are all, none, plate"),
        (["-o", "picture.jpg"], "the output is an .exr file"),
        (["-o", "scene.toml/picture.exr"], "cannot be written"),
        (["-o", "folder.exr"], "cannot be written (it is a folder)"),
        (["-o", "/proc/picture.exr"], "/proc/picture.exr: cannot be written"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else "",
)
def test_wrong_arguments(command, tmp_path, monkeypatch, arguments, message):
    scene = make_room(tmp_path)
    (tmp_path / "folder.exr").mkdir()
    monkeypatch.chdir(tmp_path)
    before = sorted(tmp_path.rglob("*"))
    if "-o" not in arguments:
        arguments = [*arguments, "-o", "made/picture.exr"]
    status, output, errors = command("render", scene, *arguments)
    assert status == 2
    assert message in errors
    assert "Traceback" not in output + errors
    assert sorted(tmp_path.rglob("*")) == before


def test_help_loads_no_renderer():
    code = """
import sys
from lightdepth.cli.app import app
for arguments in (["--help"], ["render", "--help"]):
    app(arguments, standalone_mode=False)
print("heavy:", sorted({"mitsuba", "drjit", "cv2"} & set(sys.modules)))
"""
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "heavy: []" in result.stdout
    assert "Example: lightdepth render" in result.stdout
