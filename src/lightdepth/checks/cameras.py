"""Do the cameras see what the photograph can show them?"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lightdepth.checks.problem import Problem, Severity
from lightdepth.checks.sampling import object_mesh, unseen
from lightdepth.checks.view import CaptureView, enclosure, sphere
from lightdepth.kernel.arrays import aligned_columns
from lightdepth.kernel.raycasting import RayCaster
from lightdepth.kernel.start import start
from lightdepth.parameters.checks import ChecksParameters
from lightdepth.scene.identity import digest
from lightdepth.scene.model import CameraView, Scene

FAR_POINT = 1000.0
"""Metres to points that both eyes of a camera see in the same direction."""
AT_CAPTURE_POINT = 1e-3
"""Metres."""
MOST_KNOWN = 256
"""Cameras of which is kept what was found of them in a place."""


def camera_problems(
    scene: Scene, views: Sequence[CaptureView], known: dict[str, list[Problem]], hints: bool = True
) -> list[Problem]:
    """Find objects around the capture point or a camera, and cameras that ask more of the photograph than it has.

    Args:
        scene: the scene; it has real surfaces.
        views: what the capture points see.
        known: what was found of cameras in this place before, by their digest; it is added to.
        hints: with what gives nothing but hints.
    """
    problems = _around(scene, views[0].tuned)
    while len(known) > MOST_KNOWN:
        known.pop(next(iter(known)))
    for name, camera in scene.cameras.items():
        hinted = hints and (scene.plate is None or name != scene.plate.camera)  # That one has a picture of its own.
        key = digest(name, camera, hinted)
        if key not in known:
            known[key] = _problems_of(name, camera, scene, views, hinted)
        problems += known[key]
    return problems


def _problems_of(
    name: str, camera: CameraView, scene: Scene, views: Sequence[CaptureView], hints: bool
) -> list[Problem]:
    """What is wrong with a camera, whatever objects there are."""
    where = f"[camera.{name}]"
    if all(_has_left(camera, view) for view in views):
        x, y, z = camera.position
        message = f"is outside the room, at [{x:.3g}, {y:.3g}, {z:.3g}]: it sees the real surfaces from behind"
        return [Problem(Severity.WARNING, f"{where}: {message}")]
    if not hints:
        return []
    nearest = min(views, key=lambda view: float(np.linalg.norm(camera.position - view.position)))
    soft, far = _softness(camera, scene, nearest.tuned), _far_away(camera, nearest, views)
    return [Problem(Severity.HINT, f"{where}: {message}") for message in (soft, far) if message is not None]


def _around(scene: Scene, tuned: ChecksParameters) -> list[Problem]:
    points = {"the capture point": scene.panorama.position}
    for name, camera in scene.cameras.items():
        if np.linalg.norm(camera.position - scene.panorama.position) > AT_CAPTURE_POINT:
            points[f"the camera '{name}'"] = camera.position
    problems = []
    for thing in scene.synthetic:
        mesh = object_mesh(thing)
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        inside = [what for what, point in points.items() if np.all(point > low) and np.all(point < high)]
        if not inside:
            continue
        caster = RayCaster([mesh])
        for what in inside:
            if enclosure(caster, points[what], tuned.enclosure_rays) >= tuned.around:
                problems.append(
                    Problem(
                        Severity.WARNING,
                        f'[[synthetic]] "{thing.name}": stands around {what}, which sees nothing but its inside; is its '
                        "size or its position wrong?",
                    )
                )
    return problems


def _has_left(camera: CameraView, capture: CaptureView) -> bool:
    """Whether a camera is not in the room in which the capture point is."""
    covered = capture.share(capture.surface >= 0)
    if capture.sky or covered <= capture.tuned.mostly_closed:
        return False
    if np.any((camera.position < capture.low) | (camera.position > capture.high)):
        return True
    return enclosure(capture.caster, camera.position, capture.tuned.enclosure_rays) < capture.tuned.same_room * covered


def _softness(view: CameraView, scene: Scene, tuned: ChecksParameters) -> str | None:
    width = max(panorama.radiance.shape[1] for panorama in scene.panoramas)
    if not width:
        return None
    finer = pixels_per_degree(view) / (width / 360.0)
    if finer < tuned.soft:
        return None
    return (
        f"has {pixels_per_degree(view):.3g} pixels to a degree, the panorama {width / 360.0:.3g}: the photograph will be "
        f"{finer:.1f} times softer than the new objects. A panorama of {width * finer:.0f} pixels, a wider view or fewer "
        "pixels would do"
    )


def pixels_per_degree(view: CameraView) -> float:
    """Pixels to a degree in front of a camera, as far as they are square."""
    start()
    return view.camera.pixels_per_degree()


def _far_away(view: CameraView, capture: CaptureView, captures: Sequence[CaptureView]) -> str | None:
    """Where a camera sees much that no capture point does, or is far from the nearest one."""
    distance = float(np.linalg.norm(view.position - capture.position))
    if distance < AT_CAPTURE_POINT:
        return None
    directions = _directions(view, capture.tuned)
    hits = capture.caster.cast(view.position, directions)
    met = np.isfinite(hits.distance)
    if not met.any():
        return None
    points = view.position + hits.distance[met, None] * directions[met]
    share = float(np.all([unseen(points, each) for each in captures], axis=0).mean()) * float(met.mean())
    usual = float(np.median(capture.distance[np.isfinite(capture.distance)]))
    if share < capture.tuned.unseen_view and distance < capture.tuned.far * usual:
        return None
    nearest = "nearest capture point" if len(captures) > 1 else "capture point"
    hidden = f"{100.0 * share:.0f} % of what it sees is occluded from there and has a colour from elsewhere, and "
    return (
        f"is {distance:.2g} m from the {nearest}, and surfaces are {usual:.2g} m from that; "
        f"{hidden if share >= 0.005 else ''}errors of the model are visible. Move it nearer, or refine the model"
    )


def _directions(view: CameraView, tuned: ChecksParameters) -> NDArray[np.float64]:
    """Distributed over what a camera sees, unit, world, shape (n, 3)."""
    start()
    everywhere = sphere(tuned.camera_rays)
    return everywhere[view.on_film(aligned_columns(view.position + FAR_POINT * everywhere))[1]]
