"""The ordinary camera, with depth of field."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from lightdepth.cameras.camera import Camera, FilmPoint, Vector3

if TYPE_CHECKING:
    import mitsuba as mi

NEAR = 0.01
"""Distance in metres at which the projection's depth is 0; it is 1 infinitely far."""


class Perspective(Camera):
    """Thin-lens camera.

    ``fov`` is the horizontal field of view in degrees; ``look_at`` replaces ``rotation``; ``aperture`` is the lens's
    radius in metres (0: everything is sharp) and ``focus_distance`` the distance of the sharp plane in metres, which
    defaults to the distance of ``look_at``. ``shift`` moves the image by these shares of its width, to the right and
    up, as a shift lens does.
    """

    type: Literal["perspective"]
    height: int = Field(gt=0, le=65536)
    fov: float = Field(default=60.0, gt=0.0, lt=180.0)
    look_at: Vector3 | None = None
    aperture: float = Field(default=0.0, ge=0.0)
    focus_distance: float | None = Field(default=None, gt=0.0)
    shift: tuple[float, float] = (0.0, 0.0)

    @model_validator(mode="after")
    def _one_orientation_and_a_focus(self) -> Perspective:
        if self.look_at is not None and self.rotation is not None:
            raise ValueError("give rotation or look_at, not both")
        if self.aperture > 0.0 and self.focus_distance is None and self.look_at is None:
            raise ValueError("an aperture needs focus_distance or look_at")
        return self

    @property
    def resolution(self) -> tuple[int, int]:  # noqa: D102
        return self.width, self.height

    def _sharp_distance(self) -> float:
        """Distance of the plane in focus, metres."""
        if self.focus_distance is not None:
            return self.focus_distance
        if self.look_at is not None and self.position is not None:
            return math.dist(self.look_at, self.position)
        return 1.0

    def camera_rays(self, film: mi.Point2f, lens: mi.Point2f) -> tuple[mi.Point3f, mi.Vector3f, mi.Bool]:  # noqa: D102
        import drjit as dr
        import mitsuba as mi

        half_width = self._half_width()
        x = half_width * (2.0 * film.x - 1.0 + 2.0 * self.shift[0])
        z = half_width * ((1.0 - 2.0 * film.y) * (self.height / self.width) + 2.0 * self.shift[1])
        direction = mi.Vector3f(x, 1.0, z)
        if self.aperture == 0.0:
            return mi.Point3f(0.0), dr.normalize(direction), mi.Bool(True)
        origin = self._lens_point(lens)
        return origin, dr.normalize(self._sharp_distance() * direction - origin), mi.Bool(True)

    def film_point(self, target: mi.Point3f, lens: mi.Point2f) -> FilmPoint:  # noqa: D102
        import drjit as dr
        import mitsuba as mi

        origin, sharp_distance = self._lens_point(lens), self._sharp_distance()
        # Where the ray crosses the plane in focus, relative to its distance.
        through = origin + (target - origin) * (sharp_distance / dr.maximum(target.y, 1e-20))
        x, z = through.x / sharp_distance, through.z / sharp_distance
        half_width = self._half_width()
        right = 0.5 * (x / half_width + 1.0) - self.shift[0]
        up = (z / half_width - 2.0 * self.shift[1]) * (self.width / self.height)
        film = mi.Point2f(right, 0.5 * (1.0 - up))
        inside = (target.y > 0.0) & (film.x >= 0.0) & (film.x < 1.0) & (film.y >= 0.0) & (film.y < 1.0)
        return FilmPoint(origin, film, inside, mi.Float(1.0))

    def solid_angle(self, direction: mi.Vector3f) -> mi.Float:  # noqa: D102
        import drjit as dr

        cosine = dr.maximum(direction.y, 0.0)
        return 4.0 * self._half_width() ** 2 * (self.height / self.width) * cosine * dr.square(cosine)

    def projection_matrix(self) -> NDArray[np.float64]:  # noqa: D102
        across = 0.5 / self._half_width()
        aspect = self.width / self.height
        return np.array(
            [
                [across, 0.0, 0.0, 0.0],
                [0.0, -across * aspect, 0.0, 0.0],
                [0.5 - self.shift[0], 0.5 + self.shift[1] * aspect, 1.0, 1.0],
                [0.0, 0.0, -NEAR, 0.0],
            ]
        )

    @property
    def has_aperture(self) -> bool:  # noqa: D102
        return self.aperture > 0.0

    def blur(self, depth: mi.Float) -> mi.Float:  # noqa: D102
        import drjit as dr

        pixels = 0.5 * self.width / self._half_width()
        nearness = dr.rcp(dr.maximum(depth, 1e-3))
        return self.aperture * pixels * dr.abs(nearness - 1.0 / self._sharp_distance())

    def _half_width(self) -> float:
        """Half the image's width at distance 1."""
        return math.tan(math.radians(0.5 * self.fov))

    def _lens_point(self, lens: mi.Point2f) -> mi.Point3f:
        """Uniform over the aperture, camera space, metres."""
        import mitsuba as mi

        disk = self.aperture * mi.warp.square_to_uniform_disk_concentric(lens)
        return mi.Point3f(disk.x, 0.0, disk.y)
