"""`lightdepth farm`: jobs that the engines' own programs check and run."""

import json
import os
import re
import shutil
import subprocess
import sys

import pytest
from typer.testing import CliRunner

from lightdepth.cli.farm import app
from lightdepth.errors import InputError

from .room_folder import edit, make_room

PROGRAM = [sys.executable, "-c", "from lightdepth.cli.app import main; main()"]
ENVIRONMENT = {**os.environ, "COLUMNS": "1000", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}


def call(*command, **environment):
    return subprocess.run(
        [*map(str, command)], env={**ENVIRONMENT, **environment}, capture_output=True, text=True, timeout=500
    )


def farm(*arguments):
    """The command, in this process: an error is raised."""
    result = CliRunner().invoke(app, [*map(str, arguments)])
    if result.exception is not None:
        raise result.exception
    return result.stderr


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    scene = make_room(tmp_path_factory.mktemp("a room"))
    edit(scene, "[panorama]", "[sequence]\nframes = [1, 9]\n\n[panorama]")
    with scene.open("a") as file:
        file.write("\n[render]\nsamples = 2\nirradiance_samples = 16\n")
    return scene


@pytest.fixture(scope="module")
def worker(tmp_path_factory):
    """The command as a machine of a farm has it."""
    path = tmp_path_factory.mktemp("bin") / "lightdepth"
    path.write_text(
        f"""#!/bin/sh
"{sys.executable}" -c "from lightdepth.cli.app import main; main()" "$@" &
if [ -n "$DIES_AFTER" ]; then
    until [ -e "$DIES_AFTER" ] || ! kill -0 $!; do sleep 0.02; done
    kill -9 $!
fi
wait $!
"""
    )
    path.chmod(0o755)
    return path


def openjd(*arguments, **environment):
    pytest.importorskip("openjd.cli", reason="the package openjd-cli is the referee")
    return call(sys.executable, "-m", "openjd", *arguments, **environment)


def test_an_open_job_is_checked_and_rendered_by_its_own_runner(scene, worker, tmp_path):
    """Two chunks; the first worker is killed after its first frame. Run again, nothing is lost or made twice."""
    out = tmp_path / "out of it"
    made = farm(
        "openjd", scene, tmp_path / "job", "--frames", "1-3", "--chunk", "2",
        "-o", out / "shot.####.exr", "--draft", "--layers", "none", "--device", "cpu",
    )  # fmt: skip
    assert "3 frames in 2 chunks" in made
    template = tmp_path / "job" / "template.json"
    checked = openjd("check", template, "--extensions", "TASK_CHUNKING")
    assert checked.returncode == 0, checked.stdout + checked.stderr
    values = json.loads((tmp_path / "job" / "parameter_values.json").read_text())["parameterValues"]
    given = {each["name"]: each["value"] for each in values} | {"Lightdepth": str(worker)}
    (tmp_path / "values.json").write_text(json.dumps(given))
    command = ("run", template, "--step", "Render", "--extensions", "TASK_CHUNKING")
    command += ("-p", f"file://{tmp_path / 'values.json'}")
    first = out / "shot.0001.exr"
    lost = openjd(*command, DIES_AFTER=str(first))
    assert lost.returncode != 0
    assert not (out / "shot.0003.exr").exists()
    made_at = first.stat().st_mtime_ns
    run = openjd(*command)
    assert run.returncode == 0, run.stdout + run.stderr
    assert first.stat().st_mtime_ns == made_at
    assert {path.name for path in out.iterdir()} == {
        f"shot.000{n}.{kind}" for n in (1, 2, 3) for kind in ("exr", "png")
    }
    # The chunks are those of the engine, and what it rendered is what the command would.
    verified = call(
        *PROGRAM, "render", scene, "--frames", "1-3", "-o", out / "shot.####.exr", "--draft", "--layers", "none",
        "--verify",
    )  # fmt: skip
    assert verified.returncode == 0, verified.stderr


def test_frames_with_gaps_are_an_open_job_too(scene, tmp_path):
    farm("openjd", scene, tmp_path, "--frames", "1-9", "--step", "2", "-o", "s.##.exr")
    template = json.loads((tmp_path / "template.json").read_text())
    (frame,) = template["steps"][0]["parameterSpace"]["taskParameterDefinitions"]
    assert frame["chunks"]["rangeConstraint"] == "NONCONTIGUOUS"
    checked = openjd("check", tmp_path / "template.json", "--extensions", "TASK_CHUNKING")
    assert checked.returncode == 0, checked.stdout + checked.stderr


@pytest.mark.skipif(shutil.which("bash") is None, reason="the script is one for bash")
def test_each_task_of_a_slurm_array_has_its_chunk(scene, tmp_path):
    """What Slurm does with the script, by hand: the shell runs it with the number of each task."""
    script, recorder = tmp_path / "shot.sh", tmp_path / "lightdepth"
    recorder.write_text('#!/bin/sh\nprintf "%s\\n" "$@"\n')
    recorder.chmod(0o755)
    farm(
        "slurm", scene, script, "--frames", "1-4,8", "--chunk", "2",
        "-o", tmp_path / "o u t" / "shot.####.exr", "--samples", "8",
    )  # fmt: skip
    (array,) = [line for line in script.read_text().splitlines() if line.startswith("#SBATCH --array=")]
    assert array == "#SBATCH --array=0-2"
    path = f"{tmp_path}:{os.environ['PATH']}"
    for task, frames in enumerate(("1-2", "3-4", "8")):
        called = call("bash", script, PATH=path, SLURM_ARRAY_TASK_ID=str(task))
        output = tmp_path / "o u t" / "shot.####.exr"
        wanted = ["render", scene, "--frames", frames, "-o", output, "--samples", "8", "--progress", "none"]
        assert called.stdout.splitlines() == list(map(str, wanted)), called.stderr


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--frames", "1-10"], "10 is outside the [sequence]"),
        (["--frames", "1-9", "--sampels", "8"], "No such option: --sampels"),
        (["--frames", "1-9", "--samples", "none"], "Invalid value for '--samples'"),
        (["--frames", "1-9", "--share", "1/2"], "--share: is not for farms"),
        (["--frames", "1-9", "--chunk", "151"], "allows at most 150 frames"),
    ],
)
def test_what_every_machine_would_stumble_over_is_found_at_once(scene, tmp_path, options, words):
    with pytest.raises(InputError, match=re.escape(words)):
        farm("openjd", scene, tmp_path / "job", "-o", "shot.####.exr", *options)
    assert not (tmp_path / "job").exists()
