"""Omnidirectional stereo: a full panorama for each eye, for headsets and stereoscopic players."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from pydantic import Field, model_validator

from lightdepth.cameras.camera import FilmPoint
from lightdepth.cameras.stereo import EYES, Stereo
from lightdepth.cameras.topology import Spherical
from lightdepth.cameras.viewing_circle import Elevations, ViewingCircle, check_circle
from lightdepth.quantities import Length

if TYPE_CHECKING:
    import mitsuba as mi


class OmnidirectionalStereo(Stereo):
    """Two equirectangular panoramas whose rays touch a :class:`~lightdepth.cameras.viewing_circle.ViewingCircle`.

    ``convergence_distance`` is in metres, ``zenith_merge`` and ``nadir_merge`` in degrees from the horizon; ``[90, 90]``
    merges nothing.
    """

    type: Literal["ods"]
    width: int = Field(gt=0, le=65536, multiple_of=4)
    convergence_distance: Length | None = None
    zenith_merge: Elevations = (60.0, 75.0)
    nadir_merge: Elevations = (60.0, 75.0)

    @model_validator(mode="after")
    def _possible_circle(self) -> OmnidirectionalStereo:
        check_circle(
            self.interocular_distance,
            self.convergence_distance,
            zenith_merge=self.zenith_merge,
            nadir_merge=self.nadir_merge,
        )
        return self

    @property
    def eye_height(self) -> int:  # noqa: D102
        return self.eye_width // 2

    @property
    def topology(self) -> Spherical:  # noqa: D102
        return Spherical(self.charts, EYES, self.parts)

    def eye_rays(  # noqa: D102
        self, right: mi.Bool, film: mi.Point2f, lens: mi.Point2f
    ) -> tuple[mi.Point3f, mi.Vector3f, mi.Bool]:
        import drjit as dr
        import mitsuba as mi

        rays = self._circle.rays(right, dr.two_pi * (film.x - 0.5), dr.pi * (0.5 - film.y))
        return *rays, mi.Bool(True)

    def eye_point(self, right: mi.Bool, target: mi.Point3f, lens: mi.Point2f) -> FilmPoint:  # noqa: D102
        import drjit as dr
        import mitsuba as mi

        seen = self._circle.sight(right, target)
        x, y = seen.azimuth / dr.two_pi + 0.5, 0.5 - seen.elevation / dr.pi
        return FilmPoint(seen.origin, mi.Point2f(x - dr.floor(x), y), seen.inside, seen.weight)

    def eye_solid_angle(self, direction: mi.Vector3f) -> mi.Float:
        """As in the base class; with convergence, but for the square of the eyes' distance relative to it."""
        import drjit as dr

        return dr.two_pi * dr.pi * dr.safe_sqrt(1.0 - dr.square(direction.z))

    @property
    def _circle(self) -> ViewingCircle:
        return ViewingCircle(self.interocular_distance, self.convergence_distance, self.zenith_merge, self.nadir_merge)
