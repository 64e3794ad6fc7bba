"""Stereo for domes: a dome master for each eye."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from pydantic import Field, model_validator

from lightdepth.cameras.camera import FilmPoint
from lightdepth.cameras.dome import LARGEST, WIDEST, Dome
from lightdepth.cameras.stereo import Layout, Stereo
from lightdepth.cameras.viewing_circle import Elevations, ViewingCircle, check_circle
from lightdepth.quantities import Length

if TYPE_CHECKING:
    import mitsuba as mi


class DomeStereo(Stereo):
    """Two dome masters whose eyes turn with the azimuth, so that the stereo is right wherever in the dome one looks.

    Bourke, "Omnidirectional fisheye for dome projection" (2025): at each azimuth around the dome's axis the eyes are
    beside each other across the direction of view. They are on a
    :class:`~lightdepth.cameras.viewing_circle.ViewingCircle` in the plane of the spring line and merge toward the zenith.
    """

    type: Literal["dome_stereo"]
    width: int = Field(gt=0, le=2 * LARGEST)
    fov: float = Field(default=180.0, gt=0.0, le=WIDEST)
    tilt: float = Field(default=0.0, ge=0.0, le=90.0)
    convergence_distance: Length | None = None
    zenith_merge: Elevations = (60.0, 75.0)
    layout: Layout = "separate"

    @model_validator(mode="after")
    def _possible_circle(self) -> DomeStereo:
        check_circle(self.interocular_distance, self.convergence_distance, zenith_merge=self.zenith_merge)
        if self.eye_width > LARGEST:
            raise ValueError(f"width must be at most {LARGEST} for each eye")
        return self

    @property
    def eye_height(self) -> int:  # noqa: D102
        return self.eye_width

    def eye_rays(  # noqa: D102
        self, right: mi.Bool, film: mi.Point2f, lens: mi.Point2f
    ) -> tuple[mi.Point3f, mi.Vector3f, mi.Bool]:
        azimuth, elevation, inside = self._dome.angles(film)
        origin, direction = self._circle.rays(right, azimuth, elevation)
        return self._dome.to_camera(origin), self._dome.to_camera(direction), inside

    def eye_point(self, right: mi.Bool, target: mi.Point3f, lens: mi.Point2f) -> FilmPoint:  # noqa: D102
        seen = self._circle.sight(right, self._dome.from_camera(target))
        film, inside = self._dome.film(seen.azimuth, seen.elevation)
        return FilmPoint(self._dome.to_camera(seen.origin), film, inside & seen.inside, seen.weight)

    def eye_solid_angle(self, direction: mi.Vector3f) -> mi.Float:
        """As in the base class; with convergence, but for the square of the eyes' distance relative to it."""
        return self._dome.solid_angle(self._dome.from_camera(direction))

    @property
    def _dome(self) -> Dome:
        return Dome(self.fov, self.tilt)

    @property
    def _circle(self) -> ViewingCircle:
        return ViewingCircle(self.interocular_distance, self.convergence_distance, self.zenith_merge)
