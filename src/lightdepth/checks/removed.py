"""How much of a camera's picture shows what nobody knows: what removed surfaces hid."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lightdepth.checks.problem import Problem, Severity
from lightdepth.checks.sampling import unseen
from lightdepth.checks.view import CaptureView
from lightdepth.kernel.arrays import aligned
from lightdepth.kernel.raycasting import RayCaster
from lightdepth.kernel.start import start
from lightdepth.scene.model import CameraView, Role, Scene


def removed_problems(scene: Scene, views: Sequence[CaptureView]) -> list[Problem]:
    """Find the cameras that look where something is removed, and report what they see there.

    Args:
        scene: the scene; it has real surfaces.
        views: what the capture points see of them, removed ones included.
    """
    gone = [surface.name for surface in scene.real if surface.removed]
    kept = [surface for surface in scene.real if not surface.removed]
    if not gone:
        return []
    start()
    names = ", ".join(f'"{name}"' for name in gone)
    caster, removed = RayCaster([surface.mesh for surface in kept]), np.array([each.removed for each in scene.real])
    problems = []
    for name, camera in scene.cameras.items():
        origins, directions = _film(camera, views[0].tuned.film_columns)
        first = views[0].caster.cast(origins, directions)
        through = np.isfinite(first.distance) & removed[np.maximum(first.mesh, 0)]
        if not through.any():
            continue
        behind = caster.cast(origins[through], directions[through])
        points = (
            origins[through]
            + np.where(np.isfinite(behind.distance), behind.distance, 0.0)[:, None] * directions[through]
        )
        hidden = np.isinf(behind.distance) | np.all([unseen(points, view) for view in views], axis=0)
        share = float(hidden.sum()) / len(directions)
        message = f"[camera.{name}]: {100.0 * through.mean():.2g} % of its picture shows removed surfaces ({names})"
        if not hidden.any():
            problems.append(Problem(Severity.HINT, f"{message}, and a panorama sees everything behind them"))
            continue
        problems.append(
            Problem(
                Severity.HINT,
                f"{message}; of {100.0 * share:.2g} % of the picture no panorama sees what is behind them: there, surfaces "
                "continue in the mean colour of their visible parts. A panorama from another position would show them",
            )
        )
        fixed = [
            kept[index].name
            for index in np.unique(behind.mesh[hidden & np.isfinite(behind.distance)])
            if kept[index].role is Role.ENVIRONMENT
        ]
        if fixed:
            others = ", ".join(f'"{each}"' for each in fixed)
            problems.append(
                Problem(
                    Severity.WARNING,
                    f"[camera.{name}]: behind removed surfaces ({names}) is environment ({others}), which keeps the shadow "
                    'that was on it; declare it role = "support"',
                )
            )
    return problems


def _film(camera: CameraView, columns: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Rays through a grid on the film, world: origins and unit directions, shapes (n, 3)."""
    width, height = camera.resolution
    rows = max(1, round(columns * height / width))
    x, y = np.meshgrid((np.arange(columns) + 0.5) / columns, (np.arange(rows) + 0.5) / rows)
    origins, directions, inside = camera.sight_lines([aligned(x), aligned(y)])
    return origins[inside], directions[inside]
