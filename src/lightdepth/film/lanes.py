"""The lanes in which the samples of a pass are taken."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.film.accumulation import add_to
from lightdepth.kernel.arrays import aligned
from lightdepth.transport.integrator import CameraSums


@dataclass(frozen=True)
class Lanes:
    """Lanes, each of which takes some of the samples of one of n pixels.

    Attributes:
        pixel: which of the pixels each is for, shape (m,).
        first: the index of its first sample, shape (m,).
        count: how many samples it takes, shape (m,).
        blocks: where lanes of as many different pixels begin, and the end: within a block, no pixel occurs twice.
    """

    pixel: NDArray[np.integer]
    first: NDArray[np.integer]
    count: NDArray[np.integer]
    blocks: NDArray[np.integer]

    @classmethod
    def of(cls, first: NDArray[np.integer], count: NDArray[np.integer], most: int | None) -> Lanes:
        """Lanes for pixels.

        Args:
            first: index of each pixel's first sample, shape (n,).
            count: how many it gets, at least one, shape (n,).
            most: samples of a lane; ``None`` takes all samples of a pixel in one.
        """
        every = np.arange(len(count))
        if most is None or int(count.max()) <= most:
            return cls(every, first, count, np.array([0, len(count)]))
        pixels = [every[count > begun] for begun in range(0, int(count.max()), most)]
        pixel, blocks = np.concatenate(pixels), np.cumsum([0, *map(len, pixels)])
        begun = np.repeat(most * np.arange(len(pixels)), np.diff(blocks))
        return cls(pixel, first[pixel] + begun, np.minimum(count[pixel] - begun, most), blocks)

    def summed(self, sums: CameraSums, pixels: int) -> CameraSums:
        """Sums of the lanes as sums of the pixels.

        Args:
            sums: by lane.
            pixels: how many there are.
        """
        if len(self.blocks) == 2:
            return sums
        total = dr.zeros(CameraSums, pixels)
        dr.make_opaque(total)  # What shares a variable would be added to together.
        for begin, end in zip(self.blocks[:-1], self.blocks[1:], strict=True):
            # Opaque: as a number in the program, it would make one program of each block.
            lane = dr.opaque(mi.UInt32, int(begin)) + dr.arange(mi.UInt32, int(end - begin))
            pixel = mi.UInt32(aligned(self.pixel[begin:end], np.uint32))
            for value, into in zip(_parts(sums), _parts(total), strict=True):
                add_to(into, dr.gather(mi.Float, value, lane), pixel)
            dr.eval(total)
        return total


def _parts(sums: CameraSums) -> list[mi.Float]:
    colors = [sums.change, sums.synthetic, sums.squares]
    return [*(color[channel] for color in colors for channel in range(3)), sums.covered]
