"""`lightdepth farm`: jobs that the engines' own programs check and run."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager, suppress

import pytest
from typer.testing import CliRunner

from lightdepth.cli.farm import app
from lightdepth.errors import InputError

from . import one_node_slurm
from .room_folder import edit, make_room

PROGRAM = [sys.executable, "-c", "from lightdepth.cli.app import main; main()"]
ENVIRONMENT = {**os.environ, "COLUMNS": "1000", "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
FAST = ("--draft", "--layers", "none", "--device", "cpu")


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
def alone(scene, tmp_path_factory):
    """The first three frames by one process."""
    folder = tmp_path_factory.mktemp("alone")
    made = call(*PROGRAM, "render", scene, "--frames", "1-3", "-o", folder / "shot.####.exr", *FAST)
    assert made.returncode == 0, made.stderr
    return folder


def assert_delivered(folder, alone):
    """The frames are those of one process, byte for byte, and nothing else is there."""
    names = {path.name for path in alone.iterdir()}
    assert {path.name for path in folder.iterdir()} == names
    for name in names:
        assert (folder / name).read_bytes() == (alone / name).read_bytes()


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


def test_an_open_job_is_checked_and_rendered_by_its_own_runner(scene, worker, alone, tmp_path):
    """Two chunks; the first worker is killed after its first frame. Run again, nothing is lost or made twice."""
    out = tmp_path / "out of it"
    made = farm(
        "openjd", scene, tmp_path / "job", "--frames", "1-3", "--chunk", "2",
        "-o", out / "shot.####.exr", *FAST,
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
    assert_delivered(out, alone)  # The chunks are those of the engine.


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


@pytest.mark.skipif(not one_node_slurm.is_installed(), reason="Slurm and MUNGE are not installed (slurm-wlm, munge)")
def test_slurm_renders_its_array(scene, worker, alone, tmp_path_factory):
    """A real one, with a folder of a short name: those of sockets are limited."""
    folder = tmp_path_factory.mktemp("slurm")
    out, script = folder / "out", folder / "shot.sh"
    farm("slurm", scene, script, "--frames", "1-3", "--chunk", "2", "-o", out / "shot.####.exr", *FAST)
    with one_node_slurm.slurm(folder) as environment:
        paths = {"PATH": f"{worker.parent}:{environment['PATH']}", "SLURM_CONF": environment["SLURM_CONF"]}
        ended = call("sbatch", "--wait", f"--output={folder}/%a.log", script, **paths)
    logs = [(folder / f"{task}.log").read_text() for task in range(2)]
    assert ended.returncode == 0, logs
    assert_delivered(out, alone)


@contextmanager
def started(*command):
    """A process in a group of its own, with its lines; ended with all that it has started."""
    process = subprocess.Popen(
        [*map(str, command)], env=ENVIRONMENT, stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    try:
        yield process
    finally:
        with suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()


def test_dask_delivers_every_frame_though_a_worker_is_killed(scene, alone, tmp_path):
    """A scheduler and two workers; the one that has made frame 1 is killed with its command, as a lost machine is."""
    pytest.importorskip("distributed", reason="of the extra farm")
    dask, file = (sys.executable, "-m", "dask"), tmp_path / "scheduler.json"
    of_scheduler = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", file)
    of_worker = ("--scheduler-file", file, "--no-nanny", "--nthreads", "1", "--no-dashboard", "--death-timeout", "60")
    with ExitStack() as processes:
        processes.enter_context(started(*dask, "scheduler", *of_scheduler))
        wait_until(file.exists)
        workers = {
            name: processes.enter_context(
                started(*dask, "worker", *of_worker, "--name", name, "--local-directory", tmp_path / name)
            )
            for name in ("a", "b")
        }
        out = tmp_path / "out"
        submitting = processes.enter_context(
            started(
                *PROGRAM, "farm", "dask", scene, "--scheduler", file, "--frames", "1-3", "--chunk", "3",
                "-o", out / "shot.####.exr", *FAST,
            )
        )  # fmt: skip
        claim = out / "shot.0002.claim"
        holder = os.getpgid(json.loads(wait_until(lambda: content_of(claim)))["pid"])
        assert holder in [worker.pid for worker in workers.values()]
        os.killpg(holder, signal.SIGKILL)
        made_at = (out / "shot.0001.exr").stat().st_mtime_ns
        errors = submitting.stderr.read()
        assert submitting.wait() == 0, errors
    assert "rendered 3 frames" in errors
    assert (out / "shot.0001.exr").stat().st_mtime_ns == made_at
    assert_delivered(out, alone)


def wait_until(happened):
    until = time.monotonic() + 400.0
    while not (found := happened()):
        assert time.monotonic() < until
        time.sleep(0.02)
    return found


def content_of(file):
    """What is in a file that comes and goes, as far as it is there."""
    try:
        return file.read_text()
    except FileNotFoundError:
        return ""


def test_a_scheduler_that_is_not_there_is_named(scene):
    pytest.importorskip("distributed", reason="of the extra farm")
    with pytest.raises(InputError, match="--scheduler nowhere: no Dask scheduler answers there"):
        farm("dask", scene, "--scheduler", "nowhere", "--frames", "1-4", "-o", "shot.####.exr")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--frames", "1-10"], "10 is outside the [sequence]"),
        (["--frames", "1-9", "--sampels", "8"], "No such option: --sampels"),
        (["--frames", "1-9", "--samples", "none"], "Invalid value for '--samples'"),
        (["--frames", "1-9", "--share", "1/2"], "--share: cannot be given for a farm"),
        (["--frames", "1-9", "--chunk", "151"], "allows at most 150 frames"),
    ],
)
def test_what_every_machine_would_stumble_over_is_found_at_once(scene, tmp_path, options, words):
    with pytest.raises(InputError, match=re.escape(words)):
        farm("openjd", scene, tmp_path / "job", "-o", "shot.####.exr", *options)
    assert not (tmp_path / "job").exists()
