"""Loading a scene that may be wrong, so that as many of its problems as possible are told at once."""

from __future__ import annotations

from pathlib import Path

from lightdepth.checks.problem import Problem, Severity
from lightdepth.errors import InputError
from lightdepth.scene.load import load_scene
from lightdepth.scene.model import Scene


def load_for_checks(path: Path) -> tuple[Scene | None, list[Problem]]:
    """Load a scene, with its panorama repaired where that is all that is wrong with it.

    Returns:
        The scene, ``None`` where it cannot be loaded, and what was wrong on the way.
    """
    try:
        return load_scene(path), []
    except InputError as error:
        problems = [Problem(Severity.ERROR, line) for line in str(error).splitlines()]
    try:
        return load_scene(path, repair=True), problems
    except InputError:
        return None, problems
