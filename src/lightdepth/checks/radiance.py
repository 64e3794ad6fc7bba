"""Does the panorama hold the light of the place?"""

from __future__ import annotations

from lightdepth.checks.problem import Problem, Severity
from lightdepth.images.validation import clipped_plateau
from lightdepth.parameters.checks import DEFAULT, ChecksParameters
from lightdepth.scene.model import Panorama


def radiance_problems(
    panorama: Panorama, table: str = "[panorama]", tuned: ChecksParameters = DEFAULT
) -> list[Problem]:
    """Find a panorama that is black or whose lights were clipped; nothing, where its image could not be read.

    Args:
        panorama: to be checked.
        table: what messages call it.
        tuned: what seems to be clipped.
    """
    if not panorama.radiance.size:
        return []
    name = f"{table}: {panorama.path}" if panorama.path else table
    mean = float(panorama.radiance.mean())
    if mean == 0.0:
        return [Problem(Severity.WARNING, f"{name}: is black everywhere and lights nothing")]
    if panorama.notes:  # They report what was clipped as well.
        return [Problem(Severity.WARNING, f"{table}: {note}") for note in panorama.notes]
    if panorama.unclipped is not None:  # The scene declares what they really send.
        return []
    plateau = clipped_plateau(panorama.radiance, tuned)
    if plateau is None:
        return []
    return [
        Problem(
            Severity.WARNING,
            f"{name}: its brightest {plateau.count} pixels all have radiance {plateau.value:.4g} "
            f"({plateau.value / mean:.3g} times the mean): lights that were clipped; shadows will be too soft and too "
            "weak",
        )
    ]
