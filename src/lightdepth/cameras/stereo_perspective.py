"""The stereo pair of ordinary cameras, for screens."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

from pydantic import Field, model_validator

from lightdepth.cameras.camera import FilmPoint
from lightdepth.cameras.perspective import Perspective
from lightdepth.cameras.stereo import Layout, Stereo
from lightdepth.quantities import FARTHEST, Coordinates, FilmOffset, Length

if TYPE_CHECKING:
    import mitsuba as mi


class StereoPerspective(Stereo):
    """Two thin-lens cameras beside each other that look in parallel, with films moved so that they meet.

    The off-axis pair: what is ``convergence_distance`` in front of the camera has no disparity, and nothing has a vertical
    one, as it would have if the cameras were turned inward. Without it, what is infinitely far has none. At the depth
    ``d`` the left eye's picture is ``b (1/d - 1/c) / (2 tan(fov / 2))`` of an eye's width farther to the right, with
    ``b`` the interocular and ``c`` the convergence distance. The other settings are those of
    :class:`~lightdepth.cameras.perspective.Perspective`; ``height`` is that of a file.
    """

    type: Literal["stereo_perspective"]
    height: int = Field(gt=0, le=65536)
    fov: float = Field(default=60.0, gt=0.0, lt=180.0)
    look_at: Coordinates | None = None
    aperture: float = Field(default=0.0, ge=0.0, le=FARTHEST)
    focus_distance: Length | None = None
    shift: FilmOffset = (0.0, 0.0)
    convergence_distance: Length | None = None
    layout: Layout = "side-by-side"

    @model_validator(mode="after")
    def _possible_pair(self) -> StereoPerspective:
        if self.layout == "top-bottom" and self.height % 2:
            raise ValueError("height must be even: it is that of both eyes together")
        if self.convergence_distance is not None and self.convergence_distance <= self.interocular_distance:
            raise ValueError("convergence_distance must be greater than interocular_distance")
        _ = self._camera  # Checks the rest.
        return self

    @property
    def eye_height(self) -> int:  # noqa: D102
        return self.height // 2 if self.layout == "top-bottom" else self.height

    def eye_rays(  # noqa: D102
        self, right: mi.Bool, film: mi.Point2f, lens: mi.Point2f
    ) -> tuple[mi.Point3f, mi.Vector3f, mi.Bool]:
        import drjit as dr
        import mitsuba as mi

        moved = mi.Point2f(film.x - dr.select(right, self._inward, -self._inward), film.y)
        origin, direction, inside = self._camera.camera_rays(moved, lens)
        return origin + self.standing_eye(right), direction, inside

    def eye_point(self, right: mi.Bool, target: mi.Point3f, lens: mi.Point2f) -> FilmPoint:  # noqa: D102
        import drjit as dr
        import mitsuba as mi

        eye = self.standing_eye(right)
        seen = self._camera.film_point(mi.Point3f(target - eye), lens)
        film = mi.Point2f(seen.film.x + dr.select(right, self._inward, -self._inward), seen.film.y)
        inside = (target.y > 0.0) & (film.x >= 0.0) & (film.x < 1.0) & (film.y >= 0.0) & (film.y < 1.0)
        return FilmPoint(seen.origin + eye, film, inside, seen.weight)

    def eye_solid_angle(self, direction: mi.Vector3f) -> mi.Float:  # noqa: D102
        return self._camera.solid_angle(direction)

    @property
    def has_aperture(self) -> bool:  # noqa: D102
        return self.aperture > 0.0

    def blur(self, depth: mi.Float) -> mi.Float:  # noqa: D102
        return self._camera.blur(depth)

    @property
    def _camera(self) -> Perspective:
        """The camera of either eye, without its place and the move of its film."""
        return Perspective(
            type="perspective",
            width=self.eye_width,
            height=self.eye_height,
            position=self.position,
            rotation=self.rotation,
            look_at=self.look_at,
            fov=self.fov,
            aperture=self.aperture,
            focus_distance=self.focus_distance,
            shift=self.shift,
        )

    @property
    def _inward(self) -> float:
        """By which the right eye's film is shifted, in shares of its width."""
        if self.convergence_distance is None:
            return 0.0
        slope = 0.5 * self.interocular_distance / self.convergence_distance
        return 0.5 * slope / math.tan(math.radians(0.5 * self.fov))
