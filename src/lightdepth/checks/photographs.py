"""What the photographs of a place see of it, and what they disagree about."""

from __future__ import annotations

from dataclasses import dataclass

from lightdepth.checks.problem import Problem, Severity
from lightdepth.kernel.start import start
from lightdepth.parameters.checks import DEFAULT, ChecksParameters
from lightdepth.scene.model import Panorama, Scene


@dataclass(frozen=True)
class PhotographReport:
    """How one of several photographs compares with the others.

    Attributes:
        gain: factor per channel that brings it to the first photograph's radiance.
        given: whether the scene file gave it.
        shared: directions in which another photograph sees the same.
        deviation: typical relative deviation from the others there, after the gains; nan where nothing is shared.
        disagrees: share of these directions in which they differ by more than a quarter.
    """

    gain: tuple[float, float, float]
    given: bool
    shared: int
    deviation: float
    disagrees: float


def compare_photographs(
    scene: Scene, tuned: ChecksParameters = DEFAULT
) -> tuple[list[Problem], tuple[PhotographReport, ...]]:
    """Compare the photographs of a place that has several; nothing where there is one.

    Args:
        scene: the scene.
        tuned: how much of them may disagree.
    """
    if not scene.further or not scene.real or not all(each.radiance.size for each in scene.panoramas):
        return [], ()
    start()
    from lightdepth.place.real_surfaces import merge_real_surfaces
    from lightdepth.place.traced_surfaces import TracedSurfaces
    from lightdepth.recovery.gains import solve_gains

    rooms = scene.render.parameters
    surfaces = TracedSurfaces(merge_real_surfaces(scene.real))
    balance = solve_gains(scene.panoramas, surfaces, rooms.balance, rooms.place)
    if balance.problem is not None:
        return [Problem(Severity.ERROR, balance.problem)], ()
    problems, reports = [], []
    for index, panorama in enumerate(scene.panoramas):
        off = balance.disagreements[index]
        red, green, blue = balance.gains[index].tolist()
        reports.append(
            PhotographReport(
                (red, green, blue),
                panorama.balanced,
                balance.shared[index],
                balance.deviation[index],
                0.0 if off is None else off.share,
            )
        )
        if off is not None and off.share > tuned.photographs_differ:
            x, y, z = off.point
            severity = Severity.WARNING if off.share > tuned.photographs_differ_much else Severity.HINT
            problems.append(
                Problem(
                    severity,
                    f"{panorama_name(scene, panorama)}: {100.0 * off.share:.2g} % of what it shares with another panorama "
                    f"differs by more than a quarter, most of it around column {off.column}, row {off.row} (world "
                    f"{x:.2f} {y:.2f} {z:.2f}); if something moved there, mask it in the panorama in which it is wrong; a "
                    "mirror or a wrong model differs too",
                )
            )
    return problems, tuple(reports)


def panorama_table(scene: Scene, panorama: Panorama) -> str:
    """What messages call a panorama's table."""
    if not scene.further:
        return "[panorama]"
    number = next(index for index, each in enumerate(scene.panoramas, 1) if each is panorama)
    return f"[[panorama]] {number}"


def panorama_name(scene: Scene, panorama: Panorama) -> str:
    """The same with the name of its file, where there are several."""
    file = f" ({panorama.path.name})" if scene.further and panorama.path else ""
    return panorama_table(scene, panorama) + file
