"""The main measurement: every method on every place, in turn on this machine, as plain records."""

from __future__ import annotations

import datetime
import json
import os
import platform
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console

from bench.measures import find_regions, measure
from bench.methods.job import Shot
from bench.methods.registry import Method, available
from bench.places import PLACES
from bench.places.place import Place
from bench.places.wrong import WRONG
from bench.truth import Estimate, photograph, truth
from lightdepth.kernel.start import start

RESULTS = Path(__file__).parent / "results"


@dataclass(frozen=True)
class Effort:
    """How much is spent.

    Attributes:
        photograph: width and samples of the panoramas that the methods are given.
        cameras: width of each camera's image.
        truth_samples: camera rays a pixel of the truth.
        budgets: samples a pixel that each method is given.
        repeats: how often everything is timed.
        places: names of the places.
        objects: the object set.
    """

    photograph: tuple[int, int]
    cameras: dict[str, int]
    truth_samples: int
    budgets: tuple[int, ...]
    repeats: int
    places: tuple[str, ...] = tuple(PLACES)
    objects: str = "mixed"


QUICK = Effort((128, 512), {"view": 64}, 512, (4, 16), 1)
FULL = Effort((512, 512), {"view": 192, "panorama": 256}, 1024, (4, 16, 64), 3)


def take_shot(place: Place, camera: str, effort: Effort) -> tuple[Shot, Estimate]:
    """A place as the methods are given it through one camera, and the truth.

    The plate is the empty place path-traced through the same camera: all methods composite into the same one, so that
    what is compared is what they add, not how a panorama is resampled.
    """
    width = effort.cameras[camera]
    panorama = photograph(place, *effort.photograph).mean.astype(np.float32)
    empty = truth(place, camera, width, effort.truth_samples, objects=False, seed=3)
    full = truth(place, camera, width, effort.truth_samples)
    full = Estimate(full.mean, full.variance + empty.variance, full.coverage, full.samples, full.seconds)
    return Shot(place, panorama, place.camera(camera, width), empty.mean, full.coverage), full


def measured(
    name: str, method: Method, shot: Shot, full: Estimate, effort: Effort, denoise: bool, console: Console
) -> Iterator[dict[str, Any]]:
    """Records of one method on one shot."""
    regions = find_regions(full, shot.plate)
    try:
        runs = [method.render(shot, effort.budgets, denoise) for _ in range(effort.repeats)]
    except RuntimeError as error:  # A peer that fails is reported, not fatal.
        console.print(f"  {name}: {error}", style="red", markup=False)
        return
    for index, samples in enumerate(effort.budgets):
        image = runs[0][index].image
        yield {
            "method": name,
            "denoised": denoise,
            "samples": samples,
            "seconds": [round(run[index].seconds, 4) for run in runs],
            "measures": measure(image, full, regions),
            "image": image,
        }


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
        for camera in effort.cameras:
            console.print(f"{name}, {camera}: truth", highlight=False)
            for model, place in variants.items():
                if model != "exact" and camera != "view":
                    continue
                shot, full = take_shot(place, camera, effort)
                for denoise in (False, True) if model == "exact" else (False,):
                    for key, method in methods.items():
                        if model != "exact" and key not in ("difference", "directional", "envpath"):
                            continue
                        console.print(f"{name}, {camera}, {model}: {key}{', denoised' * denoise}", highlight=False)
                        for record in measured(key, method, shot, full, effort, denoise, console):
                            records.append({"place": name, "model": model, "camera": camera, **record})
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
