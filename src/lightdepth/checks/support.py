"""Does the capture point see the support, whose colour the photograph gives?"""

from __future__ import annotations

from collections.abc import Sequence

from lightdepth.checks.problem import Problem, Severity
from lightdepth.checks.sampling import unseen_share
from lightdepth.checks.view import CaptureView
from lightdepth.scene.model import RealSurface, Role

WORTH_A_WARNING = 0.5
"""Support behind furniture is usual; from this share on, more is unseen than seen."""
TOO_MUCH = 0.9
"""Of a closed box, the capture point sees one side of six at least, so that 83 % are unseen. Of a surface that
is unseen to a larger part, the photograph shows next to nothing."""


def support_problems(surface: RealSurface, views: Sequence[CaptureView]) -> list[Problem]:
    """Report the share of a support surface's area that no capture point can see.

    Where a surface has rest positions, its colour comes from there, and these must be seen.
    """
    if surface.role != Role.SUPPORT:
        return []
    share = unseen_share(surface.mesh, views)
    if share < 0.001:
        return []
    name = f'[[real]] "{surface.name}"'
    sees, photograph = "the capture point cannot see", "the photograph does not show"
    if len(views) > 1:
        sees, photograph = "no capture point sees", "no photograph shows"
    if share > TOO_MUCH:
        return [
            Problem(
                Severity.ERROR,
                f"{name}: {sees} {100 * share:.3g} % of this support's area, so that {photograph} its colour; make it "
                "environment, or give rest positions",
            )
        ]
    return [
        Problem(
            Severity.WARNING if share > WORTH_A_WARNING else Severity.HINT,
            f"{name}: {sees} {100 * share:.2g} % of this support's area; there it has the colour "
            "of what occludes it, unless it gets rest positions",
        )
    ]
