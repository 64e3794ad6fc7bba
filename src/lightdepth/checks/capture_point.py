"""Does the capture point stand in the room?"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from lightdepth.checks.problem import Problem, Severity
from lightdepth.checks.view import CaptureView, enclosure


def capture_point_problems(
    view: CaptureView, inside: Iterable[NDArray[np.floating]], name: str = "[panorama]"
) -> list[Problem]:
    """Find a capture point on a surface, inside a wall, or outside the room.

    Args:
        view: what the capture point sees.
        inside: further points that should be in the room, such as the objects' centres, world, metres, shape (3,).
        name: what messages call its panorama.
    """
    message = _in_a_wall(view) or _outside(view, inside)
    return [Problem(Severity.ERROR, f"{name}: position: the capture point {_point(view.position)} {message}")] * (
        message is not None
    )


def _in_a_wall(view: CaptureView) -> str | None:
    """Where surfaces are so near on both sides that no camera can stand there; ``None`` if they are not."""
    nearest = np.unravel_index(np.argmin(view.distance), view.distance.shape)
    distance = float(view.distance[nearest])
    if not np.isfinite(distance):
        return None
    name = view.names[view.surface[nearest]]
    if distance < view.tuned.nearest_surface:
        return (
            f'lies {1000 * distance:.1f} mm from the surface of "{name}"; it must be where the camera\'s lens was, '
            "at its height above the floor"
        )
    opposite = np.roll(view.distance[::-1], view.distance.shape[1] // 2, axis=1)
    thickness = float(np.min(view.distance + opposite))
    hit = view.surface >= 0
    solid = view.share(hit & view.from_behind) > view.tuned.closed * view.share(hit)
    if thickness < view.tuned.thinnest_place or (thickness < view.tuned.thickest_wall and solid):
        return (
            f'is inside "{name}", between surfaces only {thickness:.2f} m apart; it must be where the camera\'s lens '
            "was (are the meshes in metres?)"
        )
    return None


def _outside(view: CaptureView, inside: Iterable[NDArray[np.floating]]) -> str | None:
    """Where another point is enclosed by the room, and the capture point is not; ``None`` if that is not so."""
    low, high = view.low, view.high
    seen = view.share(view.surface >= 0)
    if seen > view.tuned.outside or np.any(high - low < view.tuned.smallest_room):
        return None
    middles = [low + (high - low) * [0.5, 0.5, height] for height in (0.25, 0.5, 0.75)]
    for point in [*middles, *inside]:
        enclosed = enclosure(view.caster, point, view.tuned.enclosure_rays)
        if enclosed >= view.tuned.closed:
            return (
                f"is outside the room: a real surface is seen in {100 * seen:.0f} % of directions from there, but in "
                f"{100 * enclosed:.0f} % of them from {_point(point)}"
            )
    return None


def _point(point: NDArray[np.floating]) -> str:
    return "[" + ", ".join(f"{value:.3g}" for value in point) + "]"
