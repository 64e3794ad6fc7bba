"""The full panorama: 360 by 180 degrees, in the layout of the input panorama."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from pydantic import Field

from lightdepth.cameras.camera import Camera, FilmPoint
from lightdepth.cameras.topology import Rectangle, Spherical

if TYPE_CHECKING:
    import mitsuba as mi


class Equirectangular(Camera):
    """Equirectangular panorama; its height is half its width."""

    type: Literal["equirectangular"]
    width: int = Field(gt=0, le=65536, multiple_of=2)

    @property
    def resolution(self) -> tuple[int, int]:  # noqa: D102
        return self.width, self.width // 2

    @property
    def topology(self) -> Spherical:  # noqa: D102
        width, height = self.resolution
        return Spherical((Rectangle(0, height, 0, width),))

    def camera_rays(self, film: mi.Point2f, lens: mi.Point2f) -> tuple[mi.Point3f, mi.Vector3f, mi.Bool]:  # noqa: D102
        import drjit as dr
        import mitsuba as mi

        sin_theta, cos_theta = dr.sincos(dr.pi * film.y)
        sin_phi, cos_phi = dr.sincos(dr.two_pi * (film.x - 0.5))
        return mi.Point3f(0.0), mi.Vector3f(sin_theta * sin_phi, sin_theta * cos_phi, cos_theta), mi.Bool(True)

    def film_point(self, target: mi.Point3f, lens: mi.Point2f) -> FilmPoint:  # noqa: D102
        import drjit as dr
        import mitsuba as mi

        direction = dr.normalize(mi.Vector3f(target))
        x = 0.5 + dr.atan2(direction.x, direction.y) / dr.two_pi
        return FilmPoint(
            mi.Point3f(0.0), mi.Point2f(x, dr.safe_acos(direction.z) / dr.pi), mi.Bool(True), mi.Float(1.0)
        )

    def solid_angle(self, direction: mi.Vector3f) -> mi.Float:  # noqa: D102
        import drjit as dr

        return dr.two_pi * dr.pi * dr.safe_sqrt(1.0 - dr.square(direction.z))
