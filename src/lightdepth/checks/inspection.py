"""All checks together."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from lightdepth.checks.capture_point import capture_point_problems
from lightdepth.checks.coverage import Coverage, hole_problems, measure_coverage
from lightdepth.checks.gloss import gloss_problems
from lightdepth.checks.lights import light_problems
from lightdepth.checks.objects import object_problems
from lightdepth.checks.problem import Problem, Severity
from lightdepth.checks.radiance import radiance_problems
from lightdepth.checks.sampling import object_mesh
from lightdepth.checks.support import support_problems
from lightdepth.checks.view import look_around
from lightdepth.errors import InputError
from lightdepth.scene.load import read_scene
from lightdepth.scene.model import Scene


@dataclass(frozen=True)
class Inspection:
    """What all checks found.

    Attributes:
        problems: the worst first.
        coverage: ``None`` where the place has no geometry at all.
    """

    problems: tuple[Problem, ...]
    coverage: Coverage | None


def inspect_file(path: Path) -> Inspection:
    """Find all that is wrong with a scene file, with the files that it names, and with the scene that they make.

    What can be read is checked also where something else cannot be read.

    Raises:
        SetupError: rays cannot be cast, for libLLVM is missing.
    """
    try:
        contents = read_scene(path)
    except InputError as error:
        return Inspection((Problem(Severity.ERROR, str(error)),), None)
    unreadable = tuple(Problem(Severity.ERROR, message) for message in contents.problems)
    if contents.scene is None:
        return Inspection(unreadable, None)
    found = _inspect(contents.scene, contents.unread)
    return Inspection((*unreadable, *found.problems), found.coverage)


def find_problems(scene: Scene) -> list[Problem]:
    """Find all that is wrong with a loaded scene, the worst first.

    Raises:
        SetupError: rays cannot be cast, for libLLVM is missing.
    """
    return list(inspect_scene(scene).problems)


def inspect_scene(scene: Scene) -> Inspection:
    """Run all checks and measure the coverage.

    Raises:
        SetupError: rays cannot be cast, for libLLVM is missing.
    """
    found = _inspect(scene)
    if found.coverage is not None:
        return found
    message = "[[real]]: there is no real geometry: give meshes of the place, or the depth of the panorama"
    return Inspection((Problem(Severity.ERROR, message), *found.problems), None)


def _inspect(scene: Scene, unread: int = 0) -> Inspection:
    """The same for a scene of which some real surfaces (``unread`` of them), or the image, may be missing."""
    problems = [Problem(Severity.WARNING, message) for message in scene.notes] + radiance_problems(scene.panorama)
    if not scene.real and scene.panorama.depth is None:
        return Inspection(tuple(problems), None)
    view = look_around(scene)
    coverage = measure_coverage(view, scene)
    misplaced: list[Problem] = []
    if scene.real:
        misplaced = capture_point_problems(view, [object_mesh(t).vertices.mean(axis=0) for t in scene.synthetic])
    problems += misplaced
    if not misplaced:  # Seen from a wrong point, everything else looks wrong as well.
        problems += hole_problems(coverage, unread)
        problems += [problem for surface in scene.real for problem in support_problems(surface, view)]
        problems += light_problems(scene, view)
        problems += gloss_problems(scene)
        problems += object_problems(scene.synthetic, view) if scene.real else []
    order = list(Severity)
    return Inspection(tuple(sorted(problems, key=lambda problem: order.index(problem.severity))), coverage)
