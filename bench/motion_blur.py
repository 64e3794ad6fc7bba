"""Motion blur against the path-traced mean over many instants: what more instants cost, and what they are worth."""

from __future__ import annotations

import time
from collections.abc import Collection
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from bench.places.l_shaped_room import l_shaped_room
from bench.places.place import Place
from bench.run import RESULTS
from bench.truth import Estimate, cached, content_hash, path_trace
from lightdepth.film.frame import Frame
from lightdepth.images.png import write_png
from lightdepth.images.tonemapping import tone_map
from lightdepth.kernel.start import start
from lightdepth.scene.identity import scene_digest
from lightdepth.scene.model import AnalyticShape, CameraView, Scene, SyntheticObject
from lightdepth.sequence.film_motion import needed_instants
from lightdepth.sequence.motion_blur import MotionBlur
from lightdepth.session.session import Job

TRUE_INSTANTS = 64
INSTANTS = (1, 4, 8, 16)
SHIFT = np.array([0.25, -0.1, 0.0])
"""Way of the objects, or of the camera, while the shutter is open, metres."""


@dataclass(frozen=True)
class Spent:
    """Sizes and samples a pixel."""

    photograph: int
    photograph_samples: int
    width: int
    truth_samples: int
    samples: int


FULL, QUICK = Spent(512, 256, 160, 64, 64), Spent(128, 64, 128, 16, 64)


def measure(quick: bool, console: Console) -> dict[str, Any]:
    """A table of errors and times, and pictures beside it."""
    start("cpu")
    spent = QUICK if quick else FULL
    place = l_shaped_room("mixed")
    scene = place.scene(spent.photograph, spent.photograph_samples, spent.width)
    rows = []
    for moving in ("objects", "camera"):
        moments = [_at(place, scene.cameras["view"], moving, at) for at in (-0.5, 0.0, 0.5)]
        scenes = [replace(scene, synthetic=there.objects) for there, _ in moments]
        chosen = needed_instants(scenes, [view for _, view in moments], max(INSTANTS))
        full, empty = (mean_truth(place, moving, spent, objects) for objects in (True, False))
        for count in sorted({*INSTANTS, chosen}):
            began = time.process_time()
            frame = rendered(scene, place, moving, count, spent)
            seconds = time.process_time() - began
            error, signed = errors(frame, full, empty, moving)
            rows.append(
                [
                    moving,
                    f"{count}{' (chosen)' if count == chosen else ''}",
                    f"{100 * error:.2f} %",
                    f"{100 * signed:+.2f} %",
                    f"{seconds:.1f}",
                ]
            )
            console.print("   ".join(rows[-1]), highlight=False)
            _write(f"motion-blur-{moving}-{count}", _picture(frame, empty, moving))
        _write(f"motion-blur-{moving}-truth", full.mean)
    return {
        "title": f"Motion blur, {spent.width} pixels wide, {spent.samples} samples a pixel in all, against the path-traced "
        f"mean over {TRUE_INSTANTS} instants",
        "head": ["moves", "instants", "error", "signed", "CPU s"],
        "rows": rows,
    }


def _times(count: int) -> NDArray[np.float64]:
    return (np.arange(count) + 0.5) / count - 0.5


def _moved(things: tuple[SyntheticObject, ...], way: NDArray[np.float64]) -> tuple[SyntheticObject, ...]:
    moved = []
    for thing in things:
        parts = []
        for part in thing.parts:
            geometry = part.geometry
            if isinstance(geometry, AnalyticShape):
                to_world = geometry.to_world.copy()
                to_world[:3, 3] += way
                parts.append(replace(part, geometry=replace(geometry, to_world=to_world)))
            else:
                vertices = (geometry.vertices + way).astype(np.float32)
                parts.append(replace(part, geometry=replace(geometry, vertices=vertices)))
        moved.append(replace(thing, parts=tuple(parts)))
    return tuple(moved)


def _at(place: Place, view: CameraView, moving: str, time: float) -> tuple[Place, CameraView]:
    """The place and the camera at a time from -0.5 to 0.5."""
    if moving == "objects":
        return replace(place, objects=_moved(place.objects, time * SHIFT)), view
    position = view.position + time * SHIFT
    camera = view.camera.model_copy(update={"position": tuple(position.tolist())})
    return place, CameraView(camera, position, view.rotation)


