"""Flicker under a travelling camera: how much what does not change differs from frame to frame, with and without reuse."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from bench.places.l_shaped_room import l_shaped_room
from bench.places.place import Place
from bench.run import RESULTS
from bench.truth import Estimate, cached, content_hash, path_trace
from lightdepth.api import begin_rendering
from lightdepth.film.denoising import denoise
from lightdepth.film.frame import Frame
from lightdepth.images.png import write_png
from lightdepth.images.tonemapping import tone_map
from lightdepth.kernel.arrays import aligned_columns
from lightdepth.kernel.start import start
from lightdepth.scene.model import CameraView, Scene
from lightdepth.sequence.fingerprint import frame_seed

WAY = np.array([0.5, -0.2, 0.0])
"""Of the camera over all frames, metres."""
SEED, REACHES = 7, (2, 4, 8)
MORE = 8
"""Times the samples of a frame alone that is to be as free of noise."""
NEAR = 0.02
"""Two frames show the same point where their distances from it differ by less than this share,"""
OFFSET = 0.15
"""and it is less than so many pixels off the middle of a pixel in both: else the picture's own detail would flicker."""


@dataclass(frozen=True)
class Spent:
    """Sizes, and samples a pixel."""

    photograph: int
    photograph_samples: int
    width: int
    frames: int
    truth_samples: int
    samples: int


FULL, QUICK = Spent(512, 256, 240, 24, 1024, 16), Spent(256, 64, 120, 12, 256, 16)


