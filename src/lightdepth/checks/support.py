"""Does the capture point see the support, whose colour the photograph gives?"""

from __future__ import annotations

from collections.abc import Sequence

from lightdepth.checks.problem import Problem, Severity
from lightdepth.checks.sampling import unseen_share
from lightdepth.checks.view import CaptureView
from lightdepth.scene.model import RealSurface, Role


def support_problems(surface: RealSurface, views: Sequence[CaptureView]) -> list[Problem]:
    """Report the share of a support surface's area that no capture point can see.

    Where a surface has rest positions, its colour comes from there, and these must be seen.
    """
    if surface.role != Role.SUPPORT:
        return []
    share, tuned = unseen_share(surface.mesh, views), views[0].tuned
    if share < tuned.unseen_support:
        return []
    name = f'[[real]] "{surface.name}"'
    sees, photograph = "the capture point cannot see", "the photograph does not show"
    if len(views) > 1:
        sees, photograph = "no capture point sees", "no photograph shows"
    if share > tuned.most_unseen_support:
        return [
            Problem(
                Severity.ERROR,
                f"{name}: {sees} {100 * share:.3g} % of this support's area, so that {photograph} its colour; make it "
                "environment, or give rest positions",
            )
        ]
    return [
        Problem(
            Severity.WARNING if share > tuned.much_unseen_support else Severity.HINT,
            f"{name}: {sees} {100 * share:.2g} % of this support's area; there it has the colour "
            "of what occludes it, unless it gets rest positions",
        )
    ]