def mean_truth(place: Place, moving: str, spent: Spent, objects: bool) -> Estimate:
    """The path-traced mean over ``TRUE_INSTANTS`` instants, with or without the objects."""
    import mitsuba as mi

    view = place.camera("view", spent.width)
    times = _times(TRUE_INSTANTS) if objects or moving == "camera" else np.zeros(1)
    samples = spent.truth_samples * (1 if len(times) > 1 else TRUE_INSTANTS)

    def make() -> Estimate:
        estimates = []
        for number, at in enumerate(times):
            there, camera = _at(place, view, moving, float(at))
            scene = mi.load_dict(there.mitsuba_scene(objects), optimize=False)
            estimates.append(path_trace(scene, camera, samples, seed=100 + number + 1000 * objects))
        return replace(
            estimates[0],
            mean=np.mean([each.mean for each in estimates], axis=0),
            variance=np.sum([each.variance for each in estimates], axis=0) / len(estimates) ** 2,
            coverage=np.mean([each.coverage for each in estimates], axis=0),
        )

    key = content_hash("motion blur", place.name, place.objects, moving, SHIFT, times, view, samples, objects)
    return cached(key, make)


class _Kept:
    """Takes the finished frame."""

    file: Path | None = None
    frame: Frame

    def __init__(self, layers: Collection[str] | None) -> None:
        self.layers = layers

    def show(self, frame: Frame, finished: bool) -> None:
        self.frame = frame


def rendered(
    scene: Scene, place: Place, moving: str, count: int, spent: Spent, number: int = 0, sharing: int | None = None
) -> Frame:
    """A frame with motion blur, of ``count`` instants.

    Args:
        scene: the place.
        place: the same.
        moving: ``objects`` or ``camera``.
        count: how many instants.
        spent: samples.
        number: of the frame, each of which goes on where the one before ends; 0 is that of the truth.
        sharing: frames that share its samples; ``None`` for a frame of its own.
    """
    scenes = []
    for at in _times(count):
        there, camera = _at(place, scene.cameras["view"], moving, float(at) + number)
        scenes.append(replace(scene, synthetic=there.objects, cameras={"view": camera}))
    kept = _Kept(("variance",) if sharing is None else None)
    job = Job(camera="view", samples=spent.samples, seed=5 + 100 * number % 10007, cache=False, sharing=sharing)
    MotionBlur(scenes, job).render([kept], "cpu", lambda event: None)
    return kept.frame


def shared(scene: Scene, place: Place, moving: str, count: int, spent: Spent, reach: int) -> tuple[Frame, Frame]:
    """A frame with motion blur as its own samples give it, and with those of the frames around it."""
    from lightdepth.sequence.temporal_reuse import SampledFrame, reuse

    sampled = {}
    for number in range(-reach, reach + 1):
        frame = rendered(scene, place, moving, count, spent, number, reach + 1)
        there, view = _at(place, scene.cameras["view"], moving, float(number))
        digest = scene_digest(replace(scene, synthetic=there.objects))
        sampled[number] = SampledFrame(frame, view, digest)
    sides = [[sampled[sign * away] for away in range(1, reach + 1)] for sign in (-1, 1)]
    return sampled[0].frame, reuse(sampled[0].frame, sampled[0], sides)


def _picture(frame: Frame, empty: Estimate, moving: str) -> NDArray[np.float64]:
    """The picture; where the camera stands, on the path-traced empty place, so that its error is that of the new light."""
    if moving == "camera":
        return frame.beauty.astype(np.float64)
    return empty.mean * (1.0 - frame.coverage[..., None]) + frame.change + frame.synthetic


def errors(frame: Frame, full: Estimate, empty: Estimate, moving: str) -> tuple[float, float]:
    """Relative root mean square error, without the noise of the truth, and signed error, of the pixels that change."""
    image = _picture(frame, empty, moving)
    changed = (np.abs(full.mean - empty.mean).max(axis=2) > 0.05 * empty.mean.mean()) | (full.coverage > 0.0)
    error = (image - full.mean)[changed]
    noise = full.variance[changed].mean() + (empty.variance[changed].mean() if moving == "objects" else 0.0)
    level = full.mean[changed].mean()
    return float(np.sqrt(max((error**2).mean() - noise, 0.0)) / level), float(error.mean() / level)


def _write(name: str, radiance: NDArray[np.float64]) -> None:
    RESULTS.mkdir(parents=True, exist_ok=True)
    write_png(RESULTS / f"{name}.png", tone_map(radiance.astype(np.float32), 1.0))
