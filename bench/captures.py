"""One, two and three captures of a room: what stays hidden, and what a camera that travels 4 m sees of it.

``python -m bench captures``. Each room is photographed from up to three capture points; a camera goes from the first one
to where the first one does not see.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from rich.console import Console

import lightdepth
from bench.measures import display, find_regions
from bench.places import l_shaped_room, studio_flat
from bench.places.objects import Point
from bench.places.place import Place
from bench.run import RESULTS
from bench.truth import Estimate, photograph, truth
from lightdepth.cameras import Perspective
from lightdepth.checks.sampling import unseen_shares
from lightdepth.checks.view import look_around
from lightdepth.kernel.start import start
from lightdepth.scene.meshes.geometry import face_areas
from lightdepth.scene.model import Panorama, RenderSettings, Scene


@dataclass(frozen=True)
class Journey:
    """Capture points of a place, and a camera that travels through it.

    Attributes:
        place: what is photographed.
        points: where from; the first is the place's own.
        way: corners of the way that the camera goes, 4 m long.
        targets: what it looks at there.
    """

    place: Callable[[str], Place]
    points: tuple[Point, ...]
    way: tuple[Point, ...]
    targets: tuple[Point, ...]

    @property
    def length(self) -> float:
        """Metres of the way."""
        return float(np.linalg.norm(np.diff(self.way, axis=0), axis=1).sum())

    def at(self, share: float) -> tuple[Point, Point]:
        """Position and target of the camera at a share of its way."""
        legs = np.linalg.norm(np.diff(self.way, axis=0), axis=1)
        ends = np.concatenate([[0.0], np.cumsum(legs)]) / legs.sum()
        position, target = (
            tuple(float(np.interp(share, ends, column)) for column in np.transpose(points))
            for points in (self.way, self.targets)
        )
        return position, target  # type: ignore[return-value]

    def seen(self, place: Place, share: float, width: int) -> Place:
        """The place with its camera ``view`` at a share of the way."""
        position, target = self.at(share)
        size = {"width": width, "height": 3 * width // 4}
        return replace(place, view=Perspective(type="perspective", **size, fov=FOV, position=position, look_at=target))

    def shares(self, effort: Effort) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Shares of the way of the frames for the error, and of those close together."""
        close = 0.6 + (np.arange(effort.close) - effort.close // 2) * 0.04 / self.length
        return np.linspace(0.0, 1.0, effort.frames), close


JOURNEYS = {
    # Around the inner corner into the far leg, where the second capture stands; the third is in the corner between.
    "l_shaped_room": Journey(
        l_shaped_room,
        ((-1.2, -0.4, 1.5), (2.0, 2.6, 1.5), (1.9, -1.2, 1.5)),
        ((-1.2, -0.8, 1.5), (1.9, -0.3, 1.5), (2.1, 0.6, 1.5)),
        ((0.75, 0.5, 0.4), (1.4, 1.8, 0.8), (1.5, 4.0, 1.0)),
    ),
    # Past the bookcase into the part behind it. The second capture is in the passage, the third behind the bookcase.
    "studio_flat": Journey(
        studio_flat,
        ((-1.3, 0.9, 1.5), (1.0, -1.35, 1.5), (1.7, 1.2, 1.5)),
        ((-1.6, 0.5, 1.5), (0.0, -1.3, 1.5), (1.4, -0.6, 1.5)),
        ((0.0, -1.0, 0.8), (1.4, 0.3, 0.6), (1.5, 1.7, 0.5)),
    ),
}
FOV = 65.0
ENLARGED = 2
"""Times that the picture's pixels are repeated."""
KEPT = RESULTS / "captures.json"
PICTURES = Path(__file__).parents[1] / "docs" / "pictures"


@dataclass(frozen=True)
class Effort:
    """How much is spent.

    Attributes:
        photograph: width and samples of each panorama.
        width: of the travelling camera's pictures.
        frames: along its way, for the error.
        close: frames 4 cm apart in the middle of the way, for jumps.
        truth_samples: camera rays a pixel of the truth.
        samples: of the renderings.
        irradiance_samples: as the scene's setting.
    """

    photograph: tuple[int, int]
    width: int
    frames: int
    close: int
    truth_samples: int
    samples: int
    irradiance_samples: int


FULL = Effort((1024, 256), 192, 17, 25, 1024, 256, 1024)
QUICK = Effort((512, 64), 96, 7, 9, 256, 64, 256)


def captured(journey: Journey, place: Place, count: int, effort: Effort) -> Scene:
    """The scene of the first ``count`` captures."""
    first = replace(place, position=journey.points[0]).scene(*effort.photograph)
    further = []
    for position in journey.points[1:count]:
        there = replace(place, position=position)
        seen = photograph(there, *effort.photograph).mean.astype(np.float32)
        further.append(Panorama(seen, np.asarray(position), there.camera("panorama", 8).rotation))
    settings = RenderSettings(irradiance_samples=effort.irradiance_samples)
    return replace(first, further=tuple(further), render=settings)


def captures(names: Sequence[str], quick: bool, panorama_samples: int | None, console: Console) -> list[dict[str, Any]]:
    """Measure; write ``bench/results/captures.json``, where other places keep their figures, and a picture of each place.

    Args:
        names: of :data:`JOURNEYS`.
        quick: small images and few samples.
        panorama_samples: a pixel of the panoramas; by default as ``quick`` says.
        console: where progress is shown.

    Returns:
        A table for each place: title, head and rows.
    """
    start()
    effort = QUICK if quick else FULL
    if panorama_samples is not None:
        effort = replace(effort, photograph=(effort.photograph[0], panorama_samples))
    kept = json.loads(KEPT.read_text()) if KEPT.is_file() else {}
    for name in names:
        kept[name] = _table(name, JOURNEYS[name], effort, console)
        RESULTS.mkdir(parents=True, exist_ok=True)
        KEPT.write_text(json.dumps({each: kept[each] for each in JOURNEYS if each in kept}, indent=1) + "\n")
    return [kept[name] for name in names]


def _table(name: str, journey: Journey, effort: Effort, console: Console) -> dict[str, Any]:
    place = journey.place("mixed")
    far, close = journey.shares(effort)

    def path_traced(share: float, objects: bool) -> Estimate:
        seen = journey.seen(place, share, effort.width)
        return truth(seen, "view", effort.width, effort.truth_samples, objects)

    truths, empties = ([path_traced(share, objects) for share in far] for objects in (True, False))
    close_truth = [path_traced(share, False).mean for share in close]
    rows, strips = [], [np.concatenate([each.mean for each in truths[:: len(truths) // 3]], axis=1)]
    for count in range(1, len(journey.points) + 1):
        scene = captured(journey, place, count, effort)
        row, strip = _measured(journey, scene, place, effort, truths, empties, close_truth)
        rows.append([str(count), *row])
        strips.append(strip)
        console.print("  ".join(rows[-1]), highlight=False)
    head = [
        "captures",
        "area that none sees",
        "untouched pixels, RMSE",
        "influenced pixels, RMSE",
        "largest change from frame to frame, of the truth's",
    ]
    title = (
        f"{name}, a camera that travels 4 m in {effort.frames} frames, {effort.width} pixels wide; panoramas of "
        f"{effort.photograph[0]} pixels with {effort.photograph[1]} samples"
    )
    exposure = 0.4 / float(np.median(strips[0]))
    shown = np.concatenate([display(exposure * strip) for strip in strips])
    enlarged = shown.repeat(ENLARGED, axis=0).repeat(ENLARGED, axis=1)
    picture = PICTURES / f"captures-{name.replace('_', '-')}.jpg"
    cv2.imwrite(str(picture), (255.0 * enlarged[..., ::-1] + 0.5).astype(np.uint8))
    return {"title": title, "head": head, "rows": rows, "picture": picture.name}


def _measured(
    journey: Journey,
    scene: Scene,
    place: Place,
    effort: Effort,
    truths: Sequence[Estimate],
    empties: Sequence[Estimate],
    close_truth: Sequence[NDArray[np.float64]],
) -> tuple[list[str], NDArray[np.float64]]:
    """Figures of a scene, and some of its frames side by side."""
    from lightdepth.film.plate import render_plate
    from lightdepth.preparation.place import prepare_place

    areas = {surface.name: face_areas(surface.mesh.vertices, surface.mesh.faces).sum() for surface in scene.real}
    hidden = unseen_shares(scene, [look_around(scene, panorama) for panorama in scene.panoramas])
    share_hidden = sum(hidden[name] * area for name, area in areas.items()) / sum(areas.values())
    far, close = journey.shares(effort)
    errors: dict[str, list[float]] = {"untouched": [], "influenced": []}
    frames = []
    for share, full, empty in zip(far, truths, empties, strict=True):
        camera = journey.seen(place, share, effort.width).camera("view", effort.width)
        viewed = replace(scene, cameras={"view": camera})
        frame = lightdepth.render(viewed, camera="view", samples=effort.samples)
        picture = frame.beauty.astype(np.float64)
        frames.append(picture)
        wanted = replace(full, variance=full.variance + empty.variance)
        for region, mask in find_regions(wanted, empty.mean).items():
            if region in errors and mask.sum() > 16:
                squared = np.mean((picture - full.mean)[mask] ** 2) - full.variance[mask].mean()
                errors[region].append(float(max(squared, 0.0)) / float(full.mean[mask].mean()) ** 2)
    prepared = prepare_place(scene)
    plates = []
    for share in close:
        camera = journey.seen(place, share, effort.width).camera("view", effort.width)
        plates.append(render_plate(camera, scene.panoramas, prepared.place, gains=prepared.gains)[0])
    jump = _largest_change(plates) / _largest_change(close_truth)
    untouched, influenced = (np.sqrt(np.mean(errors[region])) for region in ("untouched", "influenced"))
    row = [f"{100.0 * share_hidden:.1f} %", f"{100.0 * untouched:.2f} %", f"{100.0 * influenced:.2f} %", f"{jump:.2f}"]
    return row, np.concatenate(frames[:: len(frames) // 3], axis=1)


def _largest_change(frames: Sequence[NDArray]) -> float:
    """The largest over the frames of the change that one pixel in a hundred exceeds."""
    return max(float(np.quantile(np.abs(after - before).mean(axis=-1), 0.99)) for before, after in pairwise(frames))
