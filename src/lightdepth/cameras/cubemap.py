"""The cubemap: six square pictures of 90 degrees each."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

import numpy as np
from pydantic import Field, model_validator

from lightdepth.cameras.camera import Camera, FilmPoint
from lightdepth.cameras.topology import Indices, Rectangle, Topology

if TYPE_CHECKING:
    import mitsuba as mi

FACES = (
    ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
    ((-1, 0, 0), (0, 1, 0), (0, 0, -1)),
    ((0, 0, 1), (1, 0, 0), (0, 1, 0)),
    ((0, 0, -1), (1, 0, 0), (0, -1, 0)),
    ((0, 1, 0), (1, 0, 0), (0, 0, -1)),
    ((0, -1, 0), (-1, 0, 0), (0, 0, -1)),
)
"""Right, left, up, down, front, back: the middle's direction, and what is right and down on the face, in camera space."""
COLUMNS = {"strip": 6, "3x2": 3}


class Cubemap(Camera):
    """Six faces of a cube, in the order right, left, up, down, front, back and turned as FFmpeg's filter ``v360`` has them.

    ``layout`` is ``strip`` (6x1) or ``3x2``: right, left and up above down, front and back.
    """

    type: Literal["cubemap"]
    width: int = Field(gt=0, le=65536, multiple_of=3)
    layout: Literal["strip", "3x2"] = "3x2"

    @model_validator(mode="after")
    def _whole_faces(self) -> Cubemap:
        if self.width % COLUMNS[self.layout]:
            raise ValueError(f"width must be a multiple of {COLUMNS[self.layout]}, the number of faces side by side")
        return self

    @property
    def resolution(self) -> tuple[int, int]:  # noqa: D102
        columns = COLUMNS[self.layout]
        return self.width, self.width // columns * (6 // columns)

    @property
    def topology(self) -> Cube:  # noqa: D102
        return Cube(self.width // COLUMNS[self.layout], COLUMNS[self.layout])

    def camera_rays(self, film: mi.Point2f, lens: mi.Point2f) -> tuple[mi.Point3f, mi.Vector3f, mi.Bool]:  # noqa: D102
        import drjit as dr
        import mitsuba as mi

        columns = COLUMNS[self.layout]
        rows = 6 // columns
        column = dr.clip(dr.floor(film.x * columns), 0.0, columns - 1.0)
        row = dr.clip(dr.floor(film.y * rows), 0.0, rows - 1.0)
        right, down = 2.0 * (film.x * columns - column) - 1.0, 2.0 * (film.y * rows - row) - 1.0
        tile = mi.UInt32(row * columns + column)
        direction = mi.Vector3f(0.0)
        for face, axes in enumerate(FACES):
            middle, across, along = (mi.Vector3f(*axis) for axis in axes)
            direction = dr.select(tile == face, middle + right * across + down * along, direction)
        return mi.Point3f(0.0), dr.normalize(direction), mi.Bool(True)

    def film_point(self, target: mi.Point3f, lens: mi.Point2f) -> FilmPoint:  # noqa: D102
        import drjit as dr
        import mitsuba as mi

        columns = COLUMNS[self.layout]
        rows = 6 // columns
        point = mi.Vector3f(target)
        depth = dr.maximum(dr.max(dr.abs(point)), 1e-20)
        film = mi.Point2f(0.0)
        for face, axes in enumerate(FACES):
            middle, across, along = (mi.Vector3f(*axis) for axis in axes)
            x, y = (0.5 + 0.5 * dr.clip(dr.dot(point, axis) / depth, -1.0, 1.0) for axis in (across, along))
            here = mi.Point2f((face % columns + x) / columns, (face // columns + y) / rows)
            film = dr.select(dr.dot(point, middle) >= depth, here, film)
        return FilmPoint(mi.Point3f(0.0), film, mi.Bool(True), mi.Float(1.0))

    def solid_angle(self, direction: mi.Vector3f) -> mi.Float:  # noqa: D102
        import drjit as dr

        cosine = dr.max(dr.abs(direction))
        return 24.0 * cosine * dr.square(cosine)


class Cube(Topology):
    """Faces of a cube: beyond its edges each goes on as its neighbours, unfolded into its plane pixel by pixel.

    Args:
        size: pixels along a face's side.
        columns: faces side by side.
    """

    endless = True

    def __init__(self, size: int, columns: int) -> None:
        self._size = size
        corners = [(face // columns * size, face % columns * size) for face in range(6)]
        self.charts = tuple(Rectangle(top, top + size, left, left + size) for top, left in corners)

    def beyond(self, chart: Rectangle, rows: Indices, columns: Indices) -> tuple[Indices, Indices]:  # noqa: D102
        axes = np.array(FACES)
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
