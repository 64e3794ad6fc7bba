"""Do the new objects stand where they can be seen, on the floor, and clear of real surfaces?"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lightdepth.checks.problem import Problem, Severity
from lightdepth.checks.sampling import object_mesh, surface_points, unseen
from lightdepth.checks.view import CaptureView, enclosure
from lightdepth.kernel.raycasting import RayCaster
from lightdepth.scene.identity import digest
from lightdepth.scene.model import Mesh, SyntheticObject

MOST_KNOWN = 256
"""Objects of which is kept what was found of them in a place."""


def object_problems(
    objects: Sequence[SyntheticObject], view: CaptureView, known: dict[str, list[Problem]]
) -> list[Problem]:
    """Find objects outside the room or unseen, and faces that coincide with real ones.

    Args:
        objects: the new objects.
        view: what the capture point sees.
        known: what was found of objects in this place before, by their digest; it is added to.
    """
    problems = []
    while len(known) > MOST_KNOWN:
        known.pop(next(iter(known)))
    for thing in objects:
        key = digest(thing)
        if key not in known:
            known[key] = _problems_of(thing, view)
        problems += known[key]
    return problems


def standing_problems(objects: Sequence[SyntheticObject], view: CaptureView) -> list[Problem]:
    """Find objects that float above what is under them, or sink into it: hints, for either may be meant.

    Args:
        objects: the new objects.
        view: what the capture point sees.
    """
    problems = []
    meshes = [object_mesh(thing) for thing in objects]
    others = RayCaster(meshes)
    for index, (thing, mesh) in enumerate(zip(objects, meshes, strict=True)):
        points, _ = surface_points(mesh.vertices, mesh.faces, view.tuned.object_points)
        if len(points) and _out_of_sight(points, view, is_lamp(thing)) is None:
            problems += _named(thing, _standing(mesh, index, others, view))
    return problems


def _problems_of(thing: SyntheticObject, view: CaptureView) -> list[Problem]:
    mesh = object_mesh(thing)
    points, normals = surface_points(mesh.vertices, mesh.faces, view.tuned.object_points)
    if not len(points):
        return []
    lamp = is_lamp(thing)
    gone = _out_of_sight(points, view, lamp) or (None if lamp else _through(points, view))
    return _named(thing, gone or _coinciding(points, normals, view))


def _named(thing: SyntheticObject, problem: Problem | None) -> list[Problem]:
    return [] if problem is None else [Problem(problem.severity, f'[[synthetic]] "{thing.name}": {problem.message}')]


def is_lamp(thing: SyntheticObject) -> bool:
    """Whether an object gives light."""
    return any("emitter" in part.material.plugins() for part in thing.parts)


def _out_of_sight(points: NDArray[np.float64], view: CaptureView, lamp: bool) -> Problem | None:
    """An object of which the capture point sees nothing, because real surfaces stand before it or it is not in the room.

    Lamps may stand outside, as a sun does.
    """
    concealed, tuned = bool(unseen(points, view).all()), view.tuned
    if lamp:
        message = "is a lamp that real surfaces hide from the capture point; they block its light as well"
        return Problem(Severity.HINT, message) if concealed else None
    beyond = not view.sky and bool(np.any((points.max(axis=0) < view.low) | (points.min(axis=0) > view.high)))
    if not concealed and not beyond:
        return None
    middle = points.mean(axis=0)
    covered = view.share(view.surface >= 0)
    around = (middle, *points[:: len(points) // 4])
    enclosed = max(enclosure(view.caster, point, tuned.enclosure_rays) for point in around)
    if covered > (tuned.closed if view.sky else tuned.mostly_closed) and (
        beyond or enclosed < tuned.same_room * covered
    ):
        x, y, z = middle
        where = "beyond all real surfaces" if beyond else "and the real surfaces hide all of it from the capture point"
        return Problem(Severity.ERROR, f"is outside the room: its middle is at [{x:.3g}, {y:.3g}, {z:.3g}], {where}")
    if not concealed:
        return None
    return Problem(
        Severity.WARNING,
        "is entirely behind or inside real surfaces as seen from the capture point; only cameras elsewhere can see it",
    )


def _through(points: NDArray[np.float64], view: CaptureView) -> Problem | None:
    """An object of which a part is beyond everything that is real; what reaches into the floor is a hint of its own."""
    if view.sky or view.share(view.surface >= 0) <= view.tuned.mostly_closed:
        return None
    allowed = view.tuned.beyond
    low = view.low - [allowed, allowed, np.inf]
    beyond = np.any((points < low) | (points > view.high + allowed), axis=1)
    if beyond.mean() < view.tuned.beyond_share:
        return None
    return Problem(
        Severity.WARNING,
        f"goes through a wall or the ceiling: {100.0 * beyond.mean():.0f} % of it is beyond all real surfaces",
    )


def _standing(mesh: Mesh, index: int, objects: RayCaster, view: CaptureView) -> Problem | None:
    """An object whose lowest points are a little above, or below, the surface under them."""
    contact = view.tuned.contact
    low, high = float(mesh.vertices[:, 2].min()), float(mesh.vertices[:, 2].max())
    lowest = mesh.vertices[mesh.vertices[:, 2] < low + 1e-3]
    lowest = lowest[:: max(1, len(lowest) // 32)].astype(np.float64)
    down = np.broadcast_to([0.0, 0.0, -1.0], lowest.shape)
    above = np.concatenate([lowest[:, :2], np.full((len(lowest), 1), high + contact)], axis=1)
    ground = high + contact - float(view.caster.cast(above, down).distance.min())
    if not np.isfinite(ground):
        return None
    if ground > low + max(contact, view.tuned.contact_share * (high - low)):
        return Problem(Severity.HINT, f"reaches {1000 * (ground - low):.1f} mm into the real surface under it")
    just_below = lowest - [0.0, 0.0, 1e-4]
    under = objects.cast(just_below, down)
    other = np.where(under.mesh == index, np.inf, under.distance)
    gap = min(low - ground, float(other.min()))
    if contact < gap < view.tuned.deliberate_gap:
        return Problem(Severity.HINT, f"floats {1000 * gap:.1f} mm above the surface under it")
    return None


def _coinciding(points: NDArray[np.float64], normals: NDArray[np.float64], view: CaptureView) -> Problem | None:
    """Visible faces that lie in a real surface, so that either may win.

    A box's bottom on the floor does not count: what lies before it, on the far side of the floor, is unseen.
    """
    step = 0.01
    before = points + step * normals
    hits = view.caster.cast(before, -normals)
    same = np.abs(hits.distance - step) < view.tuned.coplanar
    same &= np.abs(np.einsum("ij,ij->i", hits.normal, normals)) > view.tuned.coplanar_cosine
    if not same.any() or not np.any(~unseen(before[same], view)):
        return None
    x, y, z = points[same][0]
    name = view.names[hits.mesh[same][0]]
    return Problem(
        Severity.WARNING,
        f'{100 * same.mean():.2g} % of its surface coincides with "{name}" (at [{x:.3g}, {y:.3g}, {z:.3g}]): which of '
        "the two is in front is undefined; move it 1 mm away",
    )
