"""The equi-angular cubemap, whose pixels are nearly as large at the edges of its faces as in their middle."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from lightdepth.cameras.cube import CubeCamera

if TYPE_CHECKING:
    import mitsuba as mi


class EquiAngularCubemap(CubeCamera):
    """Six faces of a cube whose pixels are equally spaced in the angle from the face's middle.

    Google, "Bringing pixels front and center in VR video" (2017), in the layout of YouTube and of FFmpeg's ``eac``: left,
    front and right above down, back and up, which are turned so that each row is one continuous picture.
    """

    type: Literal["eac"]
    width: int = Field(gt=0, le=65536, multiple_of=3)
    faces = (
        ((-1, 0, 0), (0, 1, 0), (0, 0, -1)),
        ((0, 1, 0), (1, 0, 0), (0, 0, -1)),
        ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
        ((0, 0, -1), (0, -1, 0), (-1, 0, 0)),
        ((0, -1, 0), (0, 0, 1), (-1, 0, 0)),
        ((0, 0, 1), (0, 1, 0), (-1, 0, 0)),
    )

    @property
    def columns(self) -> int:  # noqa: D102
        return 3

    @property
    def face_size(self) -> int:  # noqa: D102
        return self.width // 3

    @staticmethod
    def to_plane(position: mi.Float) -> mi.Float:  # noqa: D102
        import drjit as dr

        return dr.tan(0.25 * dr.pi * position)

    @staticmethod
    def from_plane(position: mi.Float) -> mi.Float:  # noqa: D102
        import drjit as dr

        return dr.atan(position) * (4.0 / dr.pi)

    @staticmethod
    def stretch(point: mi.Vector3f) -> mi.Float:  # noqa: D102
        import drjit as dr

        slopes = 0.5 * dr.prod(1.0 + dr.square(point))  # A factor of 2 is that of the face's own axis.
        return (0.25 * math.pi) ** 2 * slopes
