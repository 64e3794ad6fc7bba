"""Does the capture point see the support, whose colour the photograph gives?"""

from __future__ import annotations

import numpy as np

from lightdepth.checks.problem import Problem, Severity
from lightdepth.checks.sampling import surface_points, unseen
from lightdepth.checks.view import CaptureView
from lightdepth.scene.model import RealSurface, Role

WORTH_A_WARNING = 0.5
"""Support behind furniture is usual; from this share on, more is unseen than seen."""
TOO_MUCH = 0.9
"""Of a closed box, the capture point sees one side of six at least, so that 83 % are unseen. Of a surface that
is unseen to a larger part, the photograph shows next to nothing."""


def support_problems(surface: RealSurface, view: CaptureView) -> list[Problem]:
    """Report the share of a support surface's area that the capture point cannot see.

    Where a surface has rest positions, its colour comes from there, and these must be seen.
    """
    if surface.role != Role.SUPPORT:
        return []
    mesh = surface.mesh
    points, _ = surface_points(mesh.vertices if mesh.rest is None else mesh.rest, mesh.faces, 4000)
    share = float(np.mean(unseen(points, view)))
    if share < 0.001:
        return []
    name = f'[[real]] "{surface.name}"'
    if share > TOO_MUCH:
        return [
            Problem(
                Severity.ERROR,
                f"{name}: the capture point cannot see {100 * share:.3g} % of this support's area, so that the photograph "
                "does not show its colour; make it environment, or give rest positions",
            )
        ]
    return [
        Problem(
            Severity.WARNING if share > WORTH_A_WARNING else Severity.HINT,
            f"{name}: the capture point cannot see {100 * share:.2g} % of this support's area; there it has the colour "
            "of what occludes it, unless it gets rest positions",
        )
    ]
