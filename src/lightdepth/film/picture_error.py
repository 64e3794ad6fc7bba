"""Estimated errors of the pixels: the noise of their own samples, and the errors that all pixels share."""

from __future__ import annotations

import math
import time

import numpy as np
from numpy.typing import NDArray

from lightdepth.film.accumulation import Accumulator
from lightdepth.film.sampling import Sampling
from lightdepth.film.shared_errors import (
    MEAN_TO_STANDARD,
    SharedErrors,
    difference_error,
    light_list_error,
)
from lightdepth.film.sums import Share
from lightdepth.kernel.start import DEVICE_LOCK
from lightdepth.parameters.film import FilmParameters
from lightdepth.preparation import Prepared
from lightdepth.transport.difference import DifferenceIntegrator

SHARED_SEED = 0x73686172
"""Seed of that estimate's own random numbers."""


class PictureError:
    """Estimates a picture's relative error.

    Args:
        prepared: the scene.
        sampling: takes the samples.
        accumulator: their sums.
        plate: the photograph at the pixels that are sampled, or at some of them, shape (k, 3), float32.
        seed: of the rendering.
        parameters: how errors are estimated.

    Attributes:
        shared: the shared errors as last estimated.
    """

    def __init__(
        self,
        prepared: Prepared,
        sampling: Sampling,
        accumulator: Accumulator,
        plate: NDArray[np.float32],
        seed: int,
        parameters: FilmParameters,
    ) -> None:
        self._parameters = parameters
        self._prepared, self._sampling, self._accumulator, self._seed = prepared, sampling, accumulator, seed
        self._dark = parameters.dark * float(np.median(plate.mean(axis=1))) + 1e-12 if len(plate) else 1.0
        self.shared = SharedErrors()
        self._overall, self._known, self._due = 0.0, False, -math.inf

    def outdate(self) -> None:
        """Samples or shared errors have changed: :meth:`overall` is to be estimated again."""
        self._known = False

    def overall(self) -> float:
        """Estimated relative error of the sampled pixels, root mean square: their noise and the shared errors."""
        if len(self._accumulator.taken) and not self._known:
            with DEVICE_LOCK:
                own, changes = self._accumulator.relative_errors_and_changes(self._dark)
                self._include_single_samples(own)
            squared = float(np.mean(np.square(own, out=own)))
            irradiance = self._irradiance()
            if irradiance > 0.0:
                squared += irradiance**2 * float(np.mean(np.square(changes, out=changes)))
            self._overall = math.sqrt(squared + self._same_everywhere())
            self._known = True
        return self._overall

    def watched(self) -> float:
        """The same for progress reports, estimated again so rarely that it takes little time."""
        started = time.monotonic()
        if started >= self._due:
            self.overall()
            ended = time.monotonic()
            self._due = ended + max(
                self._parameters.seconds_between_errors, (ended - started) / self._parameters.error_time_share
            )
        return self._overall

    def own(self) -> NDArray[np.float32]:
        """Relative errors of the pixels from the noise of their own samples, shape (n,)."""
        with DEVICE_LOCK:
            errors = self._accumulator.relative_errors(self._dark)
            self._include_single_samples(errors)
            return errors

    def _include_single_samples(self, errors: NDArray[np.float32]) -> None:
        if (self._accumulator.taken == 1).any():  # As in a draft.
            self._accumulator.include_single_samples(errors, self._dark, self._parameters.single_around)

    def reducible(self, contrast: float) -> NDArray[np.float32]:
        """The part of them that more samples reduce, relative to a power of the pixels' brightness, shape (n,)."""
        with DEVICE_LOCK:
            return self._accumulator.relative_errors(self._dark, contrast, with_light=False)

    def shared_variance(self) -> tuple[NDArray[np.float32] | float, float]:
        """Relative variance of the shared errors: of the irradiance, shape (n,), and of the rest."""
        irradiance, rest = self._irradiance(), self._same_everywhere()
        if irradiance == 0.0:
            return 0.0, rest
        with DEVICE_LOCK:
            variance = self._accumulator.relative_changes(self._dark, irradiance)
        return np.square(variance, out=variance), rest

    def _irradiance(self) -> float:
        """Relative standard error of the irradiance; 0 where it is not known."""
        error = self._prepared.irradiance.mean_error * MEAN_TO_STANDARD
        return error if math.isfinite(error) else 0.0

    def _same_everywhere(self) -> float:
        """Relative variance of the errors that have the same size in all pixels."""
        return self.light_list() ** 2 + self.shared.cache**2

    def light_list(self) -> float:
        """Relative error that the light lists so far give all pixels."""
        return self.shared.light_list * math.sqrt(self._sampling.list_use.share(len(self._accumulator.taken)))

    def estimate_shared(self, share: Share) -> None:
        """Estimate the errors of the light list and of the radiance cache, once noise does not hide them.

        Only between rounds, so that the samples that a wanted noise takes do not depend on progress reports.

        Args:
            share: whose pixels' own errors decide that.
        """
        spent, integrator = int(self._accumulator.taken.sum(dtype=np.int64)), self._prepared.integrator
        count, parameters = len(self._accumulator.taken), self._parameters
        if not isinstance(integrator, DifferenceIntegrator) or not count:
            return
        if spent < parameters.shared_again * self.shared.spent:
            return
        own = self.own()
        mine = own if share.count == 1 else own[share.owns(np.arange(count))]
        if not len(mine) or float(np.sqrt(np.mean(np.square(mine)))) > parameters.worth_shared:
            return
        del mine
        generator = np.random.default_rng([self._seed, SHARED_SEED, spent])
        with DEVICE_LOCK:
            samples = parameters.compared_lists * parameters.light_list_length
            probes = max(spent // (parameters.paths_a_light_sample * samples), parameters.fewest_probes)
            probes = min(probes, parameters.most_probes)
            slots, chance = _drawn(own, probes, generator)
            del own
            light_list = light_list_error(
                integrator,
                self._prepared.place,
                self._sampling.ray_through,
                self._sampling.pixels[slots],
                self._accumulator.brightnesses(slots, self._dark),
                1.0 / (count * chance),
                parameters.light_list_length,
                parameters.compared_lists,
                generator,
            )
            self.shared = SharedErrors(light_list, self._cache(generator), spent)
        self.outdate()

    def _cache(self, generator: np.random.Generator) -> float:
        """Relative error that the radiance cache gives pixels: how much they change with a perturbed cache."""
        parameters = self._parameters
        cache, lights, pixels = self._sampling.cache, self._sampling.lights, self._sampling.pixels
        if cache is None or lights is None:
            return 0.0
        slots = np.sort(generator.choice(len(pixels), min(parameters.cache_probes, len(pixels)), replace=False))
        # Two sets of paths for each pixel, followed at once: a launch costs as much as some ten thousand paths.
        both = np.tile(slots, 2)
        first, counts = generator.integers(1 << 32, size=len(both)), np.full(len(both), parameters.cache_samples)
        other = cache.perturbed(generator)
        sums = [self._sampling.follow(lights, pixels[both], first, counts, each) for each in (cache, other)]
        totals = [(each.change + each.synthetic).numpy().T for each in sums]
        one, two = np.split((totals[1] - totals[0]) / parameters.cache_samples, 2)
        now = difference_error(one, two, self._accumulator.brightnesses(slots, self._dark))
        return now * math.sqrt(self._sampling.cache_use.share(cache.records))


def _drawn(
    errors: NDArray[np.float32], count: int, generator: np.random.Generator
) -> tuple[NDArray[np.intp], NDArray[np.float64]]:
    """Pixels to estimate shared errors in: lists err most where paths do, possibly in few pixels.

    Args:
        errors: of all pixels, shape (n,).
        count: how many to draw; one may be drawn several times.
        generator: source of randomness.

    Returns:
        Indices, shape (count,), and the chance of each in one draw.
    """
    chances = errors.astype(np.float64)
    np.square(chances, out=chances)
    total = max(float(chances.sum()), 1e-300)
    chances *= 0.5
    chances /= total
    chances += 0.5 / len(chances)
    chances /= chances.sum()
    # As Generator.choice does it, but in place: of a large image, the chances count.
    below = np.cumsum(chances, out=chances)
    below /= below[-1]
    slots = below.searchsorted(generator.random(count), side="right")
    return slots, below[slots] - np.where(slots > 0, below[slots - 1], 0.0)
