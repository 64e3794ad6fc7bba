"""The same sun declared and in the photograph: what of its cost is the declaration's, and not the sunlight's."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

import lightdepth.api
from bench.places import PLACES
from bench.places.meshes import rectangle
from bench.places.place import Place
from lightdepth.directions import pixel_directions, pixel_solid_angles
from lightdepth.scene.model import RealSurface, Role, Scene, SunLight

CAPTURES = {"court": None, "sunlit_room": (-1.93, 0.91, 1.2), "barred_windows": (-2.17, 2.09, 0.65)}
"""Where the sun is seen from, through a window in the rooms; ``None`` is where the place is photographed from."""
OBJECTS = ("matte", "mixed")
WIDTH, SAMPLES = 512, 64
"""Of the photographs."""
VIEW_WIDTH = 128
SHADE_AT, SHADE_SIZE = 0.4, 0.03
"""Metres: what hides the declared sun from the capture point, which must not see it, and hardly anything else."""
SPREAD = 0.35
"""Degrees over which a sun of half a degree is spread in the photograph, whose pixels are larger."""
KEPT = 0.99
"""Share of the pixels of a region that are compared: the noisiest hold single fireflies, of either kind."""


def sun_in_map(samples: int, repeats: int, console: Console) -> dict[str, Any]:
    """A table of text: time, variance, and time at equal error of the declared sun, relative to the one in the map.

    Args:
        samples: a pixel.
        repeats: renderings with different seeds, in turn.
        console: for progress.
    """
    rows = []
    for name in CAPTURES:
        for objects in OBJECTS:
            console.print(f"{name}, {objects}: the sun declared and in the map", highlight=False)
            declared, in_map = _both(PLACES[name](objects))
            rows.append([name, objects, *_compared(declared, in_map, samples, repeats)])
    return {
        "title": f"A declared sun relative to the same sun in the photograph, {samples} samples a pixel",
        "head": ["place", "objects", "processor time", "at equal error: objects", "at equal error: changed"],
        "rows": rows,
    }


def _both(place: Place) -> tuple[Scene, Scene]:
    """The scene whose sun is declared, and the one whose photograph shows it."""
    scene = replace(place, position=CAPTURES[place.name] or place.position).scene(WIDTH, SAMPLES, VIEW_WIDTH)
    panorama, real = scene.panorama, tuple(surface for surface in scene.real if not surface.opening)
    height, width = panorama.radiance.shape[:2]
    directions, angles = pixel_directions(height, width), pixel_solid_angles(height, width)[:, None, None]
    if place.sky is None:
        sun = place.sun().declared()
        off = np.degrees(np.arccos(np.clip(directions @ (panorama.rotation.T @ sun.direction), -1.0, 1.0)))
        disc = np.where(off < 3.0 * SPREAD, np.exp(-np.square(off / SPREAD)), 0.0)[..., None]
        dark, bright = panorama.radiance, panorama.radiance + disc / (disc * angles).sum() * sun.irradiance
    else:
        toward = np.array(place.sky.sun_direction) / np.linalg.norm(place.sky.sun_direction)
        off = np.degrees(np.arccos(np.clip(directions @ (panorama.rotation.T @ toward), -1.0, 1.0)))
        inside, around = off < 1.2 * place.sky.sun_diameter, off < 2.0 * place.sky.sun_diameter
        dark, bright = panorama.radiance.copy(), panorama.radiance
        dark[inside] = np.median(bright[around & ~inside], axis=0)
        sun = SunLight("sun", toward, place.sky.sun_diameter, ((bright - dark) * angles).sum(axis=(0, 1)))
    place_of = replace(panorama, sky=True)
    without = replace(scene, real=real, lights=(), panorama=replace(place_of, radiance=dark))
    hidden = RealSurface("shade", _shade(panorama.position, sun.direction), Role.ENVIRONMENT)
    return (
        replace(without, real=(*real, hidden), lights=(sun,)),
        replace(without, panorama=replace(place_of, radiance=bright.astype(np.float32))),
    )


def _shade(position: NDArray[np.float64], toward: NDArray[np.float64]) -> Any:
    right = np.cross(toward, [0.0, 0.0, 1.0])
    right *= SHADE_SIZE / np.linalg.norm(right)
    up = np.cross(right, toward)
    corner = position + SHADE_AT * toward - 0.5 * (right + up)
    return rectangle(*(tuple(map(float, each)) for each in (corner, right, up)))


def _compared(declared: Scene, in_map: Scene, samples: int, repeats: int) -> list[str]:
    images: tuple[list[Any], list[Any]] = ([], [])
    seconds: tuple[list[float], list[float]] = ([], [])
    for seed in range(-1, repeats):  # The first prepares and compiles.
        for scene, pictures, times in zip((declared, in_map), images, seconds, strict=True):
            rendering = lightdepth.api.begin_rendering(scene, camera="view", seed=max(seed, 0))
            began = time.process_time()
            for _ in rendering.run(samples=samples):
                pass
            taken = time.process_time() - began
            frame = rendering.frame(auxiliary=False)
            if seed >= 0:
                pictures.append(frame.change + frame.synthetic)
                times.append(taken)
    means = [np.mean(each, axis=0) for each in images]
    noise = [np.var(each, axis=0, ddof=1).mean(axis=-1) for each in images]
    changed = (frame.coverage == 0.0) & (np.abs(means[1]).mean(axis=-1) > 0.02 * frame.plate.mean())
    longer = float(np.median(seconds[0]) / np.median(seconds[1]))
    both = [
        longer * _typical(noise[0][region]) / _typical(noise[1][region]) for region in (frame.coverage == 1.0, changed)
    ]
    return [f"{value:.2f}" for value in (longer, *both)]


def _typical(variance: NDArray[np.float64]) -> float:
    return float(np.sort(variance)[: int(KEPT * variance.size)].mean())
