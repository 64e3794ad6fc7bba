"""Errors that all pixels share, and that their own variance cannot show.

All paths of a pass take their RIS candidates from one light list, and end in one radiance cache; the irradiance of the
support is recovered once for all. See docs/theory.md, section 7.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.kernel.arrays import aligned
from lightdepth.place.place import Place
from lightdepth.transport.difference import DifferenceIntegrator

MEAN_TO_STANDARD = math.sqrt(math.pi / 2.0)
"""Standard deviation of a normal distribution relative to its mean deviation."""


@dataclass(frozen=True)
class SharedErrors:
    """Relative standard errors that all pixels share, root mean square over the pixels.

    Attributes:
        light_list: of a picture made with one list of light samples; several make it less.
        cache: of the radiance cache, over the whole rendering so far.
        spent: samples that had been taken when they were estimated.
    """

    light_list: float = 0.0
    cache: float = 0.0
    spent: int = 0


class ListUse:
    """How many light lists the pixels have been sampled with.

    Attributes:
        values: paths in all, sum of the squares of those of each list, those of the present list, and how many times
            pixels have been in a pass.
    """

    def __init__(self) -> None:
        self.values = [0, 0, 0, 0]

    def next_list(self) -> None:
        """A new list is begun."""
        self.values[1] += self.values[2] ** 2
        self.values[2] = 0

    def add(self, paths: int, pixels: int) -> None:
        """A pass of ``paths`` through ``pixels`` was made."""
        self.values[0] += paths
        self.values[2] += paths
        self.values[3] += pixels

    def share(self, pixels: int) -> float:
        """Variance relative to that with one list. A pixel sees no more lists than it has been in passes."""
        paths, squares, present, visits = self.values
        if paths == 0:
            return 1.0
        return min(max((squares + present**2) / paths**2, pixels / max(visits, 1)), 1.0)


class CacheUse:
    """With how few records of the radiance cache the pixels have been sampled.

    The errors of a cache and of the same one with more records have the variance of the latter in common.

    Attributes:
        values: paths in all, and the sum over pairs of paths of one over the larger number of records of both.
    """

    def __init__(self) -> None:
        self.values = [0.0, 0.0]

    def add(self, paths: int, records: int) -> None:
        """Count a pass of ``paths`` and the records it used."""
        self.values[1] += paths * (2.0 * self.values[0] + paths) / max(records, 1)
        self.values[0] += paths

    def share(self, records: int) -> float:
        """Variance relative to that of a picture made with ``records`` alone."""
        paths, pairs = self.values
        return records * pairs / paths**2 if paths else 1.0


def light_list_error(
    integrator: DifferenceIntegrator,
    place: Place,
    ray: Callable[[mi.UInt32], tuple[mi.Ray3f, mi.Bool]],
    pixels: NDArray[np.uint32],
    brightness: NDArray[np.float32],
    weights: NDArray[np.float64],
    lights: int,
    lists: int,
    generator: np.random.Generator,
) -> float:
    """Relative standard error that one light list gives the pixels' direct light, root mean square.

    Several lists are drawn, and with each the direct light is summed over the whole list: what is left between the sums is
    the lists' own error, without the noise of paths. Light of further bounces is left out.

    Args:
        integrator: whose light sampling it is.
        place: the photographed place.
        ray: camera rays through the middle of pixels.
        pixels: row-major indices, shape (p,).
        brightness: that errors are relative to, shape (p,).
        weights: how much each pixel counts, 1 on average over the picture, shape (p,).
        lights: light samples of a list.
        lists: how many are compared.
        generator: source of randomness.
    """
    count = dr.opaque(mi.UInt32, lights)
    means = np.empty((lists, len(pixels), 3))
    for mean in means:
        samples = place.presample_lights(generator, lights)
        for first in range(0, len(pixels), 16):
            chunk = pixels[first : first + 16]
            lane = dr.arange(mi.UInt32, len(chunk) * lights)
            pixel = dr.gather(mi.UInt32, mi.UInt32(aligned(chunk, np.uint32)), lane // count)
            u = (mi.Float(lane % count) + 0.5) / mi.Float(count)
            rays, inside = ray(pixel)
            found = integrator.direct_from(rays, samples, u, inside)
            dr.eval(found)  # At once: each channel by itself would trace all rays again.
            sums = [dr.block_sum(channel, lights).numpy() for channel in found]
            mean[first : first + 16] = np.stack(sums, axis=1) / lights
    # As the film has it: the channels' variances, averaged.
    variance = means.var(axis=0, ddof=1).mean(axis=1)
    return float(np.sqrt(np.mean(weights * variance / np.square(brightness.astype(np.float64)))))


def difference_error(first: NDArray[np.float32], second: NDArray[np.float32], brightness: NDArray[np.float32]) -> float:
    """Relative error out of two independent estimates of how far pixels are off, each shape (p, 3), root mean square.

    The product of both is free of the noise of either, on average.
    """
    product = (first.astype(np.float64) * second).mean(axis=1) / np.square(brightness.astype(np.float64))
    return float(np.sqrt(max(product.mean(), 0.0)))
