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
NEAR = 0.02
"""Two frames show the same point where their distances from it differ by less than this share."""


@dataclass(frozen=True)
class Spent:
    """Sizes, and samples a pixel."""

    photograph: int
    photograph_samples: int
    width: int
    frames: int
    truth_samples: int
    converged: int
    samples: int


FULL, QUICK = Spent(512, 256, 240, 24, 1024, 4096, 16), Spent(256, 64, 120, 12, 256, 1024, 16)


def measure(quick: bool, console: Console) -> dict[str, Any]:
    """A table of flicker, errors and times, and pictures beside it."""
    start("cpu")
    spent = QUICK if quick else FULL
    place = l_shaped_room("mixed")
    scene = place.scene(spent.photograph, spent.photograph_samples, spent.width)
    views = travelling(place, spent)
    true = truths(place, views, spent)
    middle = spent.frames // 2
    alone, seconds = _rendered(scene, views, spent.samples, None)
    reference = _rendered(scene, views[middle : middle + 1], spent.converged, None)[0][0]
    floor = flicker([replace_beauty(each, seen) for each, seen in zip(alone, true, strict=True)], views)
    rows = [["path-traced truth", "", f"{100 * floor:.2f} %", "", "", ""]]

    def add(name: str, frames: Sequence[Frame], seconds: float) -> None:
        for denoised in (False, True):
            pictures = [denoise(frame) for frame in frames] if denoised else list(frames)
            error, signed = errors(pictures[middle], true[middle])
            rows.append(
                [
                    name,
                    "yes" if denoised else "no",
                    f"{100 * flicker(pictures, views):.2f} %",
                    f"{100 * noise(pictures[middle], reference):.2f} %",
                    f"{100 * error:.2f} % ({100 * signed:+.2f} %)",
                    f"{seconds:.2f}",
                ]
            )
            console.print("   ".join(rows[-1]), highlight=False)
            _write(f"flicker-{name.replace(' ', '-')}{'-denoised' if denoised else ''}", pictures[middle].beauty)

    add("each frame alone", alone, seconds)
    add("all with one seed", *_rendered(scene, views, spent.samples, None, same_seed=True))
    for reach in REACHES:
        frames, rendering = _rendered(scene, views, spent.samples, reach + 1)
        began = time.process_time()
        steady = steadied(frames, views, reach)
        add(f"reuse of {reach} to each side", steady, rendering + (time.process_time() - began) / len(frames))
    _write("flicker-truth", true[middle].mean)
    return {
        "title": f"A travelling camera over objects at rest, {spent.frames} frames, {spent.width} pixels wide, "
        f"{spent.samples} samples a pixel: the support that the objects change",
        "head": ["", "denoised", "flicker", "noise", "error (signed)", "CPU s a frame"],
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


def truths(place: Place, views: Sequence[CameraView], spent: Spent) -> list[Estimate]:
    """Every frame path-traced."""
    import mitsuba as mi

    estimates = []
    for number, view in enumerate(views):

        def make(view: CameraView = view, number: int = number) -> Estimate:
            scene = mi.load_dict(place.mitsuba_scene(True), optimize=False)
            return path_trace(scene, view, spent.truth_samples, seed=500 + number)

        key = content_hash("flicker", place.name, place.objects, view, spent.truth_samples, number)
        estimates.append(cached(key, make))
    return estimates


def _rendered(
    scene: Scene, views: Sequence[CameraView], samples: int, sharing: int | None, same_seed: bool = False
) -> tuple[list[Frame], float]:
    """Frames of their own samples, and the CPU time of one after the first."""
    frames, seconds = [], []
    for number, view in enumerate(views):
        began = time.process_time()
        seed = SEED if same_seed else frame_seed(SEED, number)
        there = replace(scene, cameras={"view": view})
        frames.append(begin_rendering(there, "view", seed=seed, cache=False, sharing=sharing or 1).complete(samples))
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


def replace_beauty(frame: Frame, true: Estimate) -> Frame:
    """A frame whose finished picture is the truth."""
    change = (true.mean - frame.plate * (1.0 - frame.coverage[..., None]) - frame.synthetic).astype(np.float32)
    return replace(frame, change=change)


def flicker(frames: Sequence[Frame], views: Sequence[CameraView]) -> float:
    """Standard deviation from frame to frame at the same points of matte support, relative to the photograph there.

    Each pixel is compared with the nearest one of the next frame that shows the same point. Half of the squared
    difference of two independent values is their variance.
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


def noise(frame: Frame, reference: Frame) -> float:
    """Root mean square difference from the converged frame, relative to the photograph, on the support."""
    both = _changed(frame) & _changed(reference)
    return float(np.sqrt(np.square(_relative(frame) - _relative(reference))[both].mean()))


def errors(frame: Frame, true: Estimate) -> tuple[float, float]:
    """Relative root mean square error, without the noise of the truth, and signed error, on the support."""
    support = _changed(frame)
    error = (frame.beauty - true.mean)[support]
    level = true.mean[support].mean()
    square = float((error**2).mean() - true.variance[support].mean())
    return float(np.sqrt(max(square, 0.0)) / level), float(error.mean() / level)


def _write(name: str, radiance: NDArray[np.floating]) -> None:
    RESULTS.mkdir(parents=True, exist_ok=True)
    write_png(RESULTS / f"{name}.png", tone_map(radiance.astype(np.float32), 1.0))
