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

    def moved(self, down: int, right: int) -> Rectangle:
        """The same elsewhere."""
        return Rectangle(self.top + down, self.bottom + down, self.left + right, self.right + right)


@dataclass(frozen=True)
class Window:
    """A rectangle of an image with the pixels around it.

    Attributes:
        rectangle: the part of the film that is wanted.
        shape: height and width of the window.
        inner: where the rectangle lies in the window.
        margins: the rest of the window in strips: where each lies in it, and which rows and columns of the film it
            shows, broadcastable to its shape.
    """

    rectangle: Rectangle
    shape: tuple[int, int]
    inner: tuple[slice, slice]
    margins: tuple[tuple[tuple[slice, slice], Indices, Indices], ...]

    def cut(self, image: NDArray[Any]) -> NDArray[Any]:
        """The window's pixels of an image of shape (height, width, ...), a contiguous copy."""
        result = np.empty((*self.shape, *image.shape[2:]), image.dtype)
        result[self.inner] = image[self.rectangle.slices]
        for strip, rows, columns in self.margins:
            result[strip] = image[rows, columns]
        return result


class Topology(ABC):
    """How the pixels of a film lie beside each other.

    Attributes:
        charts: rectangles of the film that each show one continuous picture, together all of it: the whole film, the
            panorama of each eye, the faces of a cube.
        views: names of the views that the film shows, one after the other; a single one has no name.
        environment_map: the layout of the film as programs know it for environment maps, where it has such a one.
        endless: whether the picture goes on beyond the edges of its charts.
        parts: names of the charts, where each is to be a file of its own beside the film's.
    """

    charts: tuple[Rectangle, ...]
    views: tuple[str, ...] = ("",)
    environment_map: Literal["latlong"] | None = None
    parts: tuple[str, ...] = ()
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

    def alone(self, chart: Rectangle) -> Topology:
        """That of a chart which is a picture of its own."""
        return Flat(chart.width, chart.height)

    def window(self, chart: Rectangle, rectangle: Rectangle, margin: int | tuple[int, int, int, int]) -> Window:
        """A rectangle of a chart with ``margin`` pixels around it, fewer where the picture ends.

        Args:
            chart: one of ``charts``.
            rectangle: part of it.
            margin: alike on all sides, or above, below, left and right.
        """
        above, below, before, after = (margin,) * 4 if isinstance(margin, int) else margin
        top, bottom = rectangle.top - above, rectangle.bottom + below
        left, right = rectangle.left - before, rectangle.right + after
        if not self.endless:
            top, bottom = max(top, chart.top), min(bottom, chart.bottom)
            left, right = max(left, chart.left), min(right, chart.right)
        down = slice(rectangle.top - top, rectangle.bottom - top)
        across = slice(rectangle.left - left, rectangle.right - left)
        whole = slice(0, right - left)
        strips = [(slice(0, down.start), whole), (slice(down.stop, bottom - top), whole)]
        strips += [(down, slice(0, across.start)), (down, slice(across.stop, right - left))]
        margins = [
            (
                (row, column),
                *self.beyond(
                    chart,
                    top + np.arange(row.start, row.stop)[:, None],
                    left + np.arange(column.start, column.stop)[None, :],
                ),
            )
            for row, column in strips
        ]
        return Window(rectangle, (bottom - top, right - left), (down, across), tuple(margins))


class Pictures(Topology):
    """Pictures beside each other that end at their edges.

    Args:
        charts: the pictures on the film.
        views: the name of each, where there are several.
        parts: likewise, if they become files of their own.
    """

    endless = False

    def __init__(
        self, charts: tuple[Rectangle, ...], views: tuple[str, ...] = ("",), parts: tuple[str, ...] = ()
    ) -> None:
        self.charts, self.views, self.parts = charts, views, parts

    def beyond(self, chart: Rectangle, rows: Indices, columns: Indices) -> tuple[Indices, Indices]:  # noqa: D102
        return rows, columns


class Flat(Pictures):
    """A single picture that ends at its edges.

    Args:
        width: of the film, pixels.
        height: likewise.
    """

    def __init__(self, width: int, height: int) -> None:
        super().__init__((Rectangle(0, height, 0, width),))


class Spherical(Topology):
    """Equirectangular panoramas: each goes on around its left and right edge, and over the poles on the other side.

    Args:
        charts: the panoramas on the film, all of an even width.
        views: the name of each, where there are several.
        parts: likewise, if they become files of their own.
    """

    endless = True

    def __init__(
        self, charts: tuple[Rectangle, ...], views: tuple[str, ...] = ("",), parts: tuple[str, ...] = ()
    ) -> None:
        self.charts, self.views, self.parts = charts, views, parts
        self.environment_map = "latlong" if len(charts) == 1 else None

    def alone(self, chart: Rectangle) -> Spherical:  # noqa: D102
        return Spherical((Rectangle(0, chart.height, 0, chart.width),))

    def beyond(self, chart: Rectangle, rows: Indices, columns: Indices) -> tuple[Indices, Indices]:  # noqa: D102
        height, width = chart.height, chart.width
        rows, columns = rows - chart.top, columns - chart.left
        over_pole = (rows < 0) | (rows >= height)
        rows = np.where(rows < 0, -1 - rows, np.where(rows >= height, 2 * height - 1 - rows, rows))
        columns = columns + np.where(over_pole, width // 2, 0)
        return chart.top + rows % height, chart.left + columns % width
