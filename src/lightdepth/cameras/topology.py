"""The topology of a camera's film: which pixel continues the picture beyond an edge, over a pole, across a seam."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

Indices = NDArray[np.intp]


@dataclass(frozen=True)
class Rectangle:
    """Pixels from ``top`` to before ``bottom`` and from ``left`` to before ``right``."""

    top: int
    bottom: int
    left: int
    right: int

    @property
    def height(self) -> int:
        """Number of rows."""
        return self.bottom - self.top

    @property
    def width(self) -> int:
        """Number of columns."""
        return self.right - self.left

    @property
    def slices(self) -> tuple[slice, slice]:
        """Index of an image's array: its rows and columns."""
        return slice(self.top, self.bottom), slice(self.left, self.right)


@dataclass(frozen=True)
class Window:
    """A rectangle of an image with the pixels around it.

    Attributes:
        rectangle: the part of the film that is wanted.
        rows: which row of the film each pixel of the window shows, broadcastable to its shape.
        columns: likewise which column.
        inner: where the rectangle lies in the window.
    """

    rectangle: Rectangle
    rows: Indices
    columns: Indices
    inner: tuple[slice, slice]

    def cut(self, image: NDArray[Any]) -> NDArray[Any]:
        """The window's pixels of an image of shape (height, width, ...), a contiguous copy."""
        shape = np.broadcast_shapes(self.rows.shape, self.columns.shape)
        rows, columns = np.broadcast_to(self.rows, shape), np.broadcast_to(self.columns, shape)
        down, across = self.inner
        result = np.empty((*shape, *image.shape[2:]), image.dtype)
        result[self.inner] = image[self.rectangle.slices]  # The margin alone needs to be looked up pixel by pixel.
        everywhere = slice(None)
        for strip in (
            (slice(0, down.start), everywhere),
            (slice(down.stop, None), everywhere),
            (down, slice(0, across.start)),
            (down, slice(across.stop, None)),
        ):
            result[strip] = image[rows[strip], columns[strip]]
        return result


class Topology(ABC):
    """How the pixels of a film lie beside each other.

    Attributes:
        charts: rectangles of the film that each show one continuous picture, together all of it: the whole film, the
            panorama of each eye, the faces of a cube.
        views: names of the views that the film shows, one after the other; a single one has no name.
        environment_map: the layout of the film as programs know it for environment maps, where it has such a one.
        endless: whether the picture goes on beyond the edges of its charts.
    """

    charts: tuple[Rectangle, ...]
    views: tuple[str, ...] = ("",)
    environment_map: Literal["latlong"] | None = None
    endless: ClassVar[bool]

    @abstractmethod
    def beyond(self, chart: Rectangle, rows: Indices, columns: Indices) -> tuple[Indices, Indices]:
        """Pixels of the film that continue a chart.

        Args:
            chart: one of ``charts``.
            rows: rows of the film as if the chart went on beyond its edges.
            columns: likewise columns; the two are broadcastable.

        Returns:
            The row and column of each pixel; where the given ones lie in the chart they are returned as they are.
        """

    def window(self, chart: Rectangle, rectangle: Rectangle, margin: int) -> Window:
        """A rectangle of a chart with ``margin`` pixels around it, fewer where the picture ends."""
        top, bottom = rectangle.top - margin, rectangle.bottom + margin
        left, right = rectangle.left - margin, rectangle.right + margin
        if not self.endless:
            top, bottom = max(top, chart.top), min(bottom, chart.bottom)
            left, right = max(left, chart.left), min(right, chart.right)
        rows, columns = self.beyond(chart, np.arange(top, bottom)[:, None], np.arange(left, right)[None, :])
        inner = (
            slice(rectangle.top - top, rectangle.bottom - top),
            slice(rectangle.left - left, rectangle.right - left),
        )
        return Window(rectangle, rows, columns, inner)


class Flat(Topology):
    """A picture that ends at its edges.

    Args:
        width: of the film, pixels.
        height: likewise.
    """

    endless = False

    def __init__(self, width: int, height: int) -> None:
        self.charts = (Rectangle(0, height, 0, width),)

    def beyond(self, chart: Rectangle, rows: Indices, columns: Indices) -> tuple[Indices, Indices]:  # noqa: D102
        return rows, columns


class Spherical(Topology):
    """Equirectangular panoramas: each goes on around its left and right edge, and over the poles on the other side.

    Args:
        charts: the panoramas on the film, all of an even width.
        views: the name of each, where there are several.
    """

    endless = True

    def __init__(self, charts: tuple[Rectangle, ...], views: tuple[str, ...] = ("",)) -> None:
        self.charts, self.views = charts, views
        self.environment_map = "latlong" if len(charts) == 1 else None

    def beyond(self, chart: Rectangle, rows: Indices, columns: Indices) -> tuple[Indices, Indices]:  # noqa: D102
        height, width = chart.height, chart.width
        rows, columns = rows - chart.top, columns - chart.left
        over_pole = (rows < 0) | (rows >= height)
        rows = np.where(rows < 0, -1 - rows, np.where(rows >= height, 2 * height - 1 - rows, rows))
        columns = columns + np.where(over_pole, width // 2, 0)
        return chart.top + rows % height, chart.left + columns % width
