"""Which samples are taken when: targets, the rounds that lead to them, and passes of bounded size."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.parameters.film import DEFAULT, FilmParameters

PACKET = 16
"""Lanes that run side by side, at most."""
Region = tuple[int, int, int, int]
"""Columns and rows of an image: left, top, right, bottom, the last two beyond it."""


@dataclass(frozen=True)
class Target:
    """What a rendering is to reach; the attributes are the arguments of :meth:`Rendering.run`.

    Raises:
        InputError: one is out of range.
    """

    samples: int
    noise: float | None = None
    region: Region | None = None

    def __post_init__(self) -> None:
        if self.samples < 1:
            raise InputError(f"samples = {self.samples}: at least 1 is needed")
        if self.noise is not None and not 0.0 < self.noise < math.inf:
            raise InputError(f"noise = {self.noise}: more than 0 is needed")
        if self.region is not None:
            left, top, right, bottom = self.region
            if not (0 <= left < right and 0 <= top < bottom):
                raise InputError(f"region = {self.region}: must be left, top, right, bottom in pixels, and not empty")


@dataclass
class Round:
    """Passes that were decided on together.

    Attributes:
        target: what they are for.
        wanted: samples for each pixel of the list, shape (n,), int32.
        total: samples that the whole image will have taken, as far as is known.
        begun: passes of it that have been made.
        pilot: the samples by which the rest is divided among the pixels.
    """

    target: Target
    wanted: NDArray[np.int32]
    total: int
    begun: int = 0
    pilot: bool = True


def pilot_samples(samples: int, parameters: FilmParameters = DEFAULT) -> int:
    """Pilot samples of every pixel out of ``samples`` per pixel; few are not worth distributing."""
    return min(samples, max(parameters.quantum, min(parameters.pilot_samples, samples // 2)))


def passes(
    wanted: NDArray[np.int32], parameters: FilmParameters = DEFAULT
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int32]]]:
    """Cut the samples wanted for each pixel into passes of bounded size: (indices into the list, samples for each).

    Lanes of a packet wait for each other, and so do processor cores: pixels that want equally many form packets, and
    packets that want many are distributed among the others.
    """
    most, at_once = parameters.paths_at_once, parameters.samples_at_once
    for begun in range(0, int(wanted.max(initial=0)), at_once):
        for first in range(0, len(wanted), most):
            counts = np.clip(wanted[first : first + most] - begun, 0, at_once)
            order = np.argsort(-counts, kind="stable")[: np.count_nonzero(counts)]
            if not len(order):
                continue
            packet = np.arange(len(order)) // PACKET
            order = order[np.argsort((packet % parameters.packet_distance).astype(np.uint8), kind="stable")]
            paths = np.cumsum(counts[order], dtype=np.int64)
            for part in np.array_split(order, np.searchsorted(paths, np.arange(most, paths[-1], most))):
                yield first + part, counts[part]
