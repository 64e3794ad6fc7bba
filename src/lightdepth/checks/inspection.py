"""All checks together."""

from __future__ import annotations

from dataclasses import dataclass

from lightdepth.checks.capture_point import capture_point_problems
from lightdepth.checks.coverage import Coverage, hole_problems, measure_coverage
from lightdepth.checks.objects import object_problems
from lightdepth.checks.problem import Problem, Severity
from lightdepth.checks.radiance import radiance_problems
from lightdepth.checks.sampling import object_mesh
from lightdepth.checks.support import support_problems
from lightdepth.checks.view import look_around
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
    problems = radiance_problems(scene.panorama)
    if not scene.real and scene.panorama.depth is None:
        message = "[[real]]: there is no real geometry: give meshes of the place, or the depth of the panorama"
        return Inspection((Problem(Severity.ERROR, message), *problems), None)
    view = look_around(scene)
    coverage = measure_coverage(view, scene)
    problems += hole_problems(coverage)
    names, meshes = [thing.name for thing in scene.synthetic], [object_mesh(thing) for thing in scene.synthetic]
    if scene.real:
        misplaced = capture_point_problems(view, [mesh.vertices.mean(axis=0) for mesh in meshes])
        problems += misplaced
        if not misplaced:  # Seen from a wrong point, everything else looks wrong as well.
            problems += [problem for surface in scene.real for problem in support_problems(surface, view)]
            problems += object_problems(names, meshes, view)
    order = list(Severity)
    return Inspection(tuple(sorted(problems, key=lambda problem: order.index(problem.severity))), coverage)
