"""Base of the cameras for two eyes: how the eyes' pictures lie on the film, and which of them shows a point."""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING, Literal

from pydantic import field_validator, model_validator

from lightdepth.cameras.camera import Camera, FilmPoint
from lightdepth.cameras.topology import Pictures, Rectangle, Topology

if TYPE_CHECKING:
    import mitsuba as mi

EYES = ("left", "right")
Layout = Literal["top-bottom", "side-by-side", "separate"]
LAST = 1.0 - 2.0**-22
"""Greatest position on the picture of an eye: at all sizes, rounding does not move it into the other one."""


class Stereo(Camera):
    """Base of the cameras for two eyes, ``interocular_distance`` apart, metres.

    The left eye is on top or, side by side, on the left. ``separate`` is laid out as ``top-bottom``, and each eye's picture
    is a file of its own as well. ``width`` is that of a file, so side by side of both eyes together.
    """

    interocular_distance: float = 0.064
    layout: Layout = "top-bottom"

    @field_validator("interocular_distance")
    @classmethod
    def _apart(cls, value: float) -> float:
        if not 0.0 < value <= 1.0:
            raise ValueError(
                "must be greater than 0 and at most 1 metre; a picture without stereo has a camera for one eye"
            )
        return value

    @model_validator(mode="after")
    def _whole_pictures(self) -> Stereo:
        if self.layout == "side-by-side" and self.width % 2:
            raise ValueError("width must be even: it is that of both eyes together")
        return self

    @property
    def eye_width(self) -> int:
        """Width of an eye's picture in pixels."""
        return self.width // 2 if self.layout == "side-by-side" else self.width

    @property
    @abstractmethod
    def eye_height(self) -> int:
        """Its height."""

    @property
    def resolution(self) -> tuple[int, int]:  # noqa: D102
        return self.width, self.eye_height * (1 if self.layout == "side-by-side" else 2)

    @property
    def charts(self) -> tuple[Rectangle, Rectangle]:
        """Where the left and the right eye's picture lie on the film."""
        left = Rectangle(0, self.eye_height, 0, self.eye_width)
        side_by_side = self.layout == "side-by-side"
        return left, left.moved(0, self.eye_width) if side_by_side else left.moved(self.eye_height, 0)

    @property
    def parts(self) -> tuple[str, ...]:
        """Names of the charts that become files of their own."""
        return EYES if self.layout == "separate" else ()

    @property
    def topology(self) -> Topology:
        """By default, two pictures that end at their edges."""
        return Pictures(self.charts, EYES, self.parts)

    def standing_eye(self, right: mi.Bool) -> mi.Point3f:
        """Where eyes are that do not turn with the direction of view: beside each other along x, camera space, metres."""
        import drjit as dr
        import mitsuba as mi

        half = 0.5 * self.interocular_distance
        return mi.Point3f(dr.select(right, half, -half), 0.0, 0.0)

    @abstractmethod
    def eye_rays(self, right: mi.Bool, film: mi.Point2f, lens: mi.Point2f) -> tuple[mi.Point3f, mi.Vector3f, mi.Bool]:
        """As :meth:`camera_rays` for positions on the picture of the right eye or else of the left."""

    @abstractmethod
    def eye_point(self, right: mi.Bool, target: mi.Point3f, lens: mi.Point2f) -> FilmPoint:
        """As :meth:`film_point` for the picture of the right eye or else of the left."""

    @abstractmethod
    def eye_solid_angle(self, direction: mi.Vector3f) -> mi.Float:
        """As :meth:`solid_angle` for the picture of one eye."""

    def camera_rays(self, film: mi.Point2f, lens: mi.Point2f) -> tuple[mi.Point3f, mi.Vector3f, mi.Bool]:  # noqa: D102
        import drjit as dr
        import mitsuba as mi

        side_by_side = self.layout == "side-by-side"
        right = (film.x if side_by_side else film.y) >= 0.5
        half = dr.select(right, 1.0, 0.0)
        x, y = (2.0 * film.x - half, film.y) if side_by_side else (film.x, 2.0 * film.y - half)
        return self.eye_rays(right, mi.Point2f(x, y), lens)

    def film_point(self, target: mi.Point3f, lens: mi.Point2f) -> FilmPoint:
        """As in the base class; the first number of ``lens`` picks the eye, the left one below 0.5."""
        import drjit as dr
        import mitsuba as mi

        right = lens.x >= 0.5
        half = dr.select(right, 0.5, 0.0)
        seen = self.eye_point(right, target, mi.Point2f(2.0 * (lens.x - half), lens.y))
        x, y = seen.film.x, seen.film.y
        if self.layout == "side-by-side":
            film = mi.Point2f(0.5 * dr.minimum(x, LAST) + half, y)
        else:
            film = mi.Point2f(x, 0.5 * dr.minimum(y, LAST) + half)
        return FilmPoint(seen.origin, film, seen.inside, 2.0 * seen.weight)

    def solid_angle(self, direction: mi.Vector3f) -> mi.Float:  # noqa: D102
        return 2.0 * self.eye_solid_angle(direction)
