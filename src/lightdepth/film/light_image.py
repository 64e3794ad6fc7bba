"""Splats of light tracing on the pixels that are sampled."""

from __future__ import annotations

import math
from collections.abc import MutableMapping

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.cameras import Viewpoint
from lightdepth.film.channels import channel_means
from lightdepth.film.sums import Share
from lightdepth.kernel.arrays import aligned
from lightdepth.kernel.device import ON_GPU
from lightdepth.parameters.film import DEFAULT, FilmParameters
from lightdepth.place.light_list import LightList
from lightdepth.transport.light_tracing import Connection, LightTracer, Splats
from lightdepth.transport.sampler import Sampler, begin_path

SEED = 0x6C696768
"""Combined with the seed of the rendering, so that light paths have random numbers of their own."""
NOWHERE = np.uint32(0xFFFFFFFF)


class LightImage:
    """Sums of splats for a list of n pixels.

    Args:
        light_tracer: traces the light paths.
        view: the camera.
        pixels: row-major indices, ascending, shape (n,), uint32.
        seed: of the random numbers.
        share: trace the blocks of light paths of this share only.
        parameters: how many, and how many at once.

    Attributes:
        begun: light paths of all shares so far, the index of the next one.
        blocks: how many blocks these were.
        count: light paths traced so far.
    """

    def __init__(
        self,
        light_tracer: LightTracer,
        view: Viewpoint,
        pixels: NDArray[np.uint32],
        seed: int,
        share: Share = Share(),  # noqa: B008 - it is immutable
        parameters: FilmParameters = DEFAULT,
    ) -> None:
        self._parameters = parameters
        self._share, self.begun, self.blocks = share, 0, 0
        self._light_tracer, self._view, self._seed = light_tracer, view, seed ^ SEED
        self._width, self._height = view.resolution
        self._slots: NDArray[np.uint32] | None = None
        if len(pixels) < self._width * self._height:
            self._slots = np.full(self._width * self._height, NOWHERE)
            self._slots[pixels] = np.arange(len(pixels), dtype=np.uint32)
        self.count = 0
        self._change, self._synthetic = (np.zeros((len(pixels), 3), np.float32) for _ in range(2))
        self._squares = np.zeros(len(pixels), np.float32)
        self._on_gpu = _SumsOnGpu(self._slots, len(pixels)) if ON_GPU else None

    def paths_a_sample(self) -> mi.Float:
        """Light paths per camera path through one pixel."""
        return dr.opaque(mi.Float, self._parameters.light_paths_share * len(self._squares))

    def trace(self, lights: LightList, paths: int) -> list[Splats]:
        """Trace the light paths that belong to the next ``paths`` camera paths.

        Returns:
            Splats for :meth:`add`; the device computes them while the next kernels are prepared.
        """
        seed, paths_a_sample = dr.opaque(mi.UInt32, self._seed), self.paths_a_sample()
        splats = []
        left = math.ceil(self._parameters.light_paths_share * paths)
        while left > 0:
            count = min(left, self._parameters.light_paths_at_once)
            if self.blocks % self._share.count == self._share.index:
                first = dr.opaque(mi.UInt32, self.begun)
                sampler = begin_path(mi.UInt32(0), first + dr.arange(mi.UInt32, count), seed)
                block = self._light_tracer.trace(sampler, lights, self._connect, paths_a_sample)
                dr.eval(block)
                splats.append(block)
                self.count += count
            self.blocks += 1
            self.begun += count
            left -= count
        return splats

    def sums(self) -> tuple[dict[str, NDArray[np.float32]], int]:
        """``light_change``, ``light_synthetic``, shape (n, 3), and ``light_squares``, (n,); how many paths they are of.

        They are views, to be used before more is added.
        """
        self._fetch()
        named = {"light_change": self._change, "light_synthetic": self._synthetic, "light_squares": self._squares}
        return named, self.count

    def restore(self, sums: MutableMapping[str, NDArray[np.float32]], count: int, begun: int, blocks: int) -> None:
        """Replace the sums.

        Args:
            sums: from :meth:`sums`; they are taken out one by one.
            count: light paths that they are of.
            begun: light paths of all shares so far.
            blocks: how many blocks these were.
        """
        self._change[:], self._synthetic[:] = sums.pop("light_change"), sums.pop("light_synthetic")
        self._squares[:] = sums.pop("light_squares")
        if self._on_gpu is not None:
            self._on_gpu = _SumsOnGpu(self._slots, len(self._squares))
        self.count, self.begun, self.blocks = count, begun, blocks

    def _connect(self, point: mi.Point3f, sampler: Sampler) -> Connection:
        """How the camera sees points, world."""
        seen = self._view.project(point, mi.Point2f(sampler.next_1d(), sampler.next_1d()))
        return Connection(seen.origin, seen.film, seen.solid_angle, seen.weight, seen.inside)

    def add(self, splats: Splats) -> None:
        """Add splats."""
        if self._on_gpu is not None:
            self._on_gpu.add(splats, self._width, self._height)
            return
        valid = splats.valid.numpy()
        column = np.minimum((splats.film.x.numpy()[valid] * self._width).astype(np.int64), self._width - 1)
        row = np.minimum((splats.film.y.numpy()[valid] * self._height).astype(np.int64), self._height - 1)
        slot = row * self._width + column
        if self._slots is not None:
            slot = self._slots[slot]
        # Channel by channel, for which there is nothing to compile: an array of all has its length in a kernel.
        values = np.stack([channel.numpy()[valid] for channel in splats.radiance], axis=1)
        on_object = splats.on_object.numpy()[valid]
        useful = (slot != NOWHERE) & np.isfinite(values).all(axis=1)
        # One after the other in the order of the paths, so that the same paths always give the same image.
        for sums, chosen in ((self._change, useful & ~on_object), (self._synthetic, useful & on_object)):
            for channel in range(3):
                np.add.at(sums[:, channel], slot[chosen], values[chosen, channel])
        np.add.at(self._squares, slot[useful], np.square(values[useful]).mean(axis=1))

    def release(self) -> None:
        """Give back the memory of the sums; nothing can be added or asked afterwards."""
        del self._change, self._synthetic, self._squares, self._slots, self._on_gpu

    def means(
        self, part: slice | NDArray[np.integer]
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
        """Change and synthetic radiance of some pixels of the list and the variance of their sum, shapes (k, 3).

        Of the squares only the mean over the channels is kept, to save memory; each channel's share is that of its mean.
        """
        self._fetch()
        count = np.float32(max(self.count, 1))
        change, synthetic = self._change[part] / count, self._synthetic[part] / count
        squared = np.square(change + synthetic)
        mean = np.maximum(channel_means(squared)[:, None], np.float32(1e-30))
        variance = np.maximum(self._squares[part, None] / count - mean, 0.0) / count
        return change, synthetic, variance * (squared / mean)

    def _fetch(self) -> None:
        """Add what is on a GPU."""
        if self._on_gpu is None or not self._on_gpu.used:
            return
        sums = self._on_gpu.taken()
        for channel in range(3):
            self._change[:, channel] += sums[channel]
            self._synthetic[:, channel] += sums[3 + channel]
        self._squares += sums[6]


class _SumsOnGpu:
    """Sums of splats in a GPU's memory. Their order differs from time to time, and with it the last digits.

    Args:
        slots: index in the list of pixels of each pixel of the image, or ``NOWHERE``; ``None`` where all are in the list.
        count: how many pixels are in the list.

    Attributes:
        used: whether anything was added.
    """

    def __init__(self, slots: NDArray[np.uint32] | None, count: int) -> None:
        self._slots = None if slots is None else mi.UInt32(aligned(slots, np.uint32))
        self._count = count
        self._begin()

    def _begin(self) -> None:
        self.used = False
        self._sums = [dr.zeros(mi.Float, max(self._count, 1)) for _ in range(7)]

    def add(self, splats: Splats, width: int, height: int) -> None:
        """Add splats on an image of ``width`` by ``height`` pixels."""
        self.used = True
        columns, rows = dr.opaque(mi.UInt32, width), dr.opaque(mi.UInt32, height)
        column = dr.minimum(mi.UInt32(splats.film.x * mi.Float(columns)), columns - 1)
        row = dr.minimum(mi.UInt32(splats.film.y * mi.Float(rows)), rows - 1)
        slot = row * columns + column
        if self._slots is not None:
            slot = dr.gather(mi.UInt32, self._slots, slot, splats.valid)
        useful = splats.valid & (slot != int(NOWHERE)) & dr.isfinite(dr.sum(dr.abs(splats.radiance)))
        for channel in range(3):
            value = splats.radiance[channel]
            dr.scatter_add(self._sums[channel], value, slot, useful & ~splats.on_object)
            dr.scatter_add(self._sums[3 + channel], value, slot, useful & splats.on_object)
        dr.scatter_add(self._sums[6], dr.mean(dr.square(splats.radiance)), slot, useful)
        dr.eval(self._sums)

    def taken(self) -> list[NDArray[np.float32]]:
        """The sums so far, of which each begins again at zero: three channels of change, three of objects, squares."""
        sums = [each.numpy()[: self._count] for each in self._sums]
        self._begin()
        return sums
