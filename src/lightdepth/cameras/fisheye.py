"""The fulldome fisheye: equidistant or equisolid, up to 360 degrees, black outside its circle."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from lightdepth.cameras.camera import Camera, FilmPoint

if TYPE_CHECKING:
    import mitsuba as mi


class Fisheye(Camera):
    """Circular fisheye image, as wide as high, around the camera's +y.

    With ``theta`` the angle from the axis and ``r`` the distance from the image's centre (1 at the circle's edge,
    where ``theta = fov / 2``): equidistant ``theta = r fov / 2``; equisolid ``sin(theta / 2) = r sin(fov / 4)``.
    """

    type: Literal["fisheye"]
    fov: float = Field(default=180.0, gt=0.0, le=360.0)
    mapping: Literal["equidistant", "equisolid"] = "equidistant"

    @property
    def resolution(self) -> tuple[int, int]:  # noqa: D102
        return self.width, self.width

    def camera_rays(self, film: mi.Point2f, lens: mi.Point2f) -> tuple[mi.Point3f, mi.Vector3f, mi.Bool]:  # noqa: D102
        import drjit as dr
        import mitsuba as mi

        x, z = 2.0 * film.x - 1.0, 1.0 - 2.0 * film.y
        radius = dr.sqrt(x * x + z * z)
        inside = radius <= 1.0
        bounded = dr.minimum(radius, 1.0)
        if self.mapping == "equidistant":
            theta = bounded * math.radians(0.5 * self.fov)
        else:
            theta = 2.0 * dr.asin(bounded * math.sin(math.radians(0.25 * self.fov)))
        sin_theta, cos_theta = dr.sincos(theta)
        scale = dr.select(radius > 0.0, sin_theta / dr.maximum(radius, 1e-20), 0.0)
        return mi.Point3f(0.0), mi.Vector3f(x * scale, cos_theta, z * scale), inside

    def film_point(self, target: mi.Point3f, lens: mi.Point2f) -> FilmPoint:  # noqa: D102
        import drjit as dr
        import mitsuba as mi

        off_axis = dr.sqrt(dr.square(target.x) + dr.square(target.z))
        theta = dr.atan2(off_axis, target.y)
        if self.mapping == "equidistant":
            radius = theta / math.radians(0.5 * self.fov)
        else:
            radius = dr.sin(0.5 * theta) / math.sin(math.radians(0.25 * self.fov))
        scale = radius / dr.maximum(off_axis, 1e-20)
        film = mi.Point2f(0.5 + 0.5 * scale * target.x, 0.5 - 0.5 * scale * target.z)
        return FilmPoint(mi.Point3f(0.0), film, radius <= 1.0, mi.Float(1.0))

    def solid_angle(self, direction: mi.Vector3f) -> mi.Float:  # noqa: D102
        import drjit as dr
        import mitsuba as mi

        if self.mapping == "equisolid":
            return mi.Float(16.0 * math.sin(math.radians(0.25 * self.fov)) ** 2)
        sine = dr.sqrt(dr.square(direction.x) + dr.square(direction.z))
        theta = dr.atan2(sine, direction.y)
        return math.radians(self.fov) ** 2 * dr.select(theta > 1e-3, sine / dr.maximum(theta, 1e-3), 1.0)
