"""Rendering a camera's image: which pixels are sampled, in passes that can be watched and stopped."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.cameras import Equirectangular
from lightdepth.film.accumulation import Accumulator
from lightdepth.film.auxiliary import render_auxiliary
from lightdepth.film.frame import EXPOSURE, Frame
from lightdepth.film.light_image import LightImage
from lightdepth.film.plate import render_plate
from lightdepth.film.selection import influenced_pixels
from lightdepth.images.tonemapping import auto_exposure
from lightdepth.kernel.arrays import aligned
from lightdepth.kernel.opaque import opaque_matrix, opaque_point
from lightdepth.scene.model import CameraView, Scene
from lightdepth.transport.integrator import CameraSums
from lightdepth.transport.methods import Prepared
from lightdepth.transport.randoms import Randoms, begin_path

PATHS = 1 << 21
"""Paths of one pass; more gain no speed."""
AT_ONCE = 256
"""Samples that a pixel gets at most before all others have got theirs."""
PACKET = 16
"""Lanes that run side by side, at most."""
SPREAD = 64
"""Packets that want equally many samples are at least so far apart, where there are enough."""
PILOT_SAMPLES = 16
"""Samples that every pixel gets, at most half of all, before the rest is spent where the error is."""
QUANTUM = 4
"""Further samples come in multiples of this."""
MOST_SHARE = 16
"""No pixel gets more than this many times the average number of samples."""
NEIGHBOURS = 5
"""Pixels across the square whose mean error decides how many samples the pixel in its middle gets,"""
CONTRAST = 0.5
"""and the power of a pixel's brightness that its error is relative to, as in Dammertz et al. 2010; with the brightness
itself highlights would get too few."""
DARK = 0.1
"""Errors count relative to a pixel's brightness plus this share of the median: nobody sees noise in the dark."""
SECONDS_BETWEEN_ERRORS = 0.5
"""The error is estimated for those who watch at most so often,"""
ERROR_SHARE = 0.05
"""and at most for this share of the time."""
LIGHTS = 1 << 14
"""Light samples that paths choose among: as many as fit the processor's cache, since paths look at many far apart."""
LIGHTS_SERVE = 1 << 21
"""Camera paths after which new ones are drawn."""
LEARNING_SHARE = 0.1
"""Paths that learn what surfaces send, relative to those that estimate pixels;"""
FIRST_SHARE, FIRST_PATHS = 0.25, 1 << 15
"""at first so many, but no more than so many,"""
LEARNING_PATHS = 16
"""in lanes of so many,"""
WORTH_LEARNING = 1 << 14
"""and later no fewer than so many at once."""


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
        method: its name, for the image's header.
        seed: of the random numbers; the same seed gives the same image.
    """

    def __init__(self, scene: Scene, prepared: Prepared, view: CameraView, method: str, seed: int) -> None:
        self._scene, self._prepared, self._view, self._method, self._seed = scene, prepared, view, method, seed
        self._width, self._height = view.camera.resolution
        self._origin, self._rotation = opaque_point(view.position), opaque_matrix(view.rotation)
        self.plate, self.alpha = render_plate(view, scene.panorama, prepared.place, draft=scene.render.draft)
        self.pixels = influenced_pixels(view, prepared)
        plate = self.plate.reshape(-1, 3)
        light_paths = prepared.integrator.light_paths
        self._light = None if light_paths is None else LightImage(light_paths, view, self.pixels, seed)
        self._accumulator = Accumulator(plate, self.pixels, self._light)
        some = plate[self.pixels[:: max(1, len(self.pixels) >> 16)]]
        self._dark = DARK * float(np.median(some.mean(axis=1))) + 1e-12 if len(some) else 1.0
        self._generator = np.random.default_rng(seed)
        self._lights_served = 0
        self._cache = prepared.integrator.new_cache()
        self._learning_due = 0.0
        self._error, self._error_known, self._error_time = 0.0, False, -math.inf
        dr.flush_malloc_cache()  # What the preparation used is worth more to what follows than to Dr.Jit's own cache.

    def run(self, samples: int, noise: float | None = None) -> Iterator[Progress]:
        """Take samples, yielding after every pass; to stop early, stop iterating.

        Args:
            samples: per pixel that is sampled, on average.
            noise: relative error at which a pixel is done; ``samples`` is then the largest number for any pixel.
        """
        start = time.monotonic()
        total = samples * len(self.pixels)
        done = 0
        wanted = np.full(len(self.pixels), _pilot(samples), np.int32)
        while wanted.any():
            for slots, counts in _passes(wanted):
                self._sample(slots, counts)
                done += int(counts.sum(dtype=np.int64))
                elapsed = time.monotonic() - start
                fraction = min(done / total, 1.0)
                yield Progress(fraction, done / len(self.pixels), self._watched_error(), elapsed * (1 / fraction - 1))
            wanted, total = self._allocate(samples, noise)
        yield Progress(1.0, done / max(len(self.pixels), 1), self.error(), 0.0)

    def complete(
        self,
        samples: int | None = None,
        noise: float | None = None,
        progress: Callable[[Progress], bool | None] | None = None,
        auxiliary: bool = True,
    ) -> Frame:
        """Take all samples and give the image; the rendering gives its memory to it and cannot go on.

        Args:
            samples: as for :meth:`run`; the scene's own setting by default.
            noise: as for :meth:`run`; the scene's own setting by default.
            progress: told after every pass; where it returns true, the image is that of the samples so far.
            auxiliary: with object ids, depth, normals and albedo as well.
        """
        settings = self._scene.render
        for step in self.run(samples or settings.samples, settings.noise if noise is None else noise):
            if progress is not None and progress(step):
                break
        return self.frame(auxiliary, finish=True)

    def frame(self, auxiliary: bool = True, finish: bool = False) -> Frame:
        """The image so far.

        Args:
            auxiliary: with object ids, depth, normals and albedo as well.
            finish: the rendering gives its memory to the image and cannot go on.
        """
        facts = self._facts()
        taken = self._accumulator.taken if finish else self._accumulator.taken.copy()
        means = dict(vars(self._accumulator.estimates(finish)))
        for name in list(means):  # One by one, so that a large image is never there twice as a whole.
            means[name] = self._scattered(means.pop(name))
            if finish:
                dr.flush_malloc_cache()
        frame = Frame(
            plate=self.plate,
            alpha=self.alpha,
            **means,
            samples=self._scattered(taken),
            metadata=facts,
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

    def _facts(self) -> dict[str, str]:
        """For the file's header: how the image was made, and what was simplified."""
        report = self._prepared.irradiance
        facts = {
            "method": self._method,
            "seed": str(self._seed),
            "samples": f"{self._accumulator.taken.mean():.1f}" if len(self.pixels) else "0",
            "error": f"{self.error():.5f}",
            "irradiance_error": f"{report.mean_error:.5f}",
            EXPOSURE: f"{auto_exposure(self._scene.panorama.radiance):.3f}",
        }
        if self._scene.render.clamp_indirect is not None:
            facts["clamp_indirect"] = str(self._scene.render.clamp_indirect)
        return facts

    def error(self) -> float:
        """Estimated relative error of the sampled pixels, root mean square."""
        if len(self.pixels) and not self._error_known:
            self._error = float(np.sqrt(np.mean(np.square(self._accumulator.relative_errors(self._dark)))))
            self._error_known = True
        return self._error

    def _watched_error(self) -> float:
        """The same for those who watch, estimated anew so rarely that it costs little time."""
        started = time.monotonic()
        if started >= self._error_time:
            self.error()
            ended = time.monotonic()
            self._error_time = ended + max(SECONDS_BETWEEN_ERRORS, (ended - started) / ERROR_SHARE)
        return self._error

    def _allocate(self, samples: int, noise: float | None) -> tuple[NDArray[np.int32], int]:
        """How many more samples each pixel gets, multiples of ``QUANTUM``; all 0 when the work is done.

        Without a wanted ``noise``, what remains after the pilot is spent at once in proportion to the error that each
        pixel's neighbours then had. With it, as many as the error calls for, in rounds that at most quadruple a pixel's
        samples.

        Returns:
            These numbers, and how many samples the whole image will have taken, as far as is known.
        """
        taken = self._accumulator.taken
        spent = int(taken.sum(dtype=np.int64))
        if noise is None:
            left = samples * taken.size - spent
            if left < QUANTUM * taken.size / 64 or taken.max(initial=0) > _pilot(samples):
                return np.zeros(taken.size, np.int32), spent
            more = self._around(self._accumulator.relative_errors(self._dark, CONTRAST, with_light=False))
            more *= left / max(float(more.sum(dtype=np.float64)), 1e-30)
            np.minimum(more, MOST_SHARE * samples, out=more)
            whole = spent + left
        else:
            # The error falls with the square root of the number of samples. A pixel is not done that stands out.
            errors = self._accumulator.relative_errors(self._dark)
            more = np.square(np.maximum(errors, self._around(errors)) / np.float32(noise))
            more *= taken
            np.minimum(more, samples, out=more)
            more -= taken
            np.maximum(more, 0.0, out=more)
            whole = spent + int(more.sum(dtype=np.float64))
            np.minimum(more, 3.0 * taken, out=more)
        return QUANTUM * np.floor(more / QUANTUM + 0.5).astype(np.int32), max(whole, spent + 1)

    def _around(self, error: NDArray[np.float32]) -> NDArray[np.float32]:
        """Mean of the neighbours' errors.

        A single pixel's estimate from few samples misleads; and did it decide how many more the same pixel gets, what its
        first samples found by luck would count for more or less than its share.
        """
        import cv2

        kernel = np.ones((NEIGHBOURS, NEIGHBOURS), np.float32)
        kernel[NEIGHBOURS // 2, NEIGHBOURS // 2] = 0.0
        kernel /= kernel.sum()
        around = np.asarray(cv2.filter2D(self._scattered(error), -1, kernel), np.float32).reshape(-1)
        return around if around.size == error.size else around[self.pixels]

    def _scattered(self, values: NDArray) -> NDArray:
        """Values of the sampled pixels in their places of the image, 0 elsewhere; themselves, where that is all."""
        if len(values) == self._height * self._width:
            return values.reshape(self._height, self._width, *values.shape[1:])
        image = np.zeros((self._height * self._width, *values.shape[1:]), values.dtype)
        image[self.pixels] = values
        return image.reshape(self._height, self._width, *values.shape[1:])

    def _sample(self, slots: NDArray[np.int64], counts: NDArray[np.int32]) -> None:
        """One pass: ``counts`` samples for each of ``slots``."""
        paths = int(counts.sum(dtype=np.int64))
        if self._lights_served <= 0:
            self._prepared.place.draw_lights(self._generator, LIGHTS)
            self._lights_served = LIGHTS_SERVE
        self._lights_served -= paths
        # While the device is at one of these, the next is prepared, which takes about as long where samples are few.
        arrivals = [] if self._light is None else self._light.follow(paths)
        self._learn(paths)
        sums = self._follow(self.pixels[slots], self._accumulator.taken[slots], counts)
        if self._light is not None:
            for each in arrivals:
                self._light.add(each)
        self._accumulator.add(slots, sums, counts)
        self._error_known = False
        dr.sync_thread()  # Else passes would only be queued: progress would run ahead, and Ctrl-C come late.

    def _learn(self, paths: int) -> None:
        """Let as many paths learn as the next ``paths`` that estimate pixels call for."""
        if self._cache is None:
            return
        self._learning_due += LEARNING_SHARE * paths
        if not self._accumulator.taken.any():
            self._learning_due = max(self._learning_due, min(FIRST_SHARE * paths, FIRST_PATHS))
        elif self._learning_due < WORTH_LEARNING:
            return
        lanes = math.ceil(self._learning_due / LEARNING_PATHS)
        self._learning_due = 0.0
        pixels = self._generator.choice(self.pixels, lanes)
        with self._cache.learn(lanes * LEARNING_PATHS):
            first = self._generator.integers(1 << 32, size=lanes)
            self._follow(pixels, first, np.full(lanes, LEARNING_PATHS))

    def _follow(
        self, pixels: NDArray[np.uint32], first: NDArray[np.integer], counts: NDArray[np.integer]
    ) -> CameraSums:
        """Follow ``counts`` paths for each pixel, from its sample number ``first`` on."""
        pixel, offset, count = (mi.UInt32(aligned(values, np.uint32)) for values in (pixels, first, counts))
        seed, camera = dr.opaque(mi.UInt32, self._seed), self._view.camera
        paths_a_sample = mi.Float(0.0) if self._light is None else self._light.paths_a_sample()

        def camera_rays(number: mi.UInt32) -> tuple[Randoms, mi.Ray3f, mi.Bool, mi.Float]:
            randoms = begin_path(pixel, offset + number, seed)
            x, y = randoms.spread("film")
            film = mi.Point2f((mi.Float(pixel % self._width) + x) / self._width, 0.0)
            film.y = (mi.Float(pixel // self._width) + y) / self._height
            start, direction, inside = camera.camera_rays(film, mi.Point2f(randoms.spread("lens")))
            ray = mi.Ray3f(self._origin + self._rotation @ start, self._rotation @ direction)
            return randoms, ray, inside, camera.pixel_angle(direction) * paths_a_sample

        sums = self._prepared.integrator.sample(camera_rays, len(pixels), count, self._cache)
        dr.eval(sums)
        return sums


def _pilot(samples: int) -> int:
    """Samples that every pixel gets of ``samples`` a pixel; few ones are not worth dividing."""
    return min(samples, max(QUANTUM, min(PILOT_SAMPLES, samples // 2)))


def _passes(wanted: NDArray[np.int32]) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int32]]]:
    """Cut the samples wanted for each pixel into passes of bounded size: (places in the list, samples for each).

    Lanes of a packet wait for each other, and so do processor cores: pixels that want equally many form packets, and
    packets that want many are spread among the others.
    """
    for begun in range(0, int(wanted.max(initial=0)), AT_ONCE):
        for first in range(0, len(wanted), PATHS):
            counts = np.clip(wanted[first : first + PATHS] - begun, 0, AT_ONCE)
            order = np.argsort(-counts, kind="stable")[: np.count_nonzero(counts)]
            if not len(order):
                continue
            packet = np.arange(len(order)) // PACKET
            order = order[np.argsort((packet % SPREAD).astype(np.uint8), kind="stable")]
            paths = np.cumsum(counts[order], dtype=np.int64)
            for part in np.array_split(order, np.searchsorted(paths, np.arange(PATHS, paths[-1], PATHS))):
                yield first + part, counts[part]
