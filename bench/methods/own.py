"""lightdepth's own methods, through its public interface."""

from __future__ import annotations

import time
from collections.abc import Sequence

import numpy as np

import lightdepth
from bench.methods.job import MAX_BOUNCES, Rendered, Shot
from lightdepth.directions import euler_rotation
from lightdepth.scene.model import Panorama, RealSurface, RenderSettings, Scene

WARM_UP = 16
"""Samples a pixel that the untimed rendering takes at most."""


def scene_of(shot: Shot) -> Scene:
    """What a user of lightdepth hands over for a shot; its camera is called ``shot``."""
    return Scene(
        panorama=Panorama(
            shot.panorama, shot.capture, euler_rotation(shot.place.rotation), sky=shot.place.sky is not None
        ),
        real=tuple(RealSurface(part.name, part.mesh, part.role, opening=part.opening) for part in shot.modelled),
        synthetic=shot.place.objects,
        cameras={"shot": shot.view},
        render=RenderSettings(max_bounces=MAX_BOUNCES),
        lights=() if shot.place.outside_sun is None else (shot.place.outside_sun.declared(),),
    )


def own(shot: Shot, method: str, budgets: Sequence[int], denoise: bool = False, seed: int = 0) -> list[Rendered]:
    """Render with growing numbers of samples.

    The place is prepared once (irradiance, importance tables) by an untimed rendering, as the other methods' scenes and
    kernels are ready before the clock starts. What preparing takes is measured by ``python -m bench cost``. It does not
    depend on ``seed``: its error is the same in every image, and stays with more samples.
    """
    scene = scene_of(shot)
    few = min(budgets[0], WARM_UP)
    lightdepth.render(scene, camera="shot", samples=few, method=method, seed=seed + 1, denoise=denoise)
    rendered = []
    for samples in budgets:
        began = time.perf_counter()
        frame = lightdepth.render(scene, camera="shot", samples=samples, method=method, seed=seed, denoise=denoise)
        seconds = time.perf_counter() - began
        # Plates are compared nowhere: all methods composite into the same one.
        coverage = frame.coverage[..., None].astype(np.float64)
        image = shot.plate * (1.0 - coverage) + frame.change + frame.synthetic
        rendered.append(Rendered(image, seconds))
    return rendered
