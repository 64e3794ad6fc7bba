"""Rooms whose sun the capture point does not see: bias with the sun declared, recovered and missing, and what it costs."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

import lightdepth
from bench.measures import find_regions
from bench.methods.job import Shot
from bench.methods.own import scene_of
from bench.places import PLACES
from bench.places.sun import Sun
from bench.run import FULL, Effort, take_shot
from bench.same_sun import same_sun
from bench.truth import Estimate
from lightdepth.kernel.start import start
from lightdepth.lighting.sun import recover_sun
from lightdepth.scene.model import Scene, SunLight

ROOMS = ("sunlit_room", "barred_windows")
REGIONS = ("objects", "changed", "influenced")
EFFORT = replace(FULL, places=ROOMS, photograph=(512, 256), cameras={"view": 256}, truth_samples={"view": 512})
"""What is spent: with less than for the methods, signed errors of a tenth of what is asked for are still seen.

Many pixels with few samples: where a shadow's edge and an object's meet in one pixel, the product of plate and coverage is
not the mean of the product, and with 128 pixels that was 0.3 % of the objects in ``barred_windows``.
"""
SAMPLES = 128
SEEDS = (0, 4, 5, 6)
"""Of the images; 1 to 3 are those of the truth, the photograph and the plate."""


@dataclass(frozen=True)
class Room:
    """A room with all that is measured in it.

    Attributes:
        name: of the place.
        shot: what the method is given.
        truth: path-traced.
        sun: as it is.
        recovered: as ``lightdepth recover sun`` finds it in the photograph.
    """

    name: str
    shot: Shot
    truth: Estimate
    sun: Sun
    recovered: SunLight


def suns(effort: Effort, console: Console) -> list[dict[str, Any]]:
    """Tables of text: what is recovered, the bias, and the cost."""
    start()
    rooms = [_room(name, effort, console) for name in ROOMS]
    return [
        {
            "title": f"The recovered sun, panoramas {effort.photograph[0]} pixels wide",
            "head": ["room", "direction off by", "irradiance off by (red, green, blue)"],
            "rows": [_found(room) for room in rooms],
        },
        {
            "title": f"Mean signed error of `difference`, mean of {len(SEEDS)} renderings with {SAMPLES} samples each",
            "head": ["room", "sun", *REGIONS],
            "rows": [row for room in rooms for row in _bias(room, console)],
        },
        same_sun(console),
    ]


def _room(name: str, effort: Effort, console: Console) -> Room:
    console.print(f"{name}: photograph and truth", highlight=False)
    place = PLACES[name](effort.objects)
    shot, truth = take_shot(place, "view", effort)
    found = recover_sun(replace(scene_of(shot), lights=()))
    recovered = found.light("recovered")
    return Room(name, shot, truth, place.sun(), recovered)


def _found(room: Room) -> list[str]:
    true = room.sun.declared()
    angle = np.degrees(np.arccos(np.clip(true.direction @ room.recovered.direction, -1.0, 1.0)))
    off = room.recovered.irradiance / true.irradiance - 1.0
    return [room.name, f"{angle:.3f} degrees", ", ".join(f"{100.0 * each:+.2f} %" for each in off)]


def _bias(room: Room, console: Console) -> list[list[str]]:
    scene = scene_of(room.shot)
    regions = find_regions(room.truth, room.shot.plate)
    rows = []
    for label, lights in (("declared", scene.lights), ("recovered", (room.recovered,)), ("missing", ())):
        console.print(f"{room.name}: {label}", highlight=False)
        images = np.array([_image(room.shot, replace(scene, lights=lights), seed) for seed in SEEDS])
        rows.append([room.name, label, *(_signed(images, room.truth, regions[region]) for region in REGIONS)])
    return rows


def _signed(images: NDArray[np.float64], truth: Estimate, region: NDArray[np.bool_]) -> str:
    """Mean signed error of images in a region, with the standard error from the truth's noise and the images' own."""
    light = truth.mean[region].sum()
    sums = images[:, region].sum(axis=(1, 2))
    noise = np.sqrt(truth.variance[region].sum() + sums.var(ddof=1) / len(sums)) / light
    return f"{100.0 * (sums.mean() / light - 1.0):+.2f} ± {100.0 * noise:.2f} %"


def _image(shot: Shot, scene: Scene, seed: int) -> NDArray[np.float64]:
    """A rendering on the plate."""
    frame = lightdepth.render(scene, camera="shot", samples=SAMPLES, seed=seed)
    coverage = frame.coverage[..., None].astype(np.float64)
    return shot.plate * (1.0 - coverage) + frame.change + frame.synthetic
