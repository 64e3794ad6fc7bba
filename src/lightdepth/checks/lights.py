"""Can the declared suns be as they are declared?"""

from __future__ import annotations

import numpy as np

from lightdepth.checks.problem import Problem, Severity
from lightdepth.checks.view import CaptureView
from lightdepth.kernel.raycasting import RayCaster
from lightdepth.scene.lights.frame import azimuth_and_elevation
from lightdepth.scene.model import Scene, SunLight

STEP = 4
"""Every ``STEP``-th direction of the capture view is looked at."""
OFFSET = 1e-3
"""Share of the way to the capture point by which points are lifted off their surface."""


def light_problems(scene: Scene, view: CaptureView) -> list[Problem]:
    """Find suns that the photograph shows already, and those whose light enters nowhere."""
    if not scene.lights:
        return []
    caster = RayCaster([surface.mesh for surface in scene.real if not surface.opening])
    return [problem for sun in scene.lights for problem in _sun_problems(sun, scene, view, caster)]


def _sun_problems(sun: SunLight, scene: Scene, view: CaptureView, caster: RayCaster) -> list[Problem]:
    azimuth, elevation = azimuth_and_elevation(sun.direction)
    name = f'[[light]] "{sun.name}" (azimuth {azimuth:.1f}, elevation {elevation:.1f} degrees)'
    if np.isinf(caster.cast(view.position, sun.direction[None]).distance[0]):
        return [
            Problem(
                Severity.ERROR,
                f"{name}: the capture point sees this sun, so that the photograph shows it and it would be counted twice; "
                "remove the [[light]], or correct its direction or the place's openings",
            )
        ]
    distance = view.distance[::STEP, ::STEP].reshape(-1)
    met = np.isfinite(distance)
    directions = view.directions[::STEP, ::STEP].reshape(-1, 3)[met]
    points = view.position + directions * (distance[met] * (1.0 - OFFSET))[:, None]
    lit = np.isinf(caster.cast(points, np.broadcast_to(sun.direction, points.shape)).distance)
    if lit.any():
        return []
    if not any(surface.opening for surface in scene.real):
        return [
            Problem(
                Severity.ERROR,
                f"{name}: its light enters nowhere: no surface in [[real]] has opening = true, and no hole lets it in",
            )
        ]
    return [
        Problem(Severity.WARNING, f"{name}: through the openings it lights nothing that the capture point sees"),
    ]
