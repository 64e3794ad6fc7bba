"""Taking the samples of an image: camera paths, and what they share: light lists, light paths, the radiance cache."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.cameras import Viewpoint
from lightdepth.film.accumulation import Accumulator
from lightdepth.film.lanes import Lanes
from lightdepth.film.light_image import LightImage
from lightdepth.film.shared_errors import CacheUse, ListUse
from lightdepth.film.sums import Share
from lightdepth.kernel.arrays import aligned
from lightdepth.kernel.device import ON_GPU
from lightdepth.kernel.start import DEVICE_LOCK
from lightdepth.parameters.film import FilmParameters
from lightdepth.place.light_list import LightList
from lightdepth.preparation import Prepared
from lightdepth.transport.integrator import CameraSums
from lightdepth.transport.radiance_cache import RadianceCache
from lightdepth.transport.sampler import Sampler, begin_path


class Sampling:
    """Takes samples and adds them up.

    Args:
        prepared: the scene made ready for a method.
        view: the camera.
        pixels: the pixels to sample, row-major indices, ascending, shape (n,), uint32.
        accumulator: receives their sums.
        light: receives the splats of light tracing; ``None`` without.
        seed: of the random numbers.
        share: the part of the samples to take.
        parameters: how they are taken.

    Attributes:
        pixels: as given.
        lights: the present light list; ``None`` before the first.
        cache: the radiance cache, where the method has one.
        list_use: how the light lists have been used.
        cache_use: how the radiance cache has been used.
    """

    def __init__(
        self,
        prepared: Prepared,
        view: Viewpoint,
        pixels: NDArray[np.uint32],
        accumulator: Accumulator,
        light: LightImage | None,
        seed: int,
        share: Share,
        parameters: FilmParameters,
    ) -> None:
        self._parameters = parameters
        self._lane_paths = parameters.gpu_lane_paths if ON_GPU else None
        self._prepared, self._view, self.pixels, self._seed, self._share = prepared, view, pixels, seed, share
        self._accumulator, self._light = accumulator, light
        self._width, _ = view.resolution
        self._generator = np.random.default_rng(seed)
        self._lights_served = 0
        self.lights: LightList | None = None
        self._lights_begun = self._generator.bit_generator.state
        self.cache = prepared.integrator.new_cache()
        self.list_use, self.cache_use = ListUse(), CacheUse()
        self._trained, self._training_due = False, 0.0

    def take(self, slots: NDArray[np.int64], counts: NDArray[np.int32], everywhere: bool) -> None:
        """One pass: ``counts`` samples for each of ``slots``; only for those of this share, unless ``everywhere``.

        Light lists and the radiance cache go by the pass of all shares, so that they are the same in each.
        """
        with DEVICE_LOCK:
            paths = int(counts.sum(dtype=np.int64))
            lights = self._light_list(paths)
            self.list_use.add(paths, len(slots))
            # While the device computes one of these, the next is prepared, which takes as long where samples are few.
            splats = [] if self._light is None else self._light.trace(lights, paths)
            self._train(lights, paths)
            if self.cache is not None:
                self.cache_use.add(paths, self.cache.records)
            if not everywhere:
                mine = self._share.owns(slots)
                slots, counts = slots[mine], counts[mine]
            if len(slots):
                first = self._accumulator.taken[slots]
                sums = self.follow(lights, self.pixels[slots], first, counts, self.cache, self._lane_paths)
            if self._light is not None:
                for block in splats:
                    self._light.add(block)
            if len(slots):
                self._accumulator.add(slots, sums, counts)
            dr.sync_thread()  # Otherwise passes would only be queued: progress would run ahead, and Ctrl-C would be late.

    def follow(
        self,
        lights: LightList,
        pixels: NDArray[np.uint32],
        first: NDArray[np.integer],
        counts: NDArray[np.integer],
        cache: RadianceCache | None,
        lane_paths: int | None = None,
    ) -> CameraSums:
        """Follow ``counts`` paths for each pixel, from its sample index ``first`` on; in a lane, at most ``lane_paths``."""
        lanes = Lanes.of(first, counts, lane_paths)
        columns = (pixels[lanes.pixel], lanes.first, lanes.count)
        pixel, offset, count = (mi.UInt32(aligned(values, np.uint32)) for values in columns)
        seed = dr.opaque(mi.UInt32, self._seed)
        paths_a_sample = mi.Float(0.0) if self._light is None else self._light.paths_a_sample()

        def camera_rays(index: mi.UInt32) -> tuple[Sampler, mi.Ray3f, mi.Bool, mi.Float]:
            sampler = begin_path(pixel, offset + index, seed)
            x, y = sampler.stratified("film")
            column, row = mi.Float(pixel % self._width), mi.Float(pixel // self._width)
            seen = self._view.pixel_rays(column, row, mi.Point2f(x, y), mi.Point2f(sampler.stratified("lens")))
            return sampler, seen.ray, seen.inside, seen.solid_angle * paths_a_sample

        sums = self._prepared.integrator.sample(camera_rays, len(lanes.pixel), count, lights, cache)
        dr.eval(sums)
        return lanes.summed(sums, len(pixels))

    def ray_through(self, pixel: mi.UInt32) -> tuple[mi.Ray3f, mi.Bool]:
        """Camera rays through the middle of pixels, world, and whether they lie in the camera's image."""
        column, row = mi.Float(pixel % self._width), mi.Float(pixel // self._width)
        seen = self._view.pixel_rays(column, row, mi.Point2f(0.5), mi.Point2f(0.5))
        return seen.ray, seen.inside

    def state(self) -> tuple[dict[str, Any], dict[str, NDArray[Any]]]:
        """Everything that further samples depend on: plain values, and arrays by name. See :meth:`restore`."""
        header = {
            "generator": self._generator.bit_generator.state,
            "lights_begun": None if self.lights is None else self._lights_begun,
            "lights_served": self._lights_served,
            "trained": self._trained,
            "training_due": self._training_due,
            "list_use": self.list_use.values,
            "cache_use": self.cache_use.values,
        }
        contents = {} if self.cache is None else self.cache.contents()
        return header, {f"cache_{name}": values for name, values in contents.items()}

    def restore(self, header: Mapping[str, Any], arrays: Mapping[str, NDArray[Any]]) -> None:
        """Continue from a :meth:`state`.

        Raises:
            KeyError, TypeError, ValueError: it is damaged.
        """
        self._generator.bit_generator.state = header["generator"]
        with DEVICE_LOCK:
            if header["lights_begun"] is not None:
                generator = np.random.default_rng(0)
                generator.bit_generator.state = self._lights_begun = header["lights_begun"]
                self.lights = self._prepared.place.presample_lights(generator, self._parameters.light_list_length)
            if self.cache is not None:
                self.cache.restore({name: arrays[f"cache_{name}"] for name in self.cache.contents()})
        self._lights_served, self._trained = int(header["lights_served"]), bool(header["trained"])
        self._training_due = float(header["training_due"])
        self.list_use.values = [int(value) for value in header["list_use"]]
        self.cache_use.values = [float(value) for value in header["cache_use"]]

    def _light_list(self, paths: int) -> LightList:
        """The light list for the next ``paths`` camera paths: a new one once the last has served enough."""
        if self.lights is None or self._lights_served <= 0:
            self._lights_begun = self._generator.bit_generator.state
            self.lights = self._prepared.place.presample_lights(self._generator, self._parameters.light_list_length)
            self._lights_served = self._parameters.light_list_paths
            self.list_use.next_list()
        self._lights_served -= paths
        return self.lights

    def _train(self, lights: LightList, paths: int) -> None:
        """Follow the training paths that belong to the next ``paths`` that estimate pixels."""
        if self.cache is None:
            return
        parameters, lane_paths = self._parameters, self._parameters.training_paths_a_lane
        self._training_due += parameters.training_share * paths
        if not self._trained:
            self._training_due = max(
                self._training_due, min(parameters.first_training_share * paths, parameters.first_training_paths)
            )
            self._trained = True
        elif self._training_due < parameters.fewest_training_paths:
            return
        lanes = math.ceil(self._training_due / lane_paths)
        self._training_due = 0.0
        pixels = self._generator.choice(self.pixels, lanes)
        with self.cache.train(lanes * lane_paths):
            first = self._generator.integers(1 << 32, size=lanes)
            self.follow(lights, pixels, first, np.full(lanes, lane_paths), self.cache)
