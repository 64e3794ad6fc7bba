"""Shared by all tests."""

import os
import shutil
import sys
from pathlib import Path

import pytest

from lightdepth.cli.app import main
from tests import machine

# Tests prepare their places themselves, and leave nothing behind; those of the cache name a folder of their own.
os.environ["LIGHTDEPTH_CACHE"] = "off"
# Threads that wait for work spin: with two, small pictures take a third more processor time, and no less of any other.
# `tests.machine` runs the statistical tests with one to four.
os.environ.setdefault("LIGHTDEPTH_THREADS", "1")

ROOT = Path(__file__).parents[1]
MACHINE = pytest.StashKey[str]()
"""What `tests.machine` has changed."""
PROGRAMS = {
    "hugin": lambda: shutil.which("cpfind") is not None,
    "blender": lambda: bool(os.environ.get("LIGHTDEPTH_BPY")) or any(ROOT.glob(".venv-bpy*/bin/python")),
}
"""Programs that tests drive, and how to find out whether they are there. Without one, its tests are skipped."""


def pytest_configure(config):
    """Be the machine that the environment names; fail, not skip, without a program that LIGHTDEPTH_REQUIRE names."""
    config.stash[MACHINE] = machine.apply()
    required = [name for name in os.environ.get("LIGHTDEPTH_REQUIRE", "").split(",") if name]
    missing = [name for name in required if not PROGRAMS.get(name, lambda: False)()]
    if missing:
        pytest.exit(f"LIGHTDEPTH_REQUIRE names {', '.join(missing)}, which is not installed", returncode=1)


def pytest_report_header(config):
    return config.stash[MACHINE] or None


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real captures outside the repository; tests that need it are skipped where it is absent."""
    default = Path(__file__).parents[1] / "../shared/data"
    folder = Path(os.environ.get("LIGHTDEPTH_SHARED_DATA", default))
    if not folder.is_dir():
        pytest.skip(f"real captures are not at {folder}")
    return folder


@pytest.fixture
def command(monkeypatch, capsys):
    """Run `lightdepth` with arguments; gives exit status, standard output and standard error."""

    def run(*arguments):
        monkeypatch.setattr(sys, "argv", ["lightdepth", *map(str, arguments)])
        monkeypatch.setenv("COLUMNS", "1000")
        with pytest.raises(SystemExit) as stop:
            main()
        captured = capsys.readouterr()
        return stop.value.code or 0, captured.out, captured.err

    return run
