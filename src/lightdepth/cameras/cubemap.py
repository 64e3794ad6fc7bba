"""The cubemap: six square pictures of 90 degrees each."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from pydantic import model_validator

from lightdepth.cameras.cube import CubeCamera

if TYPE_CHECKING:
    import mitsuba as mi

COLUMNS = {"strip": 6, "3x2": 3, "separate": 3}
NAMES = ("right", "left", "up", "down", "front", "back")


class Cubemap(CubeCamera):
    """Six faces of a cube, in the order right, left, up, down, front, back and turned as FFmpeg's filter ``v360`` has them.

    ``layout`` is ``strip`` (6x1) or ``3x2``: right, left and up above down, front and back. ``separate`` is laid out as
    ``3x2``, and each face is a file of its own as well; ``width`` is that of a file.
    """

    type: Literal["cubemap"]
    layout: Literal["strip", "3x2", "separate"] = "3x2"
    faces = (
        ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
        ((-1, 0, 0), (0, 1, 0), (0, 0, -1)),
        ((0, 0, 1), (1, 0, 0), (0, 1, 0)),
        ((0, 0, -1), (1, 0, 0), (0, -1, 0)),
        ((0, 1, 0), (1, 0, 0), (0, 0, -1)),
        ((0, -1, 0), (-1, 0, 0), (0, 0, -1)),
    )

    @model_validator(mode="after")
    def _whole_faces(self) -> Cubemap:
        if self.layout != "separate" and self.width % self.columns:
            raise ValueError(f"width must be a multiple of {self.columns}, the number of faces side by side")
        return self

    @property
    def columns(self) -> int:  # noqa: D102
        return COLUMNS[self.layout]

    @property
    def face_size(self) -> int:  # noqa: D102
        return self.width if self.layout == "separate" else self.width // self.columns

    @property
    def parts(self) -> tuple[str, ...]:  # noqa: D102
        return NAMES if self.layout == "separate" else ()

    @staticmethod
    def to_plane(position: mi.Float) -> mi.Float:  # noqa: D102
        return position

    @staticmethod
    def from_plane(position: mi.Float) -> mi.Float:  # noqa: D102
        return position

    @staticmethod
    def stretch(point: mi.Vector3f) -> mi.Float:  # noqa: D102
        import mitsuba as mi

        return mi.Float(1.0)
