"""All checks together."""

from __future__ import annotations

import warnings
from collections import OrderedDict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightdepth.checks.cameras import camera_problems
from lightdepth.checks.capture_point import capture_point_problems
from lightdepth.checks.coverage import Coverage, hole_problems, measure_coverage
from lightdepth.checks.gloss import gloss_problems
from lightdepth.checks.lights import light_problems
from lightdepth.checks.objects import object_problems, standing_problems
from lightdepth.checks.photographs import PhotographReport, compare_photographs, panorama_name, panorama_table
from lightdepth.checks.plate import PlateReport, compare_plate, gain_problems
from lightdepth.checks.problem import Problem, Severity
from lightdepth.checks.radiance import radiance_problems
from lightdepth.checks.removed import removed_problems
from lightdepth.checks.sampling import object_mesh
from lightdepth.checks.sequence import Findings, frames_to_check
from lightdepth.checks.size import size_problems
from lightdepth.checks.support import support_problems
from lightdepth.checks.view import CaptureView, look_around
from lightdepth.errors import InputError, InputWarning
from lightdepth.parameters.checks import DEFAULT, ChecksParameters
from lightdepth.scene.frames import SceneFrames
from lightdepth.scene.identity import digest, place_digest
from lightdepth.scene.load import Contents
from lightdepth.scene.model import Scene

KEPT = 2
"""Places of which is kept what was found of them."""


@dataclass(frozen=True)
class Inspection:
    """What all checks found.

    Attributes:
        problems: the worst first.
        coverage: ``None`` where the place has no geometry at all.
        photographs: how several of them compare; empty where there is one.
        plate: how the plate compares with them; ``None`` without one.
    """

    problems: tuple[Problem, ...]
    coverage: Coverage | None
    photographs: tuple[PhotographReport, ...] = ()
    plate: PlateReport | None = None


def inspect_file(path: Path, tuned: ChecksParameters = DEFAULT) -> Inspection:
    """Find all that is wrong with a scene file, with the files that it names, and with the scene that they make.

    What can be read is checked also where something else cannot be read. Of a sequence, the tables are checked at every
    frame, the scene at those of :func:`~lightdepth.checks.sequence.frames_to_check`.

    Args:
        path: of the scene file.
        tuned: what is reported.

    Raises:
        SetupError: rays cannot be cast, for libLLVM is missing.
    """
    try:
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", InputWarning)
            frames = SceneFrames(path)
            if frames.text.sequence is None:
                found = _inspect_contents(frames.contents(), tuned)
            else:
                found = _inspect_frames(frames, tuned)
    except InputError as error:
        return Inspection((Problem(Severity.ERROR, str(error)),), None)
    said = dict.fromkeys(str(warning.message) for warning in caught if issubclass(warning.category, InputWarning))
    unapplied = [Problem(Severity.WARNING, message) for message in said]
    return replace(found, problems=_worst_first([*unapplied, *found.problems]))


def _inspect_contents(contents: Contents, tuned: ChecksParameters, hints: bool = True) -> Inspection:
    unreadable = [Problem(Severity.ERROR, message) for message in contents.problems]
    if contents.scene is None:
        return Inspection(tuple(unreadable), None)
    found = _inspect(contents.scene, tuned, contents.unread, hints)
    return replace(found, problems=(*unreadable, *found.problems))


def _inspect_frames(frames: SceneFrames, tuned: ChecksParameters, hints: bool = True) -> Inspection:
    looked_at, findings, first = frames_to_check(frames, tuned), Findings(), Inspection((), None)
    wrong_tables, plates = frames.table_problems(), []
    for frame in looked_at:
        found = _inspect_contents(frames.contents(frame), tuned, hints)
        plates += [] if found.plate is None else [found.plate]
        first = first if first.coverage is not None else found
        # Those of the tables are known, with their frames.
        findings.add(frame, [problem for problem in found.problems if problem.message not in wrong_tables])
    tables = [Problem(Severity.ERROR, message) for message in wrong_tables]
    return replace(first, problems=(*tables, *gain_problems(plates, tuned), *findings.all(looked_at)))


def frames_problems(frames: SceneFrames, tuned: ChecksParameters = DEFAULT) -> list[Problem]:
    """Find what will spoil pictures of a sequence, the worst first; what may be an oversight is left out.

    Args:
        frames: the scene.
        tuned: what is reported.

    Raises:
        InputError: there is no sequence.
        SetupError: rays cannot be cast, for libLLVM is missing.
    """
    found = _inspect_frames(frames, tuned, hints=False).problems
    return [problem for problem in _worst_first(found) if problem.severity is not Severity.HINT]


def find_problems(scene: Scene, hints: bool = True, tuned: ChecksParameters = DEFAULT) -> list[Problem]:
    """Find all that is wrong with a loaded scene, the worst first.

    What concerns the place alone is looked at once for each of the places seen last.

    Args:
        scene: to be checked.
        hints: also report possible oversights, which takes a closer look.
        tuned: what is reported.

    Raises:
        SetupError: rays cannot be cast, for libLLVM is missing.
    """
    found = inspect_scene(scene, hints, tuned).problems
    return [problem for problem in found if hints or problem.severity is not Severity.HINT]


