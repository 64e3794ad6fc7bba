"""Rooms whose sun the capture point does not see: bias with the sun declared, recovered and missing, and what it costs."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from rich.console import Console

import lightdepth
from bench.measures import converged, find_regions
from bench.methods.job import Shot
from bench.methods.own import scene_of
from bench.places import PLACES
from bench.places.sun import Sun
from bench.run import FULL, SEEDS, Effort, take_shot
from bench.truth import Estimate
from lightdepth.kernel.start import start
from lightdepth.lighting.sun import recover_sun
from lightdepth.scene.model import Scene, SunLight

ROOMS = ("sunlit_room", "barred_windows")
REGIONS = ("objects", "changed", "influenced")
EFFORT = replace(FULL, places=ROOMS, photograph=(512, 256), cameras={"view": 128}, truth_samples={"view": 2048})
"""What is spent: with less than for the methods, signed errors of a hundredth of what is asked for are still seen."""
COST_SAMPLES = 32
REPEATS = 6
"""Of the renderings whose time and noise are compared, in turn with and without the sun."""


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
    samples = effort.budgets[-1]
    return [
        {
            "title": f"The recovered sun, panoramas {effort.photograph[0]} pixels wide",
            "head": ["room", "direction off by", "irradiance off by (red, green, blue)"],
            "rows": [_found(room) for room in rooms],
        },
        {
            "title": f"Mean signed error of `difference`, mean of two renderings with {samples} samples each",
            "head": ["room", "sun", *REGIONS],
            "rows": [row for room in rooms for row in _bias(room, samples, console)],
        },
        {
            "title": f"What a declared sun costs, {COST_SAMPLES} samples a pixel",
            "head": ["room", "processor time", *(f"noise of a pixel, {region}: without, with" for region in REGIONS)],
            "rows": [_cost(room, console) for room in rooms],
        },
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


def _bias(room: Room, samples: int, console: Console) -> list[list[str]]:
    scene = scene_of(room.shot)
    regions = find_regions(room.truth, room.shot.plate)
    rows = []
    for label, lights in (("declared", scene.lights), ("recovered", (room.recovered,)), ("missing", ())):
        console.print(f"{room.name}: {label}", highlight=False)
        images = [_image(room.shot, replace(scene, lights=lights), samples, seed)[0] for seed in SEEDS]
        measured = converged(images[0], images[1], room.truth, regions)
        rows.append([room.name, label, *(f"{100.0 * measured[region]['signed']:+.2f} %" for region in REGIONS)])
    return rows


def _cost(room: Room, console: Console) -> list[str]:
    """Processor time with the sun against without in the same room and photograph, and the noise of both.

    Without the sun little changes in its patch, where it now is the strongest light: the noise is of another quantity.
    """
    console.print(f"{room.name}: cost", highlight=False)
    scene = scene_of(room.shot)
    regions = find_regions(room.truth, room.shot.plate)
    scenes = {"without": replace(scene, lights=()), "with": scene}
    images: dict[str, list[Any]] = {kind: [] for kind in scenes}
    seconds: dict[str, list[float]] = {kind: [] for kind in scenes}
    for each in scenes.values():
        _image(room.shot, each, COST_SAMPLES, 99)  # Prepares and compiles.
    for seed in range(REPEATS):
        for kind, each in scenes.items():
            image, taken = _image(room.shot, each, COST_SAMPLES, seed)
            images[kind].append(image)
            seconds[kind].append(taken)
    longer = float(np.median(seconds["with"]) / np.median(seconds["without"]))
    row = [room.name, f"{100.0 * (longer - 1.0):+.0f} %"]
    for region in REGIONS:
        row.append(", ".join(f"{100.0 * _noise(np.array(images[kind]), regions[region]):.2f} %" for kind in images))
    return row


def _noise(images: Any, region: Any) -> float:
    """Standard deviation of pixels over renderings with different seeds, relative to the mean radiance of the region."""
    inside = images[:, region]
    return float(np.sqrt(inside.var(axis=0, ddof=1).mean()) / inside.mean())


def _image(shot: Shot, scene: Scene, samples: int, seed: int) -> tuple[Any, float]:
    """A rendering on the plate, and the processor seconds that it took."""
    began = time.process_time()
    frame = lightdepth.render(scene, camera="shot", samples=samples, seed=seed)
    seconds = time.process_time() - began
    coverage = frame.coverage[..., None].astype(np.float64)
    return shot.plate * (1.0 - coverage) + frame.change + frame.synthetic, seconds
