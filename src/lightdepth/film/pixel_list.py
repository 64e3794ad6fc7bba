"""The pixels of an image that are sampled, and where they lie in it."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.cameras import Viewpoint
from lightdepth.cameras.topology import Rectangle
from lightdepth.film.schedule import Region
from lightdepth.film.sparse import sparse_zeros

PIXELS_AT_ONCE = 1 << 20


class PixelList:
    """Some n pixels of a camera's image.

    Args:
        view: the camera.
        indices: row-major, ascending, shape (n,), uint32.

    Attributes:
        indices: as given.
    """

    def __init__(self, view: Viewpoint, indices: NDArray[np.uint32]) -> None:
        self.indices = indices
        self._topology = view.topology
        self._width, self._height = view.resolution

    def __len__(self) -> int:
        return len(self.indices)

    def inside(self, values: NDArray, region: Region | None) -> NDArray:
        """Values of the pixels of the list, shape (n,), 0 beyond a region; ``None`` is the whole image."""
        if region is None:
            return values
        left, top, right, bottom = region
        row, column = np.divmod(self.indices, np.uint32(self._width))
        return np.where((column >= left) & (column < right) & (row >= top) & (row < bottom), values, 0)

    def around(self, error: NDArray[np.float32], reach: int) -> NDArray[np.float32]:
        """Mean of the neighbours' errors, shape (n,).

        A single pixel's estimate from few samples is unreliable; and if it decided how many more samples the same pixel
        gets, the result would be biased.

        Args:
            error: of each pixel, shape (n,).
            reach: how far to each side neighbours are, pixels.
        """
        kernel = np.ones((2 * reach + 1, 2 * reach + 1), np.float32)
        kernel[reach, reach] = 0.0
        kernel /= kernel.sum()
        image, topology = self.scattered(error), self._topology
        around = np.empty_like(image)
        for chart in topology.charts:
            # In strips: of a large image, copies count.
            for top in range(chart.top, chart.bottom, max(PIXELS_AT_ONCE // chart.width, 1)):
                bottom = min(top + max(PIXELS_AT_ONCE // chart.width, 1), chart.bottom)
                strip = Rectangle(top, bottom, chart.left, chart.right)
                window = topology.window(chart, strip, reach)
                around[strip.slices] = cv2.filter2D(window.cut(image), -1, kernel)[window.inner]
        around = around.reshape(-1)
        return around if around.size == error.size else around[self.indices]

    def scattered(self, values: NDArray) -> NDArray:
        """Values of the pixels at their positions in the image, 0 elsewhere; themselves, where that is all.

        Args:
            values: shape (n, ...).

        Returns:
            Shape (height, width, ...).
        """
        if len(values) == self._height * self._width:
            return values.reshape(self._height, self._width, *values.shape[1:])
        image = sparse_zeros((self._height * self._width, *values.shape[1:]), values.dtype)
        image[self.indices] = values
        return image.reshape(self._height, self._width, *values.shape[1:])
