"""One, two and three captures of a room: what stays hidden, and what a camera that travels 4 m sees of it.

``python -m bench captures``. The L-shaped room is photographed from up to three capture points; a camera goes from the
first one around the corner into the far leg, whose walls the first one does not see.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
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
from bench.places import l_shaped_room
from bench.places.objects import Point
from bench.places.place import Place
from bench.run import RESULTS
from bench.truth import Estimate, on_plate, photograph, truth
from lightdepth.cameras import Perspective
from lightdepth.checks.sampling import unseen_shares
from lightdepth.checks.view import look_around
from lightdepth.kernel.start import start
from lightdepth.scene.meshes.geometry import face_areas
from lightdepth.scene.model import Panorama, RenderSettings, Scene

CAPTURES: tuple[Point, ...] = ((-1.2, -0.4, 1.5), (2.0, 2.6, 1.5), (1.9, -1.2, 1.5))
"""The first is the room's own; the second stands in the far leg, the third in the corner between."""
WAY: tuple[Point, ...] = ((-1.2, -0.8, 1.5), (1.9, -0.3, 1.5), (2.1, 0.6, 1.5))
TARGETS: tuple[Point, ...] = ((0.75, 0.5, 0.4), (1.4, 1.8, 0.8), (1.5, 4.0, 1.0))
FOV = 65.0
ENLARGED = 2
"""Times that the picture's pixels are repeated."""
KEPT = RESULTS / "captures.json"
PICTURE = Path(__file__).parents[1] / "docs" / "pictures" / "captures-l-shaped-room.jpg"


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


def on_way(share: float) -> tuple[Point, Point]:
    """Position and target of the camera at a share of its way."""
    legs = np.linalg.norm(np.diff(WAY, axis=0), axis=1)
    ends = np.concatenate([[0.0], np.cumsum(legs)]) / legs.sum()
    position, target = (
        tuple(float(np.interp(share, ends, column)) for column in np.transpose(points)) for points in (WAY, TARGETS)
    )
    return position, target  # type: ignore[return-value]


def seen_from(place: Place, share: float, width: int) -> Place:
    """The place with its camera ``view`` at a share of the way."""
    position, target = on_way(share)
    height = 3 * width // 4
    view = Perspective(type="perspective", width=width, height=height, fov=FOV, position=position, look_at=target)
    return replace(place, view=view)


def shares_of_way(effort: Effort) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Shares of the way of the frames for the error, and of those close together."""
    length = float(np.linalg.norm(np.diff(WAY, axis=0), axis=1).sum())
    close = 0.6 + (np.arange(effort.close) - effort.close // 2) * 0.04 / length
    return np.linspace(0.0, 1.0, effort.frames), close


def captured(place: Place, count: int, effort: Effort) -> Scene:
    """The scene of the first ``count`` captures."""
    first = replace(place, position=CAPTURES[0]).scene(*effort.photograph)
    further = []
    for position in CAPTURES[1:count]:
        there = replace(place, position=position)
        seen = photograph(there, *effort.photograph).mean.astype(np.float32)
        further.append(Panorama(seen, np.asarray(position), there.camera("panorama", 8).rotation))
    settings = RenderSettings(irradiance_samples=effort.irradiance_samples)
    return replace(first, further=tuple(further), render=settings)


def captures(quick: bool, console: Console) -> dict[str, Any]:
    """Measure; write ``bench/results/captures.json`` and the picture.

    Returns:
        A table: title, head and rows.
    """
    start()
    effort = QUICK if quick else FULL
    place = l_shaped_room("mixed")
    far, close = shares_of_way(effort)
    truths, empties = ([_truth(place, s, effort, objects) for s in far] for objects in (True, False))
    close_truth = [_truth(place, s, effort, False).mean for s in close]
    rows, strips = [], [np.concatenate([each.mean for each in truths[:: len(truths) // 3]], axis=1)]
    for count in range(1, len(CAPTURES) + 1):
        scene = captured(place, count, effort)
        row, strip = _measured(scene, place, effort, truths, empties, close_truth)
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
        f"l_shaped_room, a camera that travels 4 m in {effort.frames} frames, {effort.width} pixels wide; panoramas of "
        f"{effort.photograph[0]} pixels with {effort.photograph[1]} samples"
    )
    table = {"title": title, "head": head, "rows": rows}
    RESULTS.mkdir(parents=True, exist_ok=True)
    KEPT.write_text(json.dumps(table, indent=1) + "\n")
    exposure = 0.4 / float(np.median(strips[0]))
    shown = np.concatenate([display(exposure * strip) for strip in strips])
    enlarged = shown.repeat(ENLARGED, axis=0).repeat(ENLARGED, axis=1)
    cv2.imwrite(str(PICTURE), (255.0 * enlarged[..., ::-1] + 0.5).astype(np.uint8))
    return table


def _truth(place: Place, share: float, effort: Effort, objects: bool) -> Estimate:
    return truth(seen_from(place, share, effort.width), "view", effort.width, effort.truth_samples, objects)


def _measured(
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
    far, close = shares_of_way(effort)
    errors: dict[str, list[float]] = {"untouched": [], "influenced": []}
    frames = []
    for share, full, empty in zip(far, truths, empties, strict=True):
        camera = seen_from(place, share, effort.width).camera("view", effort.width)
        viewed = replace(scene, cameras={"view": camera})
        frame = lightdepth.render(viewed, camera="view", samples=effort.samples)
        picture = frame.beauty.astype(np.float64)
        frames.append(picture)
        wanted = replace(full, variance=full.variance + empty.variance)
        for region, mask in find_regions(wanted, empty.mean).items():
            if region in errors and mask.sum() > 16:
                reference = on_plate(full, empty)
                squared = np.mean((picture - full.mean)[mask] ** 2) - reference.variance[mask].mean()
                errors[region].append(float(max(squared, 0.0)) / float(full.mean[mask].mean()) ** 2)
    prepared = prepare_place(scene)
    plates = []
    for share in close:
        camera = seen_from(place, share, effort.width).camera("view", effort.width)
        plates.append(render_plate(camera, scene.panoramas, prepared.place, gains=prepared.gains)[0])
    jump = _largest_change(plates) / _largest_change(close_truth)
    untouched, influenced = (np.sqrt(np.mean(errors[region])) for region in ("untouched", "influenced"))
    row = [f"{100.0 * share_hidden:.1f} %", f"{100.0 * untouched:.2f} %", f"{100.0 * influenced:.2f} %", f"{jump:.2f}"]
    return row, np.concatenate(frames[:: len(frames) // 3], axis=1)


def _largest_change(frames: Sequence[NDArray]) -> float:
    """The largest over the frames of the change that one pixel in a hundred exceeds."""
    return max(float(np.quantile(np.abs(after - before).mean(axis=-1), 0.99)) for before, after in pairwise(frames))
