"""The main measurement: every method on every place, in turn on this machine, as plain records."""

from __future__ import annotations

import datetime
import itertools
import json
import os
import platform
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from bench.measures import converged, find_regions, measure
from bench.methods.job import Rendered, Shot
from bench.methods.registry import OWN_METHODS, Method, available
from bench.places import PLACES
from bench.places.place import Place
from bench.places.wrong import WRONG
from bench.truth import Estimate, on_plate, photograph, truth
from lightdepth.kernel.start import start

RESULTS = Path(__file__).parent / "results"


@dataclass(frozen=True)
class Effort:
    """How much is spent.

    Attributes:
        photograph: width and samples of the panoramas that the methods are given.
        cameras: width of each camera's image.
        truth_samples: camera rays a pixel of the truth of each camera's image; the error at convergence is measured
            through ``view``. With the name of a place before it (``court/view``), of that place's alone.
        budgets: samples a pixel that each method is given; the largest is for convergence, and rendered with two seeds
            through the camera ``view``.
        longer: samples a pixel that some methods are given besides, with two seeds as well, through ``view``: those
            whose error is mostly noise even at the largest budget, so that what stays of it and when they reach a small
            error is seen and not guessed.
        repeats: how often the other budgets are timed through the camera ``view``; what is denoised, once.
        converged: samples a pixel of the product's methods with wrong models.
        places: names of the places.
        objects: the object set.
    """

    photograph: tuple[int, int]
    cameras: dict[str, int]
    truth_samples: dict[str, int]
    budgets: tuple[int, ...]
    repeats: int
    converged: int
    places: tuple[str, ...] = tuple(PLACES)
    objects: str = "mixed"
    longer: dict[str, int] = field(default_factory=dict)


QUICK = Effort((128, 512), {"view": 64}, {"view": 512}, (4, 8, 16), 1, 64)
FULL = Effort(
    photograph=(512, 2048),
    cameras={"view": 160, "panorama": 192},
    truth_samples={"view": 8192, "panorama": 2048, "court/view": 32768},  # The sun in metal is the noisiest.
    budgets=(4, 16, 64, 512),
    repeats=3,
    converged=1024,
    longer={"debevec": 4096, "cycles_proxy": 4096},
)
SEEDS = (0, 4)
"""Of each method's images; 1 to 3 are those of the truth, the photograph and the plate, and stay theirs."""
Turn = tuple[tuple[int, ...], int]
"""Budgets that are rendered one after the other, and the seed."""


def take_shot(place: Place, camera: str, effort: Effort) -> tuple[Shot, Estimate]:
    """A place as the methods are given it through one camera, and the truth.

    The plate is the empty place path-traced through the same camera: all methods composite into the same one, so that
    what is compared is what they add, not how a panorama is resampled.
    """
    width = effort.cameras[camera]
    samples = effort.truth_samples.get(f"{place.name}/{camera}", effort.truth_samples[camera])
    panorama = photograph(place, *effort.photograph).mean.astype(np.float32)
    empty = truth(place, camera, width, samples, objects=False, seed=3)
    full = truth(place, camera, width, samples)
    return Shot(place, panorama, place.camera(camera, width), empty.mean, full.coverage), on_plate(full, empty)


def measured(
    name: str, method: Method, shot: Shot, full: Estimate, plan: Sequence[Turn], denoise: bool
) -> Iterator[dict[str, Any]]:
    """Records of one method on one shot.

    Args:
        name: of the method.
        method: what renders.
        shot: what is rendered.
        full: the truth.
        plan: what is rendered, in turn; a budget that is repeated is timed repeatedly, and one that is rendered with two
            seeds is measured for what stays of its error.
        denoise: with denoising or without.
    """
    regions = find_regions(full, shot.plate)
    rendered: dict[int, list[tuple[int, Rendered]]] = {}
    for budgets, seed in plan:
        for samples, result in zip(budgets, method.render(shot, budgets, denoise, seed), strict=True):
            rendered.setdefault(samples, []).append((seed, result))
    for samples, results in rendered.items():
        images = {seed: result.image for seed, result in reversed(results)}
        image = images[SEEDS[0]]
        yield {
            "method": name,
            "denoised": denoise,
            "samples": samples,
            "seconds": [round(result.seconds, 4) for _, result in results],
            "measures": measure(image, full, regions),
            "converged": converged(image, images[SEEDS[1]], full, regions) if len(images) == 2 else {},
            "image": image,
        }


def plan_of(name: str, camera: str, model: str, denoise: bool, effort: Effort) -> list[Turn]:
    """What to render, in turn; empty where nothing is to be measured."""
    timed, largest = effort.budgets[:-1], effort.budgets[-1:]
    first = SEEDS[0]
    if model != "exact":
        own = name in OWN_METHODS and camera == "view" and not denoise
        return [((effort.converged,), first)] if own else []
    if denoise:
        return [(timed, first)]
    if camera != "view":
        return [(timed, first), (largest, first)]
    longer = [(effort.longer[name],)] if name in effort.longer else []
    return [(timed, first)] * effort.repeats + [(budgets, seed) for budgets in [largest, *longer] for seed in SEEDS]


def run(effort: Effort, console: Console) -> dict[str, Any]:
    """Measure everything; returns the results, whose records still carry their images."""
    start()
    methods = available()
    began = datetime.datetime.now(datetime.UTC)
    load = os.getloadavg()[0]
    records: list[dict[str, Any]] = []
    for name in effort.places:
        exact = PLACES[name](effort.objects)
        variants = {"exact": exact}
        variants |= {
            kind: make(exact)
            for kind, make in WRONG.items()
            if kind != "box for furniture" or name == "lamp_and_window"
        }
        for camera, (model, place) in itertools.product(effort.cameras, variants.items()):
            if model != "exact" and camera != "view":
                continue
            console.print(f"{name}, {camera}, {model}: truth", highlight=False)
            shot, full = take_shot(place, camera, effort)
            for denoise, (key, method) in itertools.product((False, True), methods.items()):
                plan = plan_of(key, camera, model, denoise, effort)
                if not plan:
                    continue
                console.print(f"{name}, {camera}, {model}: {key}{', denoised' * denoise}", highlight=False)
                try:
                    for record in measured(key, method, shot, full, plan, denoise):
                        records.append({"place": name, "model": model, "camera": camera, **record})
                except RuntimeError as error:  # A peer that fails is reported, not fatal.
                    console.print(f"  {key}: {error}", style="red", markup=False)
            records.append({"place": name, "model": model, "camera": camera, "method": "truth", "image": full.mean})
    return {
        "machine": {
            "processor": _processor(),
            "threads": len(os.sched_getaffinity(0)),
            "load_before": round(load, 2),
            "python": platform.python_version(),
            "date": began.isoformat(timespec="minutes"),
        },
        "effort": dict(vars(effort).items()),
        "settings": {key: method.settings for key, method in methods.items()},
        "labels": {key: method.label for key, method in methods.items()},
        "records": records,
    }


def save(results: dict[str, Any], name: str) -> Path:
    """Write the results without their images as JSON."""
    plain = {**results, "records": [{k: v for k, v in record.items() if k != "image"} for record in results["records"]]}
    plain["records"] = [record for record in plain["records"] if record["method"] != "truth"]
    RESULTS.mkdir(parents=True, exist_ok=True)
    path = RESULTS / f"{name}.json"
    path.write_text(json.dumps(plain, indent=1) + "\n")
    return path


def _processor() -> str:
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("model name"):
            return line.split(":", 1)[1].strip()
    return platform.machine()