def inspect_scene(scene: Scene, hints: bool = True, tuned: ChecksParameters = DEFAULT) -> Inspection:
    """Run all checks and measure the coverage.

    Args:
        scene: to be checked.
        hints: with the checks of objects that give nothing but hints.
        tuned: what is reported.

    Raises:
        SetupError: rays cannot be cast, for libLLVM is missing.
    """
    found = _inspect(scene, tuned, hints=hints)
    if found.coverage is not None:
        return found
    message = "[[real]]: there is no real geometry; give meshes of the place, or the depth of the panorama"
    return Inspection((Problem(Severity.ERROR, message), *found.problems), None)


def forget_checked_places() -> None:
    """Free what is kept of the places that were checked last."""
    _checked.clear()


@dataclass(frozen=True)
class _CheckedPlace:
    """What is found of a place without its objects.

    Attributes:
        views: what the capture points see; empty where the place has no geometry at all.
        free: what the first one would see of it without what is removed; ``None`` where ``views`` is empty.
        coverage: ``None`` there.
        photographs: how they compare.
        radiance: what is wrong with the panorama.
        others: what is wrong with the rest, where the capture point is right.
        objects: what is wrong with objects that were looked at in it, by their digest.
        cameras: likewise of cameras.
        plates: what was found of plates that were looked at in it, by their digest.
    """

    views: tuple[CaptureView, ...]
    free: CaptureView | None
    coverage: Coverage | None
    photographs: tuple[PhotographReport, ...]
    radiance: tuple[Problem, ...]
    others: tuple[Problem, ...]
    objects: dict[str, list[Problem]] = field(default_factory=dict)
    cameras: dict[str, list[Problem]] = field(default_factory=dict)
    plates: dict[str, tuple[list[Problem], PlateReport | None]] = field(default_factory=dict)


_checked: OrderedDict[str, _CheckedPlace] = OrderedDict()


def _checked_place(scene: Scene, tuned: ChecksParameters, unread: int) -> _CheckedPlace:
    key = digest(place_digest(scene), [str(panorama.path) for panorama in scene.panoramas], unread, tuned)
    checked = _checked.pop(key, None) or _check_place(scene, tuned, unread)
    _checked[key] = checked
    while len(_checked) > KEPT:
        _checked.popitem(last=False)
    return checked


def _check_place(scene: Scene, tuned: ChecksParameters, unread: int) -> _CheckedPlace:
    radiance = tuple(
        problem
        for panorama in scene.panoramas
        for problem in radiance_problems(panorama, panorama_table(scene, panorama), tuned)
    )
    if not scene.real and all(panorama.depth is None for panorama in scene.panoramas):
        return _CheckedPlace((), None, None, (), radiance, ())
    views = tuple(look_around(scene, panorama, tuned) for panorama in scene.panoramas)
    coverages = [measure_coverage(view, scene, views) for view in views]
    kept = tuple(surface for surface in scene.real if not surface.removed)
    free = views[0] if len(kept) == len(scene.real) else look_around(replace(scene, real=kept), tuned=tuned)
    holes = (hole_problems(each, unread, tuned) for each in coverages)
    others = next((problems for problems in holes if problems), [])
    photographs: tuple[PhotographReport, ...] = ()
    if not _misplaced(scene, views):  # Seen from a wrong point, everything else looks wrong as well.
        others += [problem for surface in kept for problem in support_problems(surface, views)]
        others += light_problems(scene, views[0])
        differences, photographs = compare_photographs(scene, tuned)
        others += differences
        if not any(problem.severity is Severity.ERROR for problem in differences):
            others += gloss_problems(scene, tuned)
    return _CheckedPlace(views, free, coverages[0], photographs, radiance, tuple(others))


def _misplaced(
    scene: Scene, views: Sequence[CaptureView], inside: Iterable[NDArray[np.floating]] = ()
) -> list[Problem]:
    """What is wrong with the capture points."""
    points = list(inside)
    return [
        problem
        for panorama, view in zip(scene.panoramas, views, strict=True)
        for problem in capture_point_problems(view, points, panorama_name(scene, panorama))
    ]


def _inspect(scene: Scene, tuned: ChecksParameters, unread: int = 0, hints: bool = True) -> Inspection:
    """The same for a scene of which some real surfaces (``unread`` of them), or the image, may be missing."""
    checked = _checked_place(scene, tuned, unread)
    problems = [*checked.radiance, *size_problems(scene.synthetic, tuned)]
    if checked.free is None:
        return Inspection(tuple(problems), None)
    misplaced: list[Problem] = []
    plate: PlateReport | None = None
    if scene.real:
        inside = (object_mesh(thing).vertices.mean(axis=0) for thing in scene.synthetic)
        misplaced = _misplaced(scene, checked.views, inside)
    problems += misplaced
    if not misplaced:
        problems += checked.others
        if scene.plate is not None and not any(each.severity is Severity.ERROR for each in checked.others):
            key = digest(scene.plate, scene.cameras[scene.plate.camera])
            if key not in checked.plates:
                checked.plates[key] = compare_plate(scene, tuned)
            differences, plate = checked.plates[key]
            problems += differences
        if scene.real:
            problems += object_problems(scene.synthetic, checked.free, checked.objects)
            problems += camera_problems(scene, checked.views, checked.cameras, hints)
            problems += removed_problems(scene, checked.views)
        if scene.real and hints:
            problems += standing_problems(scene.synthetic, checked.free)
    return Inspection(_worst_first(problems), checked.coverage, checked.photographs, plate)


def _worst_first(problems: Iterable[Problem]) -> tuple[Problem, ...]:
    order = list(Severity)
    return tuple(sorted(problems, key=lambda problem: order.index(problem.severity)))
