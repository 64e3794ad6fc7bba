"""Rendering a camera's image: which pixels are sampled, in passes that can be watched and stopped."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib import metadata
from itertools import islice
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.cameras import Viewpoint
from lightdepth.errors import InputError
from lightdepth.film.accumulation import Accumulator
from lightdepth.film.auxiliary import render_auxiliary
from lightdepth.film.cryptomatte import shape_names
from lightdepth.film.frame import EXPOSURE, Frame
from lightdepth.film.light_image import LightImage
from lightdepth.film.plate import kept_plate
from lightdepth.film.schedule import QUANTUM, Region, Round, Target, passes, pilot_samples
from lightdepth.film.selection import influenced_pixels
from lightdepth.film.shared_errors import (
    CACHE_PROBES,
    CACHE_SAMPLES,
    LISTS,
    MEAN_TO_STANDARD,
    PATHS_PER_SAMPLE,
    PROBES,
    CacheUse,
    ListUse,
    SharedErrors,
    difference_error,
    light_list_error,
)
from lightdepth.film.sums import Origin, PixelSums, Share
from lightdepth.images.tonemapping import auto_exposure
from lightdepth.kernel.arrays import aligned
from lightdepth.kernel.start import DEVICE_LOCK
from lightdepth.place.light_list import LightList
from lightdepth.preparation import Prepared
from lightdepth.scene.identity import scene_digest, view_digest
from lightdepth.scene.model import Scene
from lightdepth.transport.difference import DifferenceIntegrator
from lightdepth.transport.integrator import CameraSums
from lightdepth.transport.radiance_cache import RadianceCache
from lightdepth.transport.sampler import Sampler, begin_path

MOST_SHARE = 16
"""No pixel gets more than this many times the average number of samples."""
NEIGHBOURS = 5
"""Pixels across the square whose mean error decides how many samples the pixel in its middle gets."""
CONTRAST = 0.5
"""The power of a pixel's brightness that this error is relative to, as in Dammertz et al. 2010; relative to the brightness
itself, highlights would get too few samples."""
DARK = 0.1
"""Errors count relative to a pixel's brightness plus this share of the median: nobody sees noise in the dark."""
SECONDS_BETWEEN_ERRORS = 0.5
"""Shortest time between two estimates of the error for progress reports."""
ERROR_SHARE = 0.05
"""Largest share of the time that these estimates may take."""
WORTH_SHARED = 0.05
"""Errors that all pixels share are estimated once the pixels' own errors are below this: they are far smaller."""
SHARED_SEED = 0x73686172
"""Seed of that estimate's own random numbers."""
LEAST_NOISE = 0.5
"""Smallest share of a wanted noise that is left to the pixels' own errors, however large the shared ones are."""
LIGHTS = 1 << 14
"""Length of the presampled light list: it fits the processor's cache, since RIS candidates lie far apart in it."""
LIGHTS_SERVE = 1 << 21
"""Camera paths after which a new list is drawn."""
TRAINING_SHARE = 0.1
"""Training paths of the radiance cache, relative to the paths that estimate pixels."""
FIRST_SHARE, FIRST_PATHS = 0.25, 1 << 15
"""That share in the first pass, and the largest number of training paths then."""
TRAINING_PATHS = 16
"""Training paths per lane."""
WORTH_TRAINING = 1 << 14
"""Smallest number of training paths in a later pass."""


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
    """The rendering of one camera's image.

    It can be stopped after any pass and continued, saved in between, and share its work with others: what it computes
    depends on its arguments, its targets and its samples so far alone. Several in several threads take turns.

    Args:
        scene: what to render.
        prepared: the same scene made ready for a method.
        view: the camera.
        method: its name, for the image's header.
        seed: of the random numbers; the same seed gives the same image.
        share: the part of the work to do; see :meth:`sums`.
    """

    def __init__(
        self,
        scene: Scene,
        prepared: Prepared,
        view: Viewpoint,
        method: str,
        seed: int,
        share: Share = Share(),  # noqa: B008 - it is immutable
    ) -> None:
        self._scene, self._prepared, self._view, self._method, self._seed = scene, prepared, view, method, seed
        self.share = share
        self._width, self._height = view.resolution
        with DEVICE_LOCK:
            self.plate, self.alpha = kept_plate(view, scene.panoramas, prepared, draft=scene.render.draft)
            self.pixels = influenced_pixels(view, prepared)
            plate = self.plate.reshape(-1, 3)
            light_tracer = prepared.integrator.light_tracer
            self._light = None if light_tracer is None else LightImage(light_tracer, view, self.pixels, seed, share)
            self._accumulator = Accumulator(plate, self.pixels, self._light)
            some = plate[self.pixels[:: max(1, len(self.pixels) >> 16)]]
            self._dark = DARK * float(np.median(some.mean(axis=1))) + 1e-12 if len(some) else 1.0
            self._generator = np.random.default_rng(seed)
            self._lights_served = 0
            self._lights: LightList | None = None
            self._lights_begun = self._generator.bit_generator.state
            self._cache = prepared.integrator.new_cache()
            # What the preparation used is worth more to what follows than to Dr.Jit's own cache.
            dr.flush_malloc_cache()
        self._round: Round | None = None
        self._digests: tuple[str, str] | None = None
        self._trained = False
        self._list_use, self._cache_use, self._shared = ListUse(), CacheUse(), SharedErrors()
        self._training_due = 0.0
        self._error, self._error_known, self._error_time = 0.0, False, -math.inf

    def run(self, samples: int, noise: float | None = None, region: Region | None = None) -> Iterator[Progress]:
        """Take samples, yielding after every pass; to stop early, stop iterating.

        Called again with the same arguments it goes on where it was stopped, to the same image as without the stop. With
        more ``samples`` than before it adds what is missing to those that there are.

        Args:
            samples: per pixel that is sampled, on average.
            noise: relative error at which a pixel is done; ``samples`` is then the largest number for any pixel.
            region: sample only pixels in these columns and rows, (left, top, right, bottom), the last two beyond.

        Raises:
            InputError: the arguments are out of range, or a share is to follow a ``noise``.
        """
        target = Target(samples, noise, region)
        if noise is not None and self.share.count > 1:
            raise InputError(
                f"share {self.share}: how many samples a wanted noise takes depends on all shares; give samples alone"
            )
        return self._run(target)

    def _run(self, target: Target) -> Iterator[Progress]:
        start, spent = time.monotonic(), self._spent()
        if self._round is None or self._round.target != target:
            self._round = self._pilot_round(target)
        while True:
            this = self._round
            for slots, counts in islice(passes(this.wanted), this.begun, None):
                self._sample(slots, counts, everywhere=this.pilot)
                this.begun += 1
                done, elapsed = self._spent(), time.monotonic() - start
                fraction = min(done / self._work(this), 1.0)
                left = elapsed * (1 - fraction) * done / max(fraction * (done - spent), 1e-30)
                yield Progress(fraction, done / len(self.pixels), self._watched_error(), left)
            following = self._next_round(this)
            if following is None:
                break
            self._round = following
        yield Progress(1.0, self._spent() / max(len(self.pixels), 1), self.error(), 0.0)

    def _spent(self) -> int:
        return int(self._accumulator.taken.sum(dtype=np.int64))

    def _work(self, this: Round) -> float:
        """Samples that this process will have taken when all is done."""
        if self.share.count == 1:
            return max(this.total, 1)
        pilot = pilot_samples(this.target.samples) * len(self.pixels)
        return max(pilot + (this.total - pilot) / self.share.count, 1)

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
            progress: called after every pass; where it returns true, the image is that of the samples so far.
            auxiliary: with object ids, depth, normals and albedo as well.

        Raises:
            InputError: as for :meth:`run`.
        """
        for step in self.run(*self.target(samples, noise)):
            if progress is not None and progress(step):
                break
        return self.frame(auxiliary, finish=True)

    def target(self, samples: int | None = None, noise: float | None = None) -> tuple[int, float | None]:
        """The first two arguments for :meth:`run`, with the scene's own settings in place of ``None``."""
        settings = self._scene.render
        return settings.samples if samples is None else samples, settings.noise if noise is None else noise

    def frame(self, auxiliary: bool = True, finish: bool = False) -> Frame:
        """The image so far.

        Args:
            auxiliary: with object ids, depth, normals and albedo as well.
            finish: the rendering gives its memory to the image and cannot go on.
        """
        with DEVICE_LOCK:
            return self._frame(auxiliary, finish)

    def _frame(self, auxiliary: bool, finish: bool) -> Frame:
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
            topology=self._view.topology,
        )
        if auxiliary:
            names = shape_names(self._scene.synthetic)
            seen = render_auxiliary(self._view, self._prepared, names, frame.coverage)
            frame.mattes, frame.depth, frame.normal, frame.albedo = seen.mattes, seen.depth, seen.normal, seen.albedo
            owners = [index for index, _ in self._prepared.shapes]
            frame.object_id = seen.mattes.dominant(frame.coverage.size, owners).reshape(frame.coverage.shape)
        return frame

    def origin(self, samples: int) -> Origin:
        """Which picture this is, for ``samples`` samples a pixel."""
        if self._digests is None:
            self._digests = scene_digest(self._scene), view_digest(self._view)
        scene, view = self._digests
        path = "" if self._scene.path is None else str(self._scene.path)
        size, version = (self._width, self._height), metadata.version("lightdepth")
        camera = next((name for name, each in self._scene.cameras.items() if each is self._view), "")
        draft = self._scene.render.draft
        return Origin(scene, view, self._method, self._seed, size, samples, version, path, camera, draft)

    def sums(self) -> PixelSums:
        """The sums so far of this share's pixels, and of its paths from the light for all pixels."""
        named, light_count = self._all_sums()
        taken, mine = self._accumulator.taken.copy(), self.share.owns(np.arange(len(self.pixels)))
        for name in ("change", "synthetic", "squares", "covered"):
            named[name][~mine] = 0.0
        taken[~mine] = 0
        samples = 0 if self._round is None else self._round.target.samples
        share = self.share
        named |= {"pixels": self.pixels.copy(), "taken": taken}
        return PixelSums(
            self.origin(samples),
            (share.index,),
            share.count,
            **named,
            light_count=light_count,
            light_list_error=self._list_error(),
            cache_error=self._shared.cache,
        )

    def adopt(self, sums: PixelSums) -> None:
        """Put sums in place of what there is, merged ones for example.

        Raises:
            InputError: they are of another picture.
        """
        self._must_be_this(sums.origin.difference(self.origin(sums.origin.samples)))
        if not np.array_equal(sums.pixels, self.pixels):
            self._must_be_this("other pixels")
        with DEVICE_LOCK:
            self._accumulator.restore(sums.taken, sums.arrays())
            if self._light is not None:
                self._light.restore(sums.arrays(), sums.light_count, sums.light_count, 0)
        self._list_use = ListUse()
        known = sums.light_list_error > 0.0 or sums.cache_error > 0.0
        self._shared = SharedErrors(sums.light_list_error, sums.cache_error, self._spent() if known else 0)
        self._error_known = False

    def _all_sums(self) -> tuple[dict[str, NDArray[Any]], int]:
        """The sums of all pixels by their name in :class:`PixelSums`, and how many light paths they are of."""
        with DEVICE_LOCK:
            named: dict[str, NDArray[Any]] = dict(self._accumulator.sums())
            if self._light is not None:
                light, count = self._light.sums()
                return named | light, count
        count = len(self.pixels)
        none = {"light_change": (count, 3), "light_synthetic": (count, 3), "light_squares": (count,)}
        return named | {name: np.zeros(shape, np.float32) for name, shape in none.items()}, 0

    def _must_be_this(self, difference: str | None) -> None:
        if difference is not None:
            raise InputError(f"what was computed before is of another picture: it is of {difference}")

    def state(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """All that this rendering's future depends on: plain values, and arrays by name. See :meth:`restore`."""
        named, light_count = self._all_sums()
        named |= {"pixels": self.pixels, "taken": self._accumulator.taken.copy()}
        this = self._round
        header: dict[str, Any] = {
            "origin": vars(self.origin(0 if this is None else this.target.samples)),
            "share": [self.share.index, self.share.count],
            "light_count": light_count,
            "light_begun": 0 if self._light is None else self._light.begun,
            "light_blocks": 0 if self._light is None else self._light.blocks,
            "generator": self._generator.bit_generator.state,
            "lights_begun": None if self._lights is None else self._lights_begun,
            "lights_served": self._lights_served,
            "trained": self._trained,
            "training_due": self._training_due,
            "list_use": self._list_use.values,
            "cache_use": self._cache_use.values,
            "shared": list(vars(self._shared).values()),
            "round": None if this is None else [vars(this.target), this.total, this.begun, this.pilot],
        }
        if this is not None:
            named["wanted"] = this.wanted
        if self._cache is not None:
            named |= {f"cache_{name}": values for name, values in self._cache.contents().items()}
        return header, named

    def restore(self, header: dict[str, Any], arrays: dict[str, NDArray[Any]]) -> None:
        """Go on from a :meth:`state`, which may be another process's: the image becomes the same, bit for bit.

        Raises:
            InputError: it is the state of another picture.
            KeyError, TypeError, ValueError: it is damaged.
        """
        origin = Origin(**{**header["origin"], "size": tuple(header["origin"]["size"])})
        self._must_be_this(origin.difference(self.origin(origin.samples)))
        if header["share"] != [self.share.index, self.share.count]:
            self._must_be_this("another share")
        if not np.array_equal(arrays["pixels"], self.pixels):
            self._must_be_this("other pixels")
        self._generator.bit_generator.state = header["generator"]
        with DEVICE_LOCK:
            self._accumulator.restore(arrays["taken"], arrays)
            if self._light is not None:
                self._light.restore(arrays, *(int(header[f"light_{name}"]) for name in ("count", "begun", "blocks")))
            if header["lights_begun"] is not None:
                generator = np.random.default_rng(0)
                generator.bit_generator.state = self._lights_begun = header["lights_begun"]
                self._lights = self._prepared.place.presample_lights(generator, LIGHTS)
            if self._cache is not None:
                self._cache.restore({name: arrays[f"cache_{name}"] for name in self._cache.contents()})
        self._lights_served, self._trained = int(header["lights_served"]), bool(header["trained"])
        self._training_due, self._error_known = float(header["training_due"]), False
        self._list_use.values = [int(value) for value in header["list_use"]]
        self._cache_use.values = [float(value) for value in header["cache_use"]]
        self._shared = SharedErrors(*header["shared"])
        self._round = None
        if header["round"] is not None:
            target, total, begun, pilot = header["round"]
            region = None if target["region"] is None else tuple(target["region"])
            target = Target(target["samples"], target["noise"], region)
            self._round = Round(target, arrays["wanted"], int(total), int(begun), bool(pilot))

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
        if self._shared.spent:
            facts |= {"light_list_error": f"{self._list_error():.5f}", "cache_error": f"{self._shared.cache:.5f}"}
        if self._scene.render.clamp_indirect is not None:
            facts["clamp_indirect"] = str(self._scene.render.clamp_indirect)
        return facts

    def error(self) -> float:
        """Estimated relative error of the sampled pixels, root mean square: their noise and the shared errors."""
        if len(self.pixels) and not self._error_known:
            own = float(np.mean(np.square(self._own_errors())))
            irradiance, rest = self._shared_variance()
            self._error = math.sqrt(own + float(np.mean(irradiance)) + rest)
            self._error_known = True
        return self._error

    def _own_errors(self) -> NDArray[np.float32]:
        """Relative errors of the pixels from the noise of their own samples, shape (n,)."""
        with DEVICE_LOCK:
            return self._accumulator.relative_errors(self._dark)

    def _shared_variance(self) -> tuple[NDArray[np.float32] | float, float]:
        """Relative variance of the shared errors: of the irradiance, shape (n,), and of the rest."""
        irradiance = self._prepared.irradiance.mean_error * MEAN_TO_STANDARD
        rest = self._list_error() ** 2 + self._shared.cache**2
        if not math.isfinite(irradiance) or irradiance == 0.0:
            return 0.0, rest
        with DEVICE_LOCK:
            change, brightness = self._accumulator.change_and_brightness(self._dark)
        return np.square(irradiance * change / brightness), rest

    def _list_error(self) -> float:
        """Relative error that the light lists so far give all pixels."""
        return self._shared.light_list * math.sqrt(self._list_use.share(len(self.pixels)))

    def _estimate_shared(self) -> None:
        """Estimate the errors of the light list and of the radiance cache, once they are not lost in the noise.

        Only between rounds, so that the samples that a wanted noise takes do not depend on progress reports.
        """
        spent, integrator = self._spent(), self._prepared.integrator
        if not isinstance(integrator, DifferenceIntegrator) or spent < 4 * self._shared.spent or not len(self.pixels):
            return
        own = self._own_errors()[self.share.owns(np.arange(len(self.pixels)))]
        if not len(own) or float(np.sqrt(np.mean(np.square(own)))) > WORTH_SHARED:
            return
        generator = np.random.default_rng([self._seed, SHARED_SEED, spent])
        with DEVICE_LOCK:
            _, brightness = self._accumulator.change_and_brightness(self._dark)
            fewest, most = PROBES
            count = min(max(spent // (PATHS_PER_SAMPLE * LISTS * LIGHTS), fewest), most)
            # Lists err most where paths do, which may be few pixels.
            chance = np.square(self._own_errors().astype(np.float64))
            chance = 0.5 * chance / max(float(chance.sum()), 1e-300) + 0.5 / len(chance)
            chance /= chance.sum()
            slots = generator.choice(len(self.pixels), count, p=chance)
            light_list = light_list_error(
                integrator,
                self._prepared.place,
                self._ray_through,
                self.pixels[slots],
                brightness[slots],
                1.0 / (len(chance) * chance[slots]),
                LIGHTS,
                generator,
            )
            self._shared = SharedErrors(light_list, self._cache_error(brightness, generator), spent)
        self._error_known = False

    def _cache_error(self, brightness: NDArray[np.float32], generator: np.random.Generator) -> float:
        """Relative error that the radiance cache gives pixels: how much they change with a perturbed cache."""
        if self._cache is None or self._lights is None:
            return 0.0
        slots = np.sort(generator.choice(len(self.pixels), min(CACHE_PROBES, len(self.pixels)), replace=False))
        counts = np.full(len(slots), CACHE_SAMPLES)
        other = self._cache.perturbed(generator)
        differences = []
        for _ in range(2):
            first = generator.integers(1 << 32, size=len(slots))
            sums = [
                self._follow(self._lights, self.pixels[slots], first, counts, cache) for cache in (self._cache, other)
            ]
            totals = [(each.change + each.synthetic).numpy().T for each in sums]
            differences.append((totals[1] - totals[0]) / CACHE_SAMPLES)
        now = difference_error(differences[0], differences[1], brightness[slots])
        return now * math.sqrt(self._cache_use.share(self._cache.records))

    def _ray_through(self, pixel: mi.UInt32) -> tuple[mi.Ray3f, mi.Bool]:
        """Camera rays through the middle of pixels, world, and whether they lie in the camera's image."""
        column, row = mi.Float(pixel % self._width), mi.Float(pixel // self._width)
        seen = self._view.pixel_rays(column, row, mi.Point2f(0.5), mi.Point2f(0.5))
        return seen.ray, seen.inside

    def _watched_error(self) -> float:
        """The same for progress reports, estimated again so rarely that it takes little time."""
        started = time.monotonic()
        if started >= self._error_time:
            self.error()
            ended = time.monotonic()
            self._error_time = ended + max(SECONDS_BETWEEN_ERRORS, (ended - started) / ERROR_SHARE)
        return self._error

    def _pilot_round(self, target: Target) -> Round:
        """The first round for a target: afterwards no pixel has fewer samples than the pilot takes."""
        taken = self._accumulator.taken.astype(np.int64)
        wanted = self._inside(np.maximum(pilot_samples(target.samples) - taken, 0), target).astype(np.int32)
        inside = self._inside(np.ones(taken.size, np.int64), target)
        return Round(target, wanted, int((taken * (1 - inside)).sum() + target.samples * inside.sum()))

    def _next_round(self, last: Round) -> Round | None:
        """What is still wanted after a round, in multiples of ``QUANTUM``; ``None`` when the work is done.

        Without a wanted ``noise``, what remains after the pilot is spent at once in proportion to the error that each
        pixel's neighbours then had. With it, as many as the error calls for, in rounds that at most quadruple a pixel's
        samples.
        """
        target, taken = last.target, self._accumulator.taken
        self._estimate_shared()
        with DEVICE_LOCK:
            more, whole = self._even(target) if target.noise is None else self._until(target, target.noise)
        if more is None or (target.noise is None and not last.pilot):
            return None
        more = self._inside(more, target)
        wanted = QUANTUM * np.floor(more / QUANTUM + 0.5).astype(np.int32)
        return Round(target, wanted, max(whole, int(taken.sum(dtype=np.int64)) + 1), 0, False) if wanted.any() else None

    def _even(self, target: Target) -> tuple[NDArray[np.float32] | None, int]:
        """How many more samples each pixel gets where the errors are to become alike, and how many all will have."""
        taken, samples = self._accumulator.taken, target.samples
        inside = self._inside(np.ones(taken.size, np.int64), target)
        size, spent = int(inside.sum()), int((taken * inside).sum(dtype=np.int64))
        left = samples * size - spent
        whole = int(taken.sum(dtype=np.int64)) + left
        if left < max(QUANTUM * size / 64, 1):
            return None, whole
        more = self._around(self._accumulator.relative_errors(self._dark, CONTRAST, with_light=False))
        if taken.max() > taken.min():
            # Not after a pilot: the samples so far are part of what each pixel is due.
            more *= np.sqrt(taken.astype(np.float32))
            more = self._inside(more, target)
            more *= samples * size / max(float(more.sum(dtype=np.float64)), 1e-30)
            more -= taken
            np.maximum(more, 0.0, out=more)
        more = self._inside(more, target)
        more *= left / max(float(more.sum(dtype=np.float64)), 1e-30)
        np.minimum(more, MOST_SHARE * samples, out=more)
        return more, whole

    def _until(self, target: Target, noise: float) -> tuple[NDArray[np.float32], int]:
        """How many more samples each pixel gets for a wanted noise, and how many all will have as far as is known."""
        taken = self._accumulator.taken
        # The error falls with the square root of the number of samples. A pixel that stands out is not done.
        errors = self._accumulator.relative_errors(self._dark)
        irradiance, rest = self._shared_variance()
        # More samples of a pixel do not reduce the shared errors: beyond some point they are of no use.
        left = np.maximum(noise**2 - rest - irradiance, LEAST_NOISE**2 * noise**2)
        more: NDArray[np.float32] = np.square(np.maximum(errors, self._around(errors)))
        more /= np.asarray(left, np.float32)
        more *= taken
        np.minimum(more, target.samples, out=more)
        more -= taken
        np.maximum(more, 0.0, out=more)
        whole = int(taken.sum(dtype=np.int64)) + int(more.sum(dtype=np.float64))
        np.minimum(more, 3.0 * taken, out=more)
        return more, whole

    def _inside(self, values: NDArray, target: Target) -> NDArray:
        """Values of the pixels of the list, 0 beyond the target's region."""
        if target.region is None:
            return values
        left, top, right, bottom = target.region
        row, column = np.divmod(self.pixels, np.uint32(self._width))
        return np.where((column >= left) & (column < right) & (row >= top) & (row < bottom), values, 0)

    def _around(self, error: NDArray[np.float32]) -> NDArray[np.float32]:
        """Mean of the neighbours' errors.

        A single pixel's estimate from few samples is unreliable; and if it decided how many more samples the same pixel
        gets, the result would be biased.
        """
        import cv2

        kernel = np.ones((NEIGHBOURS, NEIGHBOURS), np.float32)
        kernel[NEIGHBOURS // 2, NEIGHBOURS // 2] = 0.0
        kernel /= kernel.sum()
        image, topology = self._scattered(error), self._view.topology
        around = np.empty_like(image)
        for chart in topology.charts:
            window = topology.window(chart, chart, NEIGHBOURS // 2)
            around[chart.slices] = cv2.filter2D(window.cut(image), -1, kernel)[window.inner]
        around = around.reshape(-1)
        return around if around.size == error.size else around[self.pixels]

    def _scattered(self, values: NDArray) -> NDArray:
        """Values of the sampled pixels at their positions in the image, 0 elsewhere; themselves, where that is all."""
        if len(values) == self._height * self._width:
            return values.reshape(self._height, self._width, *values.shape[1:])
        image = np.zeros((self._height * self._width, *values.shape[1:]), values.dtype)
        image[self.pixels] = values
        return image.reshape(self._height, self._width, *values.shape[1:])

    def _sample(self, slots: NDArray[np.int64], counts: NDArray[np.int32], everywhere: bool) -> None:
        """One pass: ``counts`` samples for each of ``slots``; only for those of this share, unless ``everywhere``.

        Light lists and the radiance cache go by the pass of all shares, so that they are the same in each.
        """
        with DEVICE_LOCK:
            paths = int(counts.sum(dtype=np.int64))
            lights = self._light_list(paths)
            self._list_use.add(paths, len(slots))
            # While the device computes one of these, the next is prepared, which takes as long where samples are few.
            splats = [] if self._light is None else self._light.trace(lights, paths)
            self._train(lights, paths)
            if self._cache is not None:
                self._cache_use.add(paths, self._cache.records)
            if not everywhere:
                mine = self.share.owns(slots)
                slots, counts = slots[mine], counts[mine]
            if len(slots):
                sums = self._follow(lights, self.pixels[slots], self._accumulator.taken[slots], counts, self._cache)
            if self._light is not None:
                for block in splats:
                    self._light.add(block)
            if len(slots):
                self._accumulator.add(slots, sums, counts)
            self._error_known = False
            dr.sync_thread()  # Otherwise passes would only be queued: progress would run ahead, and Ctrl-C would be late.

    def _light_list(self, paths: int) -> LightList:
        """The light list for the next ``paths`` camera paths: a new one once the last has served enough."""
        if self._lights is None or self._lights_served <= 0:
            self._lights_begun = self._generator.bit_generator.state
            self._lights = self._prepared.place.presample_lights(self._generator, LIGHTS)
            self._lights_served = LIGHTS_SERVE
            self._list_use.next_list()
        self._lights_served -= paths
        return self._lights

    def _train(self, lights: LightList, paths: int) -> None:
        """Follow the training paths that belong to the next ``paths`` that estimate pixels."""
        if self._cache is None:
            return
        self._training_due += TRAINING_SHARE * paths
        if not self._trained:
            self._training_due = max(self._training_due, min(FIRST_SHARE * paths, FIRST_PATHS))
            self._trained = True
        elif self._training_due < WORTH_TRAINING:
            return
        lanes = math.ceil(self._training_due / TRAINING_PATHS)
        self._training_due = 0.0
        pixels = self._generator.choice(self.pixels, lanes)
        with self._cache.train(lanes * TRAINING_PATHS):
            first = self._generator.integers(1 << 32, size=lanes)
            self._follow(lights, pixels, first, np.full(lanes, TRAINING_PATHS), self._cache)

    def _follow(
        self,
        lights: LightList,
        pixels: NDArray[np.uint32],
        first: NDArray[np.integer],
        counts: NDArray[np.integer],
        cache: RadianceCache | None,
    ) -> CameraSums:
        """Follow ``counts`` paths for each pixel, from its sample index ``first`` on."""
        pixel, offset, count = (mi.UInt32(aligned(values, np.uint32)) for values in (pixels, first, counts))
        seed = dr.opaque(mi.UInt32, self._seed)
        paths_a_sample = mi.Float(0.0) if self._light is None else self._light.paths_a_sample()

        def camera_rays(index: mi.UInt32) -> tuple[Sampler, mi.Ray3f, mi.Bool, mi.Float]:
            sampler = begin_path(pixel, offset + index, seed)
            x, y = sampler.stratified("film")
            column, row = mi.Float(pixel % self._width), mi.Float(pixel // self._width)
            seen = self._view.pixel_rays(column, row, mi.Point2f(x, y), mi.Point2f(sampler.stratified("lens")))
            return sampler, seen.ray, seen.inside, seen.solid_angle * paths_a_sample

        sums = self._prepared.integrator.sample(camera_rays, len(pixels), count, lights, cache)
        dr.eval(sums)
        return sums
