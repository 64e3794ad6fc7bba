"""Can the declared suns be as they are declared?"""

from __future__ import annotations

import numpy as np

from lightdepth.checks.problem import Problem, Severity
from lightdepth.checks.view import CaptureView
from lightdepth.directions import FloatArray, direction_to_latlong, pixel_directions, pixel_solid_angles
from lightdepth.kernel.raycasting import RayCaster
from lightdepth.parameters.checks import ChecksParameters
from lightdepth.scene.lights.frame import azimuth_and_elevation
from lightdepth.scene.model import Panorama, Scene, SunLight

OFFSET = 1e-3
"""Share of the way to the capture point by which points are lifted off their surface."""


def light_problems(scene: Scene, view: CaptureView) -> list[Problem]:
    """Find suns that the photograph shows already, and those whose light enters nowhere."""
    suns = [light for light in scene.lights if isinstance(light, SunLight)]
    if not suns:
        return []
    caster = RayCaster([surface.mesh for surface in scene.real if not surface.opening])
    shown = _shown_sun(scene.panorama, caster, view.tuned)
    return [problem for sun in suns for problem in _sun_problems(sun, scene, view, caster, shown)]


def _shown_sun(panorama: Panorama, caster: RayCaster, tuned: ChecksParameters) -> tuple[FloatArray, float] | None:
    """The sun that the panorama itself shows: the direction toward it, world, and its irradiance, mean of the channels."""
    luminance = panorama.light_radiance.mean(axis=2, dtype=np.float64)
    height, width = luminance.shape
    angles = np.broadcast_to(pixel_solid_angles(height, width)[:, None], luminance.shape)
    bright = luminance > tuned.sun_stands_out * float((luminance * angles).sum()) / (4.0 * np.pi)
    if not bright.any():
        return None
    directions = pixel_directions(height, width) @ panorama.rotation.T
    toward = directions[bright]
    outside = np.isinf(caster.cast(panorama.position, toward).distance) & (toward[:, 2] > 0.0)
    if not outside.any():
        return None
    middle = toward[np.argmax(np.where(outside, luminance[bright], -1.0))]
    cosine = directions @ middle
    near = cosine > np.cos(np.radians(tuned.sun_near))
    around = ~near & (cosine > np.cos(np.radians(tuned.sun_around)))
    sky = float(np.median(luminance[around])) if around.any() else 0.0
    return middle, float((np.maximum(luminance - sky, 0.0) * angles)[near].sum())


def _sun_problems(
    sun: SunLight, scene: Scene, view: CaptureView, caster: RayCaster, shown: tuple[FloatArray, float] | None
) -> list[Problem]:
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
    if shown is not None and shown[1] >= view.tuned.same_sun * float(sun.irradiance.mean()):
        u, v = direction_to_latlong(shown[0] @ scene.panorama.rotation)
        height, width = scene.panorama.radiance.shape[:2]
        around, above = azimuth_and_elevation(shown[0])
        return [
            Problem(
                Severity.WARNING,
                f"{name}: the panorama shows a sun itself, at pixel {u * width:.0f},{v * height:.0f} (azimuth "
                f"{around:.1f}, elevation {above:.1f} degrees, irradiance {shown[1]:.3g}); if both are one sun, its light "
                "is counted twice: remove the [[light]]",
            )
        ]
    step = view.tuned.sun_step
    distance = view.distance[::step, ::step].reshape(-1)
    met = np.isfinite(distance)
    directions = view.directions[::step, ::step].reshape(-1, 3)[met]
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
