"""What pictures of a cube's faces share."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from lightdepth.cameras.camera import Camera, FilmPoint
from lightdepth.cameras.topology import Indices, Rectangle, Topology

if TYPE_CHECKING:
    import mitsuba as mi

Axes = tuple[tuple[int, int, int], tuple[int, int, int], tuple[int, int, int]]


class CubeCamera(Camera):
    """Base of the cameras whose film shows the six faces of a cube.

    Attributes:
        faces: of the faces row by row, the direction of the middle, of what is right and what is down on it, in camera
            space.
    """

    faces: ClassVar[tuple[Axes, ...]]

    @property
    @abstractmethod
    def columns(self) -> int:
        """Number of faces side by side."""

    @property
    @abstractmethod
    def face_size(self) -> int:
        """Pixels along a face's side."""

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the faces that become files of their own."""
        return ()

    @staticmethod
    @abstractmethod
    def to_plane(position: mi.Float) -> mi.Float:
        """From positions on a face's picture, from -1 to 1, to the cube's plane at distance 1."""

    @staticmethod
    @abstractmethod
    def from_plane(position: mi.Float) -> mi.Float:
        """:meth:`to_plane` inverted."""

    @staticmethod
    @abstractmethod
    def stretch(point: mi.Vector3f) -> mi.Float:
        """Area on the cube that a unit of film area covers, relative to that of faces with even pixels.

        Args:
            point: on the cube, whose faces are at distance 1.
        """

    @property
    def resolution(self) -> tuple[int, int]:  # noqa: D102
        return self.columns * self.face_size, 6 // self.columns * self.face_size

    @property
    def topology(self) -> Cube:  # noqa: D102
        return Cube(self.face_size, self.columns, self.faces, self.parts)

    def camera_rays(self, film: mi.Point2f, lens: mi.Point2f) -> tuple[mi.Point3f, mi.Vector3f, mi.Bool]:  # noqa: D102
        import drjit as dr
        import mitsuba as mi

        columns, rows = self.columns, 6 // self.columns
        column = dr.clip(dr.floor(film.x * columns), 0.0, columns - 1.0)
        row = dr.clip(dr.floor(film.y * rows), 0.0, rows - 1.0)
        right = self.to_plane(2.0 * (film.x * columns - column) - 1.0)
        down = self.to_plane(2.0 * (film.y * rows - row) - 1.0)
        tile = mi.UInt32(row * columns + column)
        direction = mi.Vector3f(0.0)
        for face, axes in enumerate(self.faces):
            middle, across, along = (mi.Vector3f(*axis) for axis in axes)
            direction = dr.select(tile == face, middle + right * across + down * along, direction)
        return mi.Point3f(0.0), dr.normalize(direction), mi.Bool(True)

    def film_point(self, target: mi.Point3f, lens: mi.Point2f) -> FilmPoint:  # noqa: D102
        import drjit as dr
        import mitsuba as mi

        columns, rows = self.columns, 6 // self.columns
        point = mi.Vector3f(target)
        depth = dr.maximum(dr.max(dr.abs(point)), 1e-20)
        film = mi.Point2f(0.0)
        for face, axes in enumerate(self.faces):
            middle, across, along = (mi.Vector3f(*axis) for axis in axes)
            x, y = (
                0.5 + 0.5 * self.from_plane(dr.clip(dr.dot(point, axis) / depth, -1.0, 1.0)) for axis in (across, along)
            )
            here = mi.Point2f((face % columns + x) / columns, (face // columns + y) / rows)
            film = dr.select(dr.dot(point, middle) >= depth, here, film)
        return FilmPoint(mi.Point3f(0.0), film, mi.Bool(True), mi.Float(1.0))

    def solid_angle(self, direction: mi.Vector3f) -> mi.Float:  # noqa: D102
        import drjit as dr

        cosine = dr.max(dr.abs(direction))
        return 24.0 * cosine * dr.square(cosine) * self.stretch(direction / cosine)


class Cube(Topology):
    """Faces of a cube: beyond its edges each goes on as its neighbours, unfolded into its plane pixel by pixel.

    Args:
        size: pixels along a face's side.
        columns: faces side by side.
        faces: see :class:`CubeCamera`.
        parts: the faces' names, if they become files of their own.
    """

    endless = True

    def __init__(self, size: int, columns: int, faces: tuple[Axes, ...], parts: tuple[str, ...] = ()) -> None:
        self._size, self._axes, self.parts = size, np.array(faces), parts
        corners = [(face // columns * size, face % columns * size) for face in range(6)]
        self.charts = tuple(Rectangle(top, top + size, left, left + size) for top, left in corners)

    def beyond(self, chart: Rectangle, rows: Indices, columns: Indices) -> tuple[Indices, Indices]:  # noqa: D102
        axes = self._axes
        middle, across, along = axes[self.charts.index(chart)]
        right = (2 * (columns - chart.left) + 1) / self._size - 1
        down = (2 * (rows - chart.top) + 1) / self._size - 1
        # How far beyond an edge, no farther than across the neighbour; beyond a corner, over the nearer edge last.
        over_side, over_end = (np.clip(np.abs(part) - 1, 0, 1.999) for part in (right, down))
        side_first = (over_side >= over_end)[..., None]
        over_side, over_end = np.broadcast_arrays(over_side[..., None], over_end[..., None])
        beside, below = (np.clip(part, -1, 1)[..., None] * axis for part, axis in ((right, across), (down, along)))
        point = np.where(
            side_first,
            middle * (1 - over_side) + beside * (1 - over_end) + below,
            middle * (1 - over_end) + below * (1 - over_side) + beside,
        )
        face = np.argmax(point @ axes[:, 0].T, axis=-1)
        found = []
        for axis, corner in ((2, "top"), (1, "left")):
            place = np.sum(point * axes[face, axis], axis=-1)
            pixel = np.minimum((0.5 * (place + 1) * self._size).astype(np.intp), self._size - 1)
            found.append(np.array([getattr(each, corner) for each in self.charts])[face] + pixel)
        return found[0], found[1]
