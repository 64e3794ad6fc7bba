"""Real Blender for the tests: interpreters that have the package ``bpy``, each with the extension installed."""

import importlib.util
import json
import os
import signal
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import pytest

ROOT = Path(__file__).parents[2]
SCRIPTS = Path(__file__).parent / "scripts"
ANSWER = "ANSWER "


def _interpreters() -> list[Path]:
    """Those of the environment variable LIGHTDEPTH_BPY, else of the folders that `make blender-setup` makes."""
    named = os.environ.get("LIGHTDEPTH_BPY")
    if named:
        return [Path(path) for path in named.split(os.pathsep)]
    return [path for path in sorted(ROOT.glob(".venv-bpy*/bin/python")) if path.is_file()]


NEWEST = {
    "test_animation",
    "test_calibrating",
    "test_endurance",
    "test_holes",
    "test_photographs",
    "test_sample_models",
    "test_seen_by_cycles",
    "test_usd",
    "test_window",
    "test_a_moving_ball_is_blurred_as_in_cycles",
    "test_no_renderer_is_left_behind",
}
"""Slow tests and modules of such to which Blender's version makes no difference: they run in the newest that is there."""
ENDS = {"test_frames", "test_mesh_exporters", "test_real_lights", "test_referee"}
"""Slow modules in which versions differ by what Blender added or removed: they run in the oldest and in the newest."""


def pytest_collection_modifyitems(config, items):
    """Leave out what other versions of Blender would only repeat."""
    versions = sorted(_interpreters())
    wanted = dict.fromkeys(NEWEST, versions[-1:]) | {name: [*versions[:1], *versions[-1:]] for name in ENDS}

    def is_repeated(item):
        blender = getattr(item, "callspec", item).__dict__.get("params", {}).get("blender")
        names = {item.path.stem, item.originalname} & wanted.keys()
        return blender is not None and any(blender not in wanted[name] for name in names)

    repeated = [item for item in items if is_repeated(item)]
    config.hook.pytest_deselected(items=repeated)
    items[:] = [item for item in items if item not in repeated]


class Blender:
    """One version of Blender, with the extension installed from its zip."""

    def __init__(self, python: Path, resources: Path, archive: Path, renderer: Path):
        self.python, self.archive = python, archive
        self.environment = {
            **os.environ,
            "BLENDER_USER_RESOURCES": str(resources),
            "LIGHTDEPTH_RENDERER": str(renderer),
            # As users have it: only the first renderer of a place recovers its irradiance.
            "LIGHTDEPTH_CACHE": str(resources / "cache"),
            "PYTHONPATH": str(SCRIPTS),
        }
        self.environment.pop("PYTHONWARNINGS", None)

    def command(self, script: str, *arguments: object) -> list[str]:
        return [str(self.python), str(SCRIPTS / f"{script}.py"), *map(str, arguments)]

    def run(self, script: str, *arguments: object, **environment: str) -> dict:
        """Run a script in this Blender; returns what it answered, and under "said" what was printed (its reports)."""
        done = subprocess.run(
            self.command(script, *arguments),
            env=self.environment | environment,
            capture_output=True,
            text=True,
            timeout=600,
            check=False,
        )
        answers = [line for line in done.stdout.splitlines() if line.startswith(ANSWER)]
        # bpy 4.2 crashes when Python ends, whatever was registered: it has answered by then.
        assert done.returncode in (0, -signal.SIGSEGV), done.stdout + done.stderr
        assert answers, done.stdout + done.stderr
        return {"said": done.stdout + done.stderr} | json.loads(answers[-1].removeprefix(ANSWER))


@pytest.fixture(scope="session")
def archive(tmp_path_factory) -> Path:
    """The extension's zip, freshly built."""
    folder = tmp_path_factory.mktemp("extension")
    done = subprocess.run(
        [sys.executable, ROOT / "blender/build.py", "--output", folder], capture_output=True, text=True, check=True
    )
    return Path(done.stdout.strip())


@pytest.fixture(scope="session")
def room() -> ModuleType:
    """The computed room of the examples, whose pose is known."""
    specification = importlib.util.spec_from_file_location("calibration_room", ROOT / "examples/calibration/room.py")
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def renderer(tmp_path_factory) -> Path:
    """The command ``lightdepth`` of the Python that runs the tests."""
    path = tmp_path_factory.mktemp("bin") / "lightdepth"
    path.write_text(
        f"#!/bin/sh\nPYTHONPATH='{ROOT / 'src'}' exec '{sys.executable}' "
        "-c 'from lightdepth.cli.app import main; main()' \"$@\"\n"
    )
    path.chmod(0o755)
    return path


@pytest.fixture(scope="session", params=_interpreters() or [None], ids=lambda path: path.parts[-3] if path else "none")
def blender(request, tmp_path_factory, archive, renderer) -> Blender:
    """Each Blender in turn."""
    if request.param is None:
        pytest.skip("no Python with the package bpy: run `make blender-setup`, or name interpreters in LIGHTDEPTH_BPY")
    found = Blender(request.param, tmp_path_factory.mktemp("resources"), archive, renderer)
    found.run("install", archive)
    return found
