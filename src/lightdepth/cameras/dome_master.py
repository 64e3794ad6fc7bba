"""The dome master: the frame that planetariums exchange."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from pydantic import Field

from lightdepth.cameras.camera import Camera, FilmPoint
from lightdepth.cameras.dome import LARGEST, WIDEST, Dome

if TYPE_CHECKING:
    import mitsuba as mi


class DomeMaster(Camera):
    """A frame for a dome as :class:`~lightdepth.cameras.dome.Dome` describes it; the camera's +y is the dome's front."""

    type: Literal["dome_master"]
    width: int = Field(gt=0, le=LARGEST)
    fov: float = Field(default=180.0, gt=0.0, le=WIDEST)
    tilt: float = Field(default=0.0, ge=0.0, le=90.0)

    @property
    def resolution(self) -> tuple[int, int]:  # noqa: D102
        return self.width, self.width

    def camera_rays(self, film: mi.Point2f, lens: mi.Point2f) -> tuple[mi.Point3f, mi.Vector3f, mi.Bool]:  # noqa: D102
        import drjit as dr
        import mitsuba as mi

        azimuth, elevation, inside = self._dome.angles(film)
        sin_phi, cos_phi = dr.sincos(azimuth)
        sine, cosine = dr.sincos(elevation)
        direction = self._dome.to_camera(mi.Vector3f(sin_phi * cosine, cos_phi * cosine, sine))
        return mi.Point3f(0.0), direction, inside

    def film_point(self, target: mi.Point3f, lens: mi.Point2f) -> FilmPoint:  # noqa: D102
        import drjit as dr
        import mitsuba as mi

        point = self._dome.from_camera(target)
        elevation = dr.atan2(point.z, dr.hypot(point.x, point.y))
        film, inside = self._dome.film(dr.atan2(point.x, point.y), elevation)
        return FilmPoint(mi.Point3f(0.0), film, inside, mi.Float(1.0))

    def solid_angle(self, direction: mi.Vector3f) -> mi.Float:  # noqa: D102
        return self._dome.solid_angle(self._dome.from_camera(direction))

    @property
    def _dome(self) -> Dome:
        return Dome(self.fov, self.tilt)
