"""Does the plate of an ordinary camera show the same place in the same light as the panoramas?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lightdepth.checks.problem import Problem, Severity
from lightdepth.kernel.start import start
from lightdepth.parameters.checks import DEFAULT, ChecksParameters
from lightdepth.scene.model import Scene


@dataclass(frozen=True)
class PlateReport:
    """How the plate compares with the panoramas.

    Attributes:
        gain: what it shows over what the panoramas show of the same surface, per channel.
        given: whether the scene file gave it.
        shared: parts of the picture that were compared.
        deviation: typical relative deviation of these, after the gain; nan where nothing is shared.
        disagrees: share of these that differ by more than a quarter.
        modelled: share of the picture that shows a real surface.
        seen: share of the picture that shows what a panorama sees too.
    """

    gain: tuple[float, float, float]
    given: bool
    shared: int
    deviation: float
    disagrees: float
    modelled: float
    seen: float


def compare_plate(scene: Scene, tuned: ChecksParameters = DEFAULT) -> tuple[list[Problem], PlateReport | None]:
    """Compare the plate with the panoramas; nothing where there is none, or no model of the place.

    Args:
        scene: the scene.
        tuned: how much of it may disagree.
    """
    plate = scene.plate
    if plate is None or not scene.real or not all(each.radiance.size for each in scene.panoramas):
        return [], None
    start()
    from lightdepth.place.place import Place
    from lightdepth.place.real_surfaces import merge_real_surfaces
    from lightdepth.place.traced_surfaces import TracedSurfaces
    from lightdepth.preparation.plate import plate_name
    from lightdepth.recovery.gains import solve_gains
    from lightdepth.recovery.plate_gain import solve_plate_gain

    rooms = scene.render.parameters
    modelled = merge_real_surfaces(scene.real)
    surfaces = TracedSurfaces(replace(modelled, vertices=modelled.rest))
    gains = solve_gains(scene.panoramas, surfaces, rooms.balance, rooms.place).gains
    place = Place(scene.panoramas, surfaces, gains=gains, parameters=rooms.place)
    balance = solve_plate_gain(plate.radiance, scene.cameras[plate.camera], place, plate.gain, rooms.balance)
    if balance.problem is not None:
        return [Problem(Severity.ERROR, f"{plate_name(scene)}: {balance.problem}")], None
    red, green, blue = balance.gain.tolist()
    report = PlateReport(
        (red, green, blue),
        plate.gain is not None,
        balance.shared,
        balance.deviation,
        balance.disagrees,
        balance.modelled,
        balance.seen,
    )
    problems = []
    if balance.disagrees > tuned.plate_differs:
        severity = Severity.WARNING if balance.disagrees > tuned.plate_differs_much else Severity.HINT
        problems.append(
            Problem(
                severity,
                f"{plate_name(scene)}: {100.0 * balance.disagrees:.0f} % of what it shares with a panorama differs by more "
                f"than a quarter after the gain {red:.3g} {green:.3g} {blue:.3g}; look at the camera (the model must lie "
                "on the picture), at the gain, and at what moved or changed its light between the two",
            )
        )
    return problems, report


def gain_problems(reports: Sequence[PlateReport], tuned: ChecksParameters = DEFAULT) -> list[Problem]:
    """What is wrong with the gains of the plates of a sequence, each of which is solved by itself.

    Args:
        reports: of its frames.
        tuned: by how much they may differ.
    """
    gains = np.array([report.gain for report in reports if not report.given])
    if len(gains) < 2:
        return []
    low, high, middle = gains.min(axis=0), gains.max(axis=0), np.median(gains, axis=0)
    spread = float((high / low).max()) - 1.0
    if spread <= tuned.gains_flicker:
        return []
    one = ", ".join(f"{value:.4g}" for value in middle)
    return [
        Problem(
            Severity.WARNING,
            f"[plate]: its gain is solved for every frame, and the new objects will flicker with it, by up to "
            f"{100.0 * spread:.1f} %; unless the exposure of the plate does change, write gain = [{one}], the median",
        )
    ]
