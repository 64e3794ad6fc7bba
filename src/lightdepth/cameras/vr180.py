"""VR180: the front half of the sphere for two eyes that stand still, as headsets and players show it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from lightdepth.cameras.camera import FilmPoint
from lightdepth.cameras.stereo import Layout, Stereo

if TYPE_CHECKING:
    import mitsuba as mi


class VR180(Stereo):
    """Two equirectangular pictures of 180 by 180 degrees around +y, by default side by side.

    Google, "Spherical Video V2": the projection ``equi`` with bounds that leave a quarter of it away on the left and on
    the right. The eyes are ``interocular_distance`` apart along x and look in parallel.
    """

    type: Literal["vr180"]
    layout: Layout = "side-by-side"

    @property
    def eye_height(self) -> int:  # noqa: D102
        return self.eye_width

    def eye_rays(  # noqa: D102
        self, right: mi.Bool, film: mi.Point2f, lens: mi.Point2f
    ) -> tuple[mi.Point3f, mi.Vector3f, mi.Bool]:
        import drjit as dr
        import mitsuba as mi

        sin_theta, cos_theta = dr.sincos(dr.pi * film.y)
        sin_phi, cos_phi = dr.sincos(dr.pi * (film.x - 0.5))
        direction = mi.Vector3f(sin_theta * sin_phi, sin_theta * cos_phi, cos_theta)
        return self.standing_eye(right), direction, mi.Bool(True)

    def eye_point(self, right: mi.Bool, target: mi.Point3f, lens: mi.Point2f) -> FilmPoint:  # noqa: D102
        import drjit as dr
        import mitsuba as mi

        origin = self.standing_eye(right)
        direction = dr.normalize(mi.Vector3f(target - origin))
        x, y = 0.5 + dr.atan2(direction.x, direction.y) / dr.pi, dr.safe_acos(direction.z) / dr.pi
        return FilmPoint(origin, mi.Point2f(x, y), direction.y >= 0.0, mi.Float(1.0))

    def eye_solid_angle(self, direction: mi.Vector3f) -> mi.Float:  # noqa: D102
        import drjit as dr

        return dr.pi * dr.pi * dr.safe_sqrt(1.0 - dr.square(direction.z))