def measure(quick: bool, console: Console) -> dict[str, Any]:
    """A table of flicker, errors and times, and pictures beside it."""
    start("cpu")
    spent = QUICK if quick else FULL
    place = l_shaped_room("mixed")
    scene = place.scene(spent.photograph, spent.photograph_samples, spent.width)
    views = travelling(place, spent)
    true = [truths(place, views, spent, objects) for objects in (True, False)]
    rows: list[list[str]] = []

    def add(name: str, frames: Sequence[Frame], seconds: float, denoised: bool = False) -> None:
        pictures = [denoise(frame) for frame in frames] if denoised else frames
        error, signed = errors(pictures, *true)
        steadiness = f"{100 * flicker(pictures, views):.2f} %"
        cost = "" if denoised else f"{seconds:.2f}"
        rows.append(
            [name, "yes" if denoised else "no", steadiness, f"{100 * error:.2f} %", f"{100 * signed:+.2f} %", cost]
        )
        console.print("   ".join(rows[-1]), highlight=False)
        middle = pictures[len(pictures) // 2].beauty
        _write(f"flicker-{name.replace(' ', '-').replace(',', '')}{'-denoised' if denoised else ''}", middle)

    for name, samples, same in (
        ("each frame alone", spent.samples, False),
        ("each frame alone, all with one seed", spent.samples, True),
        (f"each frame alone, {MORE * spent.samples} samples", MORE * spent.samples, False),
    ):
        frames, seconds = _rendered(scene, views, samples, 1, same)
        add(name, frames, seconds)
        if samples == spent.samples:
            add(name, frames, seconds, denoised=True)
    for reach in REACHES:
        frames, seconds = _rendered(scene, views, spent.samples, reach + 1, False)
        began = time.process_time()
        steady = steadied(frames, views, reach)
        seconds += (time.process_time() - began) / len(frames)
        for denoised in (False, True):
            add(f"{reach} frames to each side shared", steady, seconds, denoised)
    return {
        "title": f"A travelling camera over objects at rest, {spent.frames} frames, {spent.width} pixels wide, "
        f"{spent.samples} samples a pixel: matte support",
        "head": ["", "denoised", "flicker", "error", "signed", "CPU s a frame"],
        "rows": rows,
    }


def travelling(place: Place, spent: Spent) -> list[CameraView]:
    """The camera at each frame."""
    view = place.camera("view", spent.width)
    moved = []
    for at in np.linspace(-0.5, 0.5, spent.frames):
        position = view.position + at * WAY
        camera = view.camera.model_copy(update={"position": tuple(position.tolist())})
        moved.append(CameraView(camera, position, view.rotation))
    return moved


def truths(place: Place, views: Sequence[CameraView], spent: Spent, objects: bool) -> list[Estimate]:
    """Every frame path-traced, with or without the objects."""
    import mitsuba as mi

    estimates = []
    for number, view in enumerate(views):

        def make(view: CameraView = view, number: int = number) -> Estimate:
            scene = mi.load_dict(place.mitsuba_scene(objects), optimize=False)
            return path_trace(scene, view, spent.truth_samples, seed=500 + number + 1000 * (not objects))

        seen = place.objects if objects else ()
        key = content_hash("flicker", place.name, seen, view, spent.truth_samples, number)
        estimates.append(cached(key, make))
    return estimates


def _rendered(
    scene: Scene, views: Sequence[CameraView], samples: int, sharing: int, same_seed: bool
) -> tuple[list[Frame], float]:
    """Frames of their own samples, and the CPU time of one after the first."""
    frames, seconds = [], []
    for number, view in enumerate(views):
        began = time.process_time()
        seed = SEED if same_seed else frame_seed(SEED, number)
        there = replace(scene, cameras={"view": view})
        frames.append(begin_rendering(there, "view", seed=seed, cache=False, sharing=sharing).complete(samples))
        seconds.append(time.process_time() - began)
    return frames, float(np.median(seconds))


def steadied(frames: Sequence[Frame], views: Sequence[CameraView], reach: int) -> list[Frame]:
    """Frames that share their samples."""
    from lightdepth.sequence.temporal_reuse import SampledFrame, reuse

    sampled = [SampledFrame(frame, view, "") for frame, view in zip(frames, views, strict=True)]
    return [
        reuse(each.frame, each, (sampled[max(at - reach, 0) : at][::-1], sampled[at + 1 : at + reach + 1]))
        for at, each in enumerate(sampled)
    ]


def flicker(frames: Sequence[Frame], views: Sequence[CameraView]) -> float:
    """Standard deviation from frame to frame at the same points of matte support, relative to the photograph there.

    Pixels are compared with those of the next frame that show the same point. Half of the squared difference of two
    independent values is their variance.
    """
    squares, count = 0.0, 0
    for (one, here), (other, there) in zip(
        zip(frames, views, strict=True), zip(frames[1:], views[1:], strict=True), strict=False
    ):
        changed = _changed(one)
        rows, columns = np.nonzero(changed)
        points = _points(one, here)[changed]
        film, inside = there.on_film(aligned_columns(points))
        width, height = there.resolution
        column = np.clip((film[:, 0] * width).astype(int), 0, width - 1)
        row = np.clip((film[:, 1] * height).astype(int), 0, height - 1)
        away = np.linalg.norm(points - there.position, axis=1)
        same = inside & _changed(other)[row, column]
        assert other.depth is not None
        same &= np.abs(other.depth[row, column] / away - 1.0) < NEAR
        off = np.abs(film * [width, height] - np.stack([column, row], axis=1) - 0.5)
        same &= (off < OFFSET).all(axis=1)
        difference = _relative(other)[row, column] - _relative(one)[rows, columns]
        squares += 0.5 * float(np.square(difference[same]).sum())
        count += int(same.sum())
    return float(np.sqrt(squares / count))


def _changed(frame: Frame) -> NDArray[np.bool_]:
    """Pixels that show nothing but matte support."""
    assert frame.support is not None
    return frame.support & (frame.coverage == 0.0)


def _relative(frame: Frame) -> NDArray[np.float64]:
    """The picture over the photograph, grey, in which the photograph cancels."""
    return frame.beauty.mean(axis=2, dtype=np.float64) / np.maximum(frame.plate.mean(axis=2), 1e-6)


def _points(frame: Frame, view: CameraView) -> NDArray[np.float64]:
    """What the pixels show in their middle, world, shape (height, width, 3)."""
    import drjit as dr
    import mitsuba as mi

    width, height = view.resolution
    index = dr.arange(mi.UInt32, width * height)
    seen = view.pixel_rays(mi.Float(index % width), mi.Float(index // width), mi.Point2f(0.5), mi.Point2f(0.5))
    directions = np.asarray(seen.ray.d).T.reshape(height, width, 3)
    return np.asarray(view.position + directions * np.asarray(frame.depth)[..., None], np.float64)


def errors(frames: Sequence[Frame], full: Sequence[Estimate], empty: Sequence[Estimate]) -> tuple[float, float]:
    """Root mean square and signed error of matte support's change, relative to the picture, without the truth's noise."""
    squares, signed, level, count = 0.0, 0.0, 0.0, 0
    for frame, new, old in zip(frames, full, empty, strict=True):
        support = _changed(frame) & (new.coverage == 0.0)
        error = (frame.change - (new.mean - old.mean))[support]
        squares += float((error**2).sum() - (new.variance + old.variance)[support].sum())
        signed, level, count = signed + float(error.sum()), level + float(new.mean[support].sum()), count + error.size
    return float(np.sqrt(max(squares / count, 0.0)) / (level / count)), signed / level


def _write(name: str, radiance: NDArray[np.floating]) -> None:
    RESULTS.mkdir(parents=True, exist_ok=True)
    write_png(RESULTS / f"{name}.png", tone_map(radiance.astype(np.float32), 1.0))
