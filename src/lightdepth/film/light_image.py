"""What paths from the light bring to the pixels that are sampled."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lightdepth.transport.light_paths import Arrivals

NOWHERE = np.uint32(0xFFFFFFFF)


class LightImage:
    """Sums over light paths for a list of n pixels.

    Args:
        pixels: row-major indices, ascending, shape (n,), uint32.
        resolution: width and height of the image.

    Attributes:
        count: light paths so far.
    """

    def __init__(self, pixels: NDArray[np.uint32], resolution: tuple[int, int]) -> None:
        self._width, self._height = resolution
        self._slots: NDArray[np.uint32] | None = None
        if len(pixels) < self._width * self._height:
            self._slots = np.full(self._width * self._height, NOWHERE)
            self._slots[pixels] = np.arange(len(pixels), dtype=np.uint32)
        self.count = 0
        self._sums, self._squares = (np.zeros((len(pixels), 3), np.float32) for _ in range(2))

    def add(self, arrivals: Arrivals, count: int) -> None:
        """Add what ``count`` light paths bring."""
        self.count += count
        valid = arrivals.valid.numpy()
        column = np.minimum((arrivals.film.x.numpy()[valid] * self._width).astype(np.int64), self._width - 1)
        row = np.minimum((arrivals.film.y.numpy()[valid] * self._height).astype(np.int64), self._height - 1)
        slot = row * self._width + column
        if self._slots is not None:
            slot = self._slots[slot]
        values = arrivals.radiance.numpy().T[valid]
        useful = (slot != NOWHERE) & np.isfinite(values).all(axis=1)
        slot, values = slot[useful], values[useful]
        # One after the other in the order of the paths, so that the same paths always give the same image.
        for channel in range(3):
            np.add.at(self._sums[:, channel], slot, values[:, channel])
            np.add.at(self._squares[:, channel], slot, np.square(values[:, channel]))

    def means(self, part: slice) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """Radiance of some pixels of the list and the variance of that, shapes (k, 3)."""
        number = np.float32(max(self.count, 1))
        mean = self._sums[part] / number
        return mean, np.maximum(self._squares[part] / number - np.square(mean), 0.0) / number
