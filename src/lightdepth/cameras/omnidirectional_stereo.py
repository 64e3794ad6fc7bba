"""Omnidirectional stereo: a full panorama for each eye, for headsets and stereoscopic players."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal

from pydantic import Field, model_validator

from lightdepth.cameras.camera import Camera, FilmPoint
from lightdepth.cameras.topology import Rectangle, Spherical

if TYPE_CHECKING:
    import mitsuba as mi

HALVINGS = 26
"""Of the interval in which the ray through a point is searched: as many as single precision has digits."""
Elevations = tuple[float, float]


class OmnidirectionalStereo(Camera):
    """Two equirectangular panoramas whose rays touch a circle as wide as the eyes are apart.

    Google, "Rendering Omni-directional Stereo Content" (2015): the ray of azimuth ``phi`` and elevation ``e`` starts at
    ``(+-r cos phi, -+r sin phi, 0)``, the right eye's with the upper signs, and goes along
    ``(sin phi cos e, cos phi cos e, sin e)``. As in Cycles, with a ``convergence_distance`` it goes through the point at
    that distance along this direction from the circle's middle, which then has no disparity; and toward zenith and
    nadir, where no circle serves all directions of view, ``r`` falls to 0 between two elevations.

    ``interocular_distance`` and ``convergence_distance`` are in metres, ``zenith_merge`` and ``nadir_merge`` in degrees
    from the horizon; ``[90, 90]`` merges nothing. The left eye is on top or, side by side, on the left.
    """

    type: Literal["ods"]
    width: int = Field(gt=0, le=65536, multiple_of=4)
    interocular_distance: float = Field(default=0.064, ge=0.0, le=1.0)
    convergence_distance: float | None = Field(default=None, gt=0.0)
    zenith_merge: Elevations = (60.0, 75.0)
    nadir_merge: Elevations = (60.0, 75.0)
    layout: Literal["top-bottom", "side-by-side"] = "top-bottom"

    @model_validator(mode="after")
    def _ordered_elevations(self) -> OmnidirectionalStereo:
        for name in ("zenith_merge", "nadir_merge"):
            first, last = getattr(self, name)
            if (first, last) != (90.0, 90.0) and not 0.0 <= first < last <= 90.0:
                raise ValueError(f"{name} must be two elevations, 0 <= from < to <= 90, or [90, 90] for no merging")
        if self.convergence_distance is not None and self.convergence_distance <= self.interocular_distance:
            raise ValueError("convergence_distance must be greater than interocular_distance")
        return self

    @property
    def resolution(self) -> tuple[int, int]:  # noqa: D102
        return (self.width, self.width) if self.layout == "top-bottom" else (self.width, self.width // 4)

    @property
    def topology(self) -> Spherical:  # noqa: D102
        width, height = self.resolution
        if self.layout == "top-bottom":
            charts = Rectangle(0, height // 2, 0, width), Rectangle(height // 2, height, 0, width)
        else:
            charts = Rectangle(0, height, 0, width // 2), Rectangle(0, height, width // 2, width)
        return Spherical(charts, ("left", "right"))

    def camera_rays(self, film: mi.Point2f, lens: mi.Point2f) -> tuple[mi.Point3f, mi.Vector3f, mi.Bool]:  # noqa: D102
        import drjit as dr
        import mitsuba as mi

        top_bottom = self.layout == "top-bottom"
        right = (film.y if top_bottom else film.x) >= 0.5
        half = dr.select(right, 1.0, 0.0)
        x, y = (film.x, 2.0 * film.y - half) if top_bottom else (2.0 * film.x - half, film.y)
        sin_phi, cos_phi = dr.sincos(dr.two_pi * (x - 0.5))
        sine, cosine = dr.sincos(dr.pi * (0.5 - y))
        radius, _ = self._radius(dr.pi * (0.5 - y))
        radius = dr.select(right, radius, -radius)
        origin = mi.Point3f(radius * cos_phi, -radius * sin_phi, 0.0)
        direction = mi.Vector3f(sin_phi * cosine, cos_phi * cosine, sine)
        if self.convergence_distance is not None:
            direction = dr.normalize(direction - mi.Vector3f(origin) / self.convergence_distance)
        return origin, direction, mi.Bool(True)

    def film_point(self, target: mi.Point3f, lens: mi.Point2f) -> FilmPoint:
        """As the base has it; the first number of ``lens`` picks the eye, the left one below 0.5.

        With ``k`` the distance along the direction of the film from the circle's middle, ``m`` its horizontal part and
        ``f = 1 - k / convergence``, the ray comes to ``f r`` beside the axis of view: ``m^2 + (f r)^2`` is the square of
        the point's horizontal distance. The left side grows with ``m``, which is found by halving an interval.
        """
        import drjit as dr
        import mitsuba as mi

        right = lens.x >= 0.5
        distance = dr.hypot(target.x, target.y)
        shortening = 0.0 if self.convergence_distance is None else 1.0 / self.convergence_distance

        def aside(horizontal: mi.Float) -> mi.Float:
            radius, _ = self._radius(dr.atan2(target.z, horizontal))
            return radius * (1.0 - shortening * dr.hypot(horizontal, target.z))

        def halve(count: mi.UInt32, low: mi.Float, high: mi.Float) -> tuple[mi.UInt32, mi.Float, mi.Float]:
            middle = 0.5 * (low + high)
            beyond = dr.hypot(middle, aside(middle)) > distance
            return count + 1, dr.select(beyond, low, middle), dr.select(beyond, middle, high)

        state = mi.UInt32(0), dr.zeros(mi.Float, dr.width(distance)), mi.Float(distance)
        _, low, high = dr.while_loop(state, lambda count, low, high: count < HALVINGS, halve)
        horizontal = 0.5 * (low + high)
        elevation = dr.atan2(target.z, horizontal)
        radius, slope = self._radius(elevation)
        along = dr.hypot(horizontal, target.z)
        shift = 1.0 - shortening * along
        phi = dr.atan2(target.x, target.y) - dr.atan2(dr.select(right, shift, -shift) * radius, horizontal)
        x, y = phi / dr.two_pi + 0.5, 0.5 - elevation / dr.pi
        x -= dr.floor(x)
        half = dr.select(right, 0.5, 0.0)
        film = mi.Point2f(x, 0.5 * y + half) if self.layout == "top-bottom" else mi.Point2f(0.5 * x + half, y)

        sin_phi, cos_phi = dr.sincos(phi)
        sine, cosine = dr.sincos(elevation)
        side = dr.select(right, radius, -radius)
        origin = mi.Point3f(side * cos_phi, -side * sin_phi, 0.0)
        # The area across the ray that azimuth and elevation cover there.
        turn = radius * shortening
        area = dr.square(along) * cosine - shift * radius * (shift * slope * sine + along * cosine * turn)
        from_one_point = dr.square(along) * (1.0 + dr.square(turn)) * dr.hypot(cosine, turn)
        weight = 2.0 * from_one_point / dr.maximum(area, 1e-12)
        # Inside the circle the rays of one elevation pass by.
        inside = dr.abs(dr.hypot(horizontal, shift * radius) - distance) < 1e-4 + 1e-3 * distance
        return FilmPoint(origin, film, inside, weight)

    def solid_angle(self, direction: mi.Vector3f) -> mi.Float:
        """As the base has it; with convergence, but for the square of the eyes' distance relative to it."""
        import drjit as dr

        return dr.square(dr.two_pi) * dr.safe_sqrt(1.0 - dr.square(direction.z))

    def _radius(self, elevation: mi.Float) -> tuple[mi.Float, mi.Float]:
        """Radius of the circle at elevations in radians, metres, and its derivative."""
        import drjit as dr

        above, below = (self._faded(dr.abs(elevation), *ends) for ends in (self.zenith_merge, self.nadir_merge))
        up = elevation >= 0.0
        return dr.select(up, above[0], below[0]), dr.select(up, above[1], -below[1])

    def _faded(self, elevation: mi.Float, first: float, last: float) -> tuple[mi.Float, mi.Float]:
        """Radius of the circle and its derivative where it falls to 0 between two elevations in degrees."""
        import drjit as dr
        import mitsuba as mi

        radius = 0.5 * self.interocular_distance
        if first == last:
            return mi.Float(radius), mi.Float(0.0)
        rate = 0.5 * math.pi / math.radians(last - first)
        sine, cosine = dr.sincos(dr.clip((elevation - math.radians(first)) * rate, 0.0, 0.5 * math.pi))
        falls = (elevation > math.radians(first)) & (elevation < math.radians(last))
        return radius * dr.maximum(cosine, 0.0), dr.select(falls, -radius * rate * sine, 0.0)
