"""Sums over samples for the pixels that are sampled at all; memory does not grow with the number of samples."""

from __future__ import annotations

import math
from collections.abc import Iterator, MutableMapping
from dataclasses import dataclass, fields

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.film.channels import channel_means, in_channels
from lightdepth.film.light_image import LightImage
from lightdepth.kernel.arrays import aligned
from lightdepth.transport.integrator import CameraSums

PIXELS_AT_ONCE = 1 << 18
Part = slice | NDArray[np.integer]
"""Some pixels of the list."""


@dataclass(frozen=True)
class Estimates:
    """Means over the samples of n pixels.

    Attributes:
        change: shape (n, 3), float32.
        synthetic: shape (n, 3), float32, times coverage.
        coverage: shape (n,), float32.
        variance: of the mean of the finished pixel, shape (n, 3), float32.
    """

    change: NDArray[np.float32]
    synthetic: NDArray[np.float32]
    coverage: NDArray[np.float32]
    variance: NDArray[np.float32]


class Accumulator:
    """Sums of samples for a list of n pixels.

    Args:
        plate: the photograph, all pixels of the image in a row, shape (m, 3), float32: what they show where nothing new
            covers them.
        pixels: which of them are in the list, shape (n,), uint32.
        light: splats of light tracing on these, part of the image; ``None`` without light tracing.

    Attributes:
        taken: number of samples of each pixel of the list, shape (n,), uint32.
    """

    def __init__(self, plate: NDArray[np.float32], pixels: NDArray[np.uint32], light: LightImage | None = None) -> None:
        self._plate, self._pixels, self._light = plate, pixels, light
        self.taken = np.zeros(len(pixels), np.uint32)
        size = max(len(pixels), 1)
        self._change, self._synthetic, self._squares = (dr.zeros(mi.Float, 3 * size) for _ in range(3))
        self._covered = dr.zeros(mi.Float, size)

    def add(self, slots: NDArray[np.integer], sums: CameraSums, counts: NDArray[np.integer]) -> None:
        """Add samples.

        Args:
            slots: indices into the list of pixels, each at most once, shape (k,).
            sums: of the samples of each of ``slots``.
            counts: how many those are, shape (k,).
        """
        index = mi.UInt32(aligned(slots, np.uint32))
        for total, color in (
            (self._change, sums.change),
            (self._synthetic, sums.synthetic),
            (self._squares, sums.squares),
        ):
            for channel in range(3):
                add_to(total, color[channel], 3 * index + channel)
        add_to(self._covered, sums.covered, index)
        dr.eval(self._change, self._synthetic, self._squares, self._covered)
        self.taken[slots] += counts.astype(np.uint32)

    def sums(self) -> dict[str, NDArray[np.float32]]:
        """The sums ``change``, ``synthetic``, ``squares``, shape (n, 3), and ``covered``, shape (n,).

        They are views, to be used before more is added: copies of a large image would take memory.
        """
        sums = self._sums()
        return {"change": sums.change, "synthetic": sums.synthetic, "squares": sums.variance, "covered": sums.coverage}

    def restore(self, taken: NDArray[np.uint32], sums: MutableMapping[str, NDArray[np.float32]]) -> None:
        """Replace the sums.

        Args:
            taken: number of samples of each pixel of the list, shape (n,).
            sums: from :meth:`sums`; they are taken out one by one.
        """
        self.taken[:] = taken
        if len(self._pixels):
            names = ("change", "synthetic", "squares", "covered")
            self._change, self._synthetic, self._squares, self._covered = (
                mi.Float(aligned(sums.pop(name)).reshape(-1)) for name in names
            )

    def estimates(self, finish: bool = False) -> Estimates:
        """The means so far of all pixels of the list.

        Args:
            finish: overwrite the sums by the means, which saves their memory; nothing can be added afterwards.
        """
        sums = self._sums()
        result = sums if finish else Estimates(*(np.empty_like(getattr(sums, field.name)) for field in fields(sums)))
        for part, means in self._means(sums):
            for field in fields(result):
                getattr(result, field.name)[part] = getattr(means, field.name)
        if finish:
            del self._change, self._synthetic, self._squares, self._covered
            if self._light is not None:
                self._light.release()
        return result

    def relative_errors(self, floor: float, exponent: float = 1.0, with_light: bool = True) -> NDArray[np.float32]:
        """Estimated standard error of each pixel relative to a power of its brightness, shape (n,), float32.

        Args:
            floor: radiance that is added to the brightness.
            exponent: the power.
            with_light: include the variance of splats, which more samples of the pixel do not reduce.
        """
        errors = np.empty(len(self._pixels), np.float32)
        for part, means in self._means(self._sums(), with_light):
            errors[part] = _relative(means, self._brightness(means, part, floor) ** exponent)
        return errors

    def relative_errors_and_changes(self, floor: float) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """:meth:`relative_errors` and :meth:`relative_changes` (with a factor of 1) in one pass over the pixels."""
        errors, changes = (np.empty(len(self._pixels), np.float32) for _ in range(2))
        for part, means in self._means(self._sums()):
            brightness = self._brightness(means, part, floor)
            errors[part] = _relative(means, brightness)
            changes[part] = channel_means(np.abs(means.change)) / brightness
        return errors, changes

    def include_single_samples(self, errors: NDArray[np.float32], floor: float, width: int) -> None:
        """Raise relative errors, in place, to what they are at least of pixels that have one sample each.

        A single sample does not tell its own variance, but neighbours do: half the squared difference of two that show
        the same kind of surface, as far as they show the same.

        Args:
            errors: shape (n,), of :meth:`relative_errors`.
            floor: radiance that is added to the brightness.
            width: pixels side by side whose mean brightness stands for that of each.
        """
        count, beside = len(self._pixels), width // 2
        unknown = np.zeros(count, bool)
        total, pairs = 0.0, 0
        for first in range(0, count, PIXELS_AT_ONCE):
            last = min(first + PIXELS_AT_ONCE, count)
            part = slice(max(first - beside, 0), min(last + beside, count))
            means, single = self._means_of(self._sums(), part), self.taken[part] == 1
            grey = channel_means(means.change + means.synthetic)
            plate = channel_means(self._plate.take(self._pixels[part], axis=0))
            brightness = np.maximum(plate * (1.0 - means.coverage) + grey, 0.0)
            pair = np.flatnonzero(single[:-1] & single[1:] & (np.diff(self._pixels[part]) == 1))
            pair = pair[(pair >= first - part.start) & (pair < last - part.start)]
            pair = pair[means.coverage[pair] == means.coverage[pair + 1]]
            # The brightness of a single sample is as uncertain as the sample.
            around = np.convolve(brightness, np.full(width, 1.0 / width), "same")[pair] + floor
            squared = 0.5 * np.square((grey[pair + 1] - grey[pair]) / around)
            total, pairs = total + float(squared.sum()), pairs + len(pair)
            unknown[first:last] = single[first - part.start : last - part.start]
            pair += part.start
            unknown[pair] = False
            errors[pair] = np.maximum(errors[pair], np.sqrt(squared))
        least = np.float32(math.sqrt(total / pairs) if pairs else math.inf)
        np.maximum(errors, least, out=errors, where=unknown)

    def relative_changes(self, floor: float, factor: float) -> NDArray[np.float32]:
        """Size of the change of each pixel relative to its brightness with ``floor`` added, times a factor, shape (n,)."""
        changes = np.empty(len(self._pixels), np.float32)
        for part, means in self._means(self._sums()):
            changes[part] = factor * channel_means(np.abs(means.change)) / self._brightness(means, part, floor)
        return changes

    def brightnesses(self, slots: NDArray[np.integer], floor: float) -> NDArray[np.float32]:
        """Brightness of some pixels of the list with ``floor`` added, shape (k,)."""
        return self._brightness(self._means_of(self._sums(), slots), slots, floor)

    def _brightness(self, means: Estimates, part: Part, floor: float) -> NDArray[np.float32]:
        plate = self._plate.take(self._pixels[part], axis=0)
        beauty = plate * in_channels(1.0 - means.coverage) + means.change + means.synthetic
        return np.maximum(channel_means(beauty), 0.0) + np.float32(floor)

    def _sums(self) -> Estimates:
        """Views of the sums, with squares in place of the variance; on a GPU, copies."""
        count = len(self._pixels)
        change, synthetic, squares = (
            total.numpy().reshape(-1, 3)[:count] for total in (self._change, self._synthetic, self._squares)
        )
        return Estimates(change, synthetic, self._covered.numpy()[:count], squares)

    def _means(self, sums: Estimates, with_light: bool = True) -> Iterator[tuple[slice, Estimates]]:
        """The means part by part, so that a large image needs no large temporaries."""
        for first in range(0, len(self._pixels), PIXELS_AT_ONCE):
            part = slice(first, min(first + PIXELS_AT_ONCE, len(self._pixels)))
            yield part, self._means_of(sums, part, with_light)

    def _means_of(self, sums: Estimates, part: Part, with_light: bool = True) -> Estimates:
        """The means of some pixels of the list.

        A finished sample is ``x + (1 - c) P`` with ``x`` what is new, ``P`` the plate and ``c`` whether it is covered,
        so that its variance is ``var x - 2 P cov(x, c) + P^2 var c``. Of ``x``, only ``synthetic`` occurs with ``c``.
        """
        count = np.maximum(self.taken[part], 1).astype(np.float32)
        coverage = sums.coverage[part] / count
        counts, covered = in_channels(count), in_channels(coverage)
        change, synthetic = sums.change[part] / counts, sums.synthetic[part] / counts
        plate, mean = self._plate.take(self._pixels[part], axis=0), change + synthetic
        # Both are exactly 0 where a pixel is covered wholly: a lamp behind it does not swamp the variance.
        covariance = synthetic - mean * covered
        plate_variance = plate * (plate * (covered * (1.0 - covered)) - 2.0 * covariance)
        variance = sums.variance[part] / counts - np.square(mean) + plate_variance
        variance = np.maximum(variance, 0.0) / np.maximum(counts - 1.0, 1.0)
        if with_light and self._light is not None:
            light_change, light_synthetic, light_variance = self._light.means(part)
            change, synthetic = change + light_change, synthetic + light_synthetic
            variance = variance + light_variance
        return Estimates(change, synthetic, coverage, variance)


def _relative(means: Estimates, brightness: NDArray[np.float32]) -> NDArray[np.float32]:
    """Standard errors of pixels relative to a brightness, shape (k,)."""
    return np.asarray(np.sqrt(channel_means(means.variance)) / brightness)


def add_to(total: mi.Float, value: mi.Float, index: mi.UInt32) -> None:
    """Add values to elements of ``total`` that differ."""
    dr.scatter_add(total, value, index, mode=dr.ReduceMode.NoConflicts)
