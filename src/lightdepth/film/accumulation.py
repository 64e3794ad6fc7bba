"""Sums over samples for the pixels that are sampled at all; memory does not grow with the number of samples."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.transport.difference import CameraSamples


@dataclass(frozen=True)
class Estimates:
    """Means over the samples of n pixels.

    Attributes:
        change: shape (n, 3), float32.
        synthetic: shape (n, 3), float32, times coverage.
        coverage: shape (n,), float32.
        variance: of the mean of the finished pixel, shape (n, 3), float32.
        samples: shape (n,), float32.
    """

    change: NDArray[np.float32]
    synthetic: NDArray[np.float32]
    coverage: NDArray[np.float32]
    variance: NDArray[np.float32]
    samples: NDArray[np.float32]


class Accumulator:
    """Sums of samples for a list of pixels.

    Args:
        plate: the photograph at the pixels, shape (n, 3), float32: what a pixel shows where nothing new covers it.
    """

    def __init__(self, plate: NDArray[np.float32]) -> None:
        self.count = len(plate)
        size = max(self.count, 1)
        self._plate = mi.Float(np.ascontiguousarray(plate if self.count else np.zeros((1, 3), np.float32)).reshape(-1))
        # Change, synthetic radiance, covered samples, squares of the finished pixel without its plate, samples.
        self._sums = [dr.zeros(mi.Float, size) for _ in range(11)]
        dr.eval(self._sums)

    def add(self, slots: mi.UInt32, samples: CameraSamples, per_pixel: int) -> None:
        """Add samples.

        Args:
            slots: places in the list of pixels, each at most once, length n.
            samples: estimates, ``per_pixel`` in a row for each of ``slots``.
            per_pixel: samples per pixel.
        """
        lanes = dr.width(slots) * per_pixel
        owner = dr.gather(mi.UInt32, slots, dr.arange(mi.UInt32, lanes) // per_pixel)
        covered = dr.select(samples.covered, 1.0, 0.0)
        plate = dr.gather(mi.Color3f, self._plate, owner)
        squares = dr.square(samples.change + samples.synthetic - plate * covered)
        values = [*samples.change, *samples.synthetic, covered, *squares, dr.ones(mi.Float, lanes)]
        for total, value in zip(self._sums, values, strict=True):
            added = dr.block_sum(value, per_pixel) if per_pixel > 1 else value
            dr.scatter(total, dr.gather(mi.Float, total, slots) + added, slots)
        dr.eval(self._sums)

    def estimates(self) -> Estimates:
        """The means so far."""
        sums = np.stack([total.numpy() for total in self._sums])[:, : self.count]
        number = np.maximum(sums[10], 1.0)
        change, synthetic, coverage = sums[0:3] / number, sums[3:6] / number, sums[6] / number
        mean = change + synthetic - self._plate.numpy().reshape(-1, 3).T[:, : self.count] * coverage
        variance = np.maximum(sums[7:10] / number - mean**2, 0.0) / np.maximum(number - 1.0, 1.0)
        return Estimates(change.T, synthetic.T, coverage, variance.T, sums[10])
