"""Rendering a camera's image: which pixels are sampled, in passes that can be watched and stopped."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.cameras import Equirectangular
from lightdepth.film.accumulation import Accumulator
from lightdepth.film.auxiliary import render_auxiliary
from lightdepth.film.frame import Frame
from lightdepth.film.plate import render_plate
from lightdepth.film.selection import influenced_pixels
from lightdepth.kernel.opaque import opaque_matrix, opaque_point
from lightdepth.scene.model import CameraView, Scene
from lightdepth.transport.methods import Prepared
from lightdepth.transport.randoms import begin_path

LANES = 1 << 21
"""Paths followed at once; more gain no speed and cost memory."""
PILOT_SAMPLES = 16
"""Samples that every pixel gets before the rest is spent where the error is."""


@dataclass(frozen=True)
class Progress:
    """How far a rendering is.

    Attributes:
        fraction: share of the work that is done, in [0, 1].
        samples: samples per pixel so far, on average over the pixels that are sampled.
        error: estimated relative error of these pixels, root mean square.
        seconds_left: estimated.
    """

    fraction: float
    samples: float
    error: float
    seconds_left: float


class Rendering:
    """One camera's image in the making.

    Args:
        scene: what to render.
        prepared: the same scene made ready for a method.
        view: the camera.
        seed: of the random numbers; the same seed gives the same image.
    """

    def __init__(self, scene: Scene, prepared: Prepared, view: CameraView, seed: int) -> None:
        self._scene, self._prepared, self._view, self._seed = scene, prepared, view, seed
        self._width, self._height = view.camera.resolution
        self._origin, self._rotation = opaque_point(view.position), opaque_matrix(view.rotation)
        self.plate, self.alpha = render_plate(view, scene.panorama, prepared.place)
        self.pixels = influenced_pixels(view, prepared)
        self._accumulator = Accumulator(self.plate.reshape(-1, 3)[self.pixels])
        self._pixels = mi.UInt32(self.pixels if len(self.pixels) else np.zeros(1, np.uint32))
        self._taken = np.zeros(len(self.pixels), np.uint32)
        self._generator = np.random.default_rng(seed)

    def run(self, samples: int, noise: float | None = None) -> Iterator[Progress]:
        """Take samples, yielding after every pass; to stop early, stop iterating.

        Args:
            samples: per pixel that is sampled, on average.
            noise: relative error at which a pixel is done; ``samples`` is then the largest number for any pixel.
        """
        start = time.monotonic()
        total = samples * len(self.pixels)
        if not total:
            yield Progress(1.0, 0.0, 0.0, 0.0)
            return
        everything = np.arange(len(self.pixels), dtype=np.uint32)
        pilot = min(PILOT_SAMPLES, samples)
        plan = [(everything, pilot)]
        done = 0
        while plan:
            slots, wanted = plan.pop(0)
            for chunk, per_pixel in _passes(slots, wanted):
                self._sample(chunk, per_pixel)
                done += len(chunk) * per_pixel
                elapsed = time.monotonic() - start
                fraction = min(done / total, 1.0)
                yield Progress(fraction, done / len(self.pixels), self.error(), elapsed * (1.0 / fraction - 1.0))
            if not plan and done < total:
                plan = self._allocate(samples, noise)
        if done < total:
            yield Progress(1.0, done / len(self.pixels), self.error(), 0.0)

    def frame(self, auxiliary: bool = True) -> Frame:
        """The image so far.

        Args:
            auxiliary: with object ids, depth, normals and albedo as well.
        """
        estimates = self._accumulator.estimates()
        frame = Frame(
            plate=self.plate,
            change=self._scattered(estimates.change),
            synthetic=self._scattered(estimates.synthetic),
            coverage=self._scattered(estimates.coverage),
            alpha=self.alpha,
            variance=self._scattered(estimates.variance),
            samples=self._scattered(estimates.samples.astype(np.uint32)),
            object_names=tuple(thing.name for thing in self._scene.synthetic),
        )
        if auxiliary:
            layers = render_auxiliary(self._view, self._prepared)
            frame.object_id, frame.depth, frame.normal, frame.albedo = layers
        return frame

    @property
    def panoramic(self) -> bool:
        """Whether the image is a full panorama, whose edges meet."""
        return isinstance(self._view.camera, Equirectangular)

    def metadata(self, method: str) -> dict[str, str]:
        """Facts for the file's header: how the image was made, and what was simplified."""
        report = self._prepared.irradiance
        facts = {
            "method": method,
            "seed": str(self._seed),
            "samples": f"{self._taken.mean():.1f}" if len(self._taken) else "0",
            "error": f"{self.error():.5f}",
            "irradiance_error": f"{report.mean_error:.5f}",
        }
        if self._scene.render.clamp_indirect is not None:
            facts["clamp_indirect"] = str(self._scene.render.clamp_indirect)
        return facts

    def error(self) -> float:
        """Estimated relative error of the sampled pixels, root mean square."""
        return float(np.sqrt(np.mean(self._relative_error() ** 2))) if len(self.pixels) else 0.0

    def _relative_error(self) -> NDArray[np.float32]:
        """Estimated standard error of each sampled pixel relative to its brightness, shape (n,)."""
        estimates = self._accumulator.estimates()
        plate = self.plate.reshape(-1, 3)[self.pixels]
        beauty = plate * (1.0 - estimates.coverage[:, None]) + estimates.change + estimates.synthetic
        brightness = beauty.mean(axis=1)
        floor = 0.1 * float(np.median(plate.mean(axis=1))) + 1e-12
        return np.sqrt(estimates.variance.mean(axis=1)) / (np.maximum(brightness, 0.0) + floor)

    def _allocate(self, samples: int, noise: float | None) -> list[tuple[NDArray[np.uint32], int]]:
        """Where the samples go that remain after the pilot: in proportion to the error that a pixel then had."""
        spent = int(self._taken.min())
        error = self._smoothed(self._relative_error())
        if noise is not None:
            # The error falls with the square root of the number of samples.
            wanted = np.minimum(self._taken * np.square(error / noise), samples) - self._taken
        else:
            left = (samples - spent) * len(self.pixels)
            wanted = left * (error / max(float(error.sum()), 1e-30))
        number = np.ceil(np.log2(np.maximum(wanted, 1.0) / PILOT_SAMPLES + 1e-9))
        plan = []
        for level in np.unique(number[wanted >= 1.0]):
            slots = np.flatnonzero((number == level) & (wanted >= 1.0)).astype(np.uint32)
            plan.append((slots, max(1, round(float(wanted[slots].mean())))))
        return plan

    def _smoothed(self, error: NDArray[np.float32]) -> NDArray[np.float32]:
        """Errors averaged over neighbours: a single pixel's estimate from few samples misleads."""
        import cv2

        image = np.zeros(self._height * self._width, np.float32)
        image[self.pixels] = error
        return cv2.blur(image.reshape(self._height, self._width), (9, 9)).reshape(-1)[self.pixels]

    def _scattered(self, values: NDArray) -> NDArray:
        """Values of the sampled pixels in their places of the image, 0 elsewhere."""
        image = np.zeros((self._height * self._width, *values.shape[1:]), values.dtype)
        image[self.pixels] = values
        return image.reshape(self._height, self._width, *values.shape[1:])

    def _sample(self, slots: NDArray[np.uint32], per_pixel: int) -> None:
        """One pass: ``per_pixel`` samples for each of ``slots``."""
        self._prepared.place.draw_lights(self._generator)
        lanes = len(slots) * per_pixel
        slot = mi.UInt32(slots)
        lane = dr.arange(mi.UInt32, lanes)
        owner = lane // per_pixel
        pixel = dr.gather(mi.UInt32, self._pixels, dr.gather(mi.UInt32, slot, owner))
        index = dr.gather(mi.UInt32, mi.UInt32(self._taken[slots]), owner) + lane % per_pixel
        randoms = begin_path(pixel, index, dr.opaque(mi.UInt32, self._seed))
        x, y = randoms.spread("film")
        film = mi.Point2f((mi.Float(pixel % self._width) + x) / self._width, 0.0)
        film.y = (mi.Float(pixel // self._width) + y) / self._height
        start, direction, inside = self._view.camera.camera_rays(film, mi.Point2f(randoms.spread("lens")))
        ray = mi.Ray3f(self._origin + self._rotation @ start, self._rotation @ direction)
        samples = self._prepared.integrator.sample(randoms, ray, inside)
        self._accumulator.add(slot, samples, per_pixel)
        self._taken[slots] += per_pixel


def _passes(slots: NDArray[np.uint32], samples: int) -> Iterator[tuple[NDArray[np.uint32], int]]:
    """Cut ``samples`` for each of ``slots`` into passes of bounded size."""
    per_pixel = 1
    while per_pixel < 16 and 4 * per_pixel <= samples and 4 * per_pixel * len(slots) <= LANES // 2:
        per_pixel *= 4
    chunks = np.array_split(slots, max(1, -(-len(slots) * per_pixel // LANES)))
    rounds, rest = divmod(samples, per_pixel)
    for size, count in ((per_pixel, rounds), (1, rest)):
        for _ in range(count):
            for chunk in chunks:
                yield chunk, size
