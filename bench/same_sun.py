"""What a declared sun costs beside the same sun in the photograph: time times variance, at equal light and shadows."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from bench.places import PLACES
from bench.places.sun import Sun
from bench.truth import photograph
from lightdepth.directions import direction_to_latlong, euler_rotation, pixel_directions
from lightdepth.scene.lights.clipped import ClippedSource, covered
from lightdepth.scene.model import Panorama, RealSurface, RenderSettings, Scene

IN_THE_PATCH = {"sunlit_room": (-1.776, 0.88, 1.536), "barred_windows": (0.232, 2.233, 1.53)}
"""Capture points that see the sun through a window: between the window and its patch on the floor."""
PHOTOGRAPH, FINER = (512, 256), 4
"""Width and samples of the photographs; and how many times as wide they are made, so that the sun is as sharp in both."""
WIDTH, SAMPLES, SEEDS, RESAMPLES = 128, 32, 40, 200
CHANGED = 0.01
"""Of the plate, from which on a pixel's mean change over 5 by 5 pixels counts."""


def same_sun(console: Console) -> dict[str, Any]:
    """A table of text: time, variance and their product with the sun declared, relative to the sun in the photograph."""
    rows = []
    for name in ("court", *IN_THE_PATCH):
        for objects in ("mixed", "matte"):
            console.print(f"{name}, {objects} objects: the sun declared and in the photograph", highlight=False)
            rows.append([name, objects, *_compared(*scenes(name, objects))])
    return {
        "title": f"A declared sun against the same sun in the photograph, {SAMPLES} samples, {SEEDS} seeds",
        "head": [
            "place",
            "objects",
            "time",
            "objects: variance",
            "at equal error",
            "changed: variance",
            "at equal error",
        ],
        "rows": rows,
    }


def scenes(name: str, objects: str) -> tuple[Scene, Scene]:
    """A place with its sun in the photograph, and with the sun declared and missing in the photograph.

    In the first one windows are holes to the sky, in the second one panes, which have the same even radiance.
    """
    place = PLACES[name](objects)
    place = replace(place, position=IN_THE_PATCH.get(name, place.position))
    sun = place.outside_sun
    if sun is None:
        assert place.sky is not None
        size = np.pi * np.sin(np.radians(0.5 * place.sky.sun_diameter)) ** 2
        red, green, blue = (float(size * value) for value in place.sky.sun_radiance)
        sun = Sun(place.sky.sun_direction, (red, green, blue), place.sky.sun_diameter)
    rotation, settings = euler_rotation(place.rotation), RenderSettings(max_bounces=8)
    shown = photograph(place, *PHOTOGRAPH).mean.astype(np.float32)
    pane = next((part.radiance for part in place.parts if part.opening), None)
    without = np.repeat(np.repeat(_without_sun(shown, sun, rotation, pane), FINER, axis=0), FINER, axis=1)
    height, width = without.shape[:2]
    u, v = direction_to_latlong(sun.declared().direction @ rotation)
    disc = covered(without, ClippedSource((float(u) * width, float(v) * height), np.zeros(3), sun.diameter))
    whole = (without + disc[..., None] * np.array(sun.radiance)).astype(np.float32)
    real = tuple(RealSurface(part.name, part.mesh, part.role, opening=part.opening) for part in place.parts)
    photographed = Scene(
        Panorama(whole, np.array(place.position), rotation, sky=True),
        tuple(surface for surface in real if not surface.opening),
        place.objects,
        {"view": place.camera("view", WIDTH)},
        settings,
    )
    panorama = replace(photographed.panorama, radiance=without, sky=place.sky is not None)
    return photographed, replace(photographed, panorama=panorama, real=real, lights=(sun.declared(),))


def _without_sun(
    shown: NDArray[np.float32], sun: Sun, rotation: NDArray[np.float64], pane: tuple[float, float, float] | None
) -> NDArray[np.float32]:
    """A photograph with the pane's radiance, or the sky's around it, in place of the sun."""
    height, width = shown.shape[:2]
    toward = sun.declared().direction
    away = np.degrees(np.arccos(np.clip(pixel_directions(height, width) @ rotation.T @ toward, -1.0, 1.0)))
    inside = away < 0.5 * sun.diameter + 1.1
    around = ~inside & (away < 0.5 * sun.diameter + 3.0)
    without = shown.copy()
    without[inside] = np.median(shown[around], axis=0) if pane is None else pane
    return without


@dataclass(frozen=True)
class _Measured:
    """Images of one scene, shape (seeds, height, width, 3), processor seconds of each, coverage and plate."""

    images: NDArray[np.float32]
    seconds: NDArray[np.float64]
    coverage: NDArray[np.float32]
    plate: NDArray[np.float32]


def _compared(photographed: Scene, declared: Scene) -> list[str]:
    first, second = _measured((photographed, declared))
    longer = float(np.median(second.seconds / first.seconds))
    cells = [f"{longer:.2f}"]
    objects = first.coverage > 0.0
    change = np.where(objects, 0.0, first.images.mean(axis=(0, 3)))
    changed = ~objects & (np.abs(cv2.blur(change, (5, 5))) > CHANGED * cv2.blur(first.plate.mean(axis=2), (5, 5)))
    for region in (objects, changed):
        ratio, error = _variance_ratio(first.images[:, region], second.images[:, region])
        cells += [f"{ratio:.2f} ± {error:.2f}", f"{longer * ratio:.2f}"]
    return cells


def _measured(pair: tuple[Scene, Scene]) -> list[_Measured]:
    """Both in turn. Without the checks of scenes: they refuse a declared sun that the capture point sees."""
    from lightdepth.api import DEFAULT_METHOD, find_method
    from lightdepth.film.rendering import Rendering
    from lightdepth.film.sums import Share

    prepared = [find_method(DEFAULT_METHOD)(scene, None) for scene in pair]
    images: list[list[Any]] = [[], []]
    seconds: list[list[float]] = [[], []]
    frames = []
    for seed in range(-1, SEEDS):  # The first one compiles.
        frames = []
        for index, scene in enumerate(pair):
            rendering = Rendering(
                scene, prepared[index], scene.cameras["view"], DEFAULT_METHOD, seed % 2**31, Share(), None
            )
            began = time.process_time()
            for _ in rendering.run(SAMPLES, None):
                pass
            taken = time.process_time() - began
            frame = rendering.frame(auxiliary=False, finish=True)
            frames.append(frame)
            if seed >= 0:
                images[index].append(frame.change + frame.synthetic)
                seconds[index].append(taken)
    return [
        _Measured(np.array(images[index]), np.array(seconds[index]), frame.coverage, frame.plate)
        for index, frame in enumerate(frames)
    ]


def _variance_ratio(first: NDArray[np.float32], second: NDArray[np.float32]) -> tuple[float, float]:
    """Mean variance of the second over that of the first, and its standard error by a bootstrap over the seeds."""

    def ratio(rows: NDArray[np.int64]) -> float:
        return float(second[rows].var(axis=0, ddof=1).mean() / first[rows].var(axis=0, ddof=1).mean())

    generator, count = np.random.default_rng(0), len(first)
    drawn = [ratio(generator.integers(0, count, count)) for _ in range(RESAMPLES)]
    return ratio(np.arange(count)), float(np.std(drawn))
