"""The circle on which the eyes of omnidirectional stereo turn with the direction of view."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import mitsuba as mi

HALVINGS = 26
"""Of the interval in which the ray through a point is searched: as many as single precision has digits."""
Elevations = tuple[float, float]
NO_MERGE: Elevations = (90.0, 90.0)


@dataclass
class Sight:
    """The ray of an eye through a point.

    Attributes:
        azimuth: of the ray in the picture, radians, in (-2 pi, 2 pi).
        elevation: likewise.
        origin: where the ray starts, metres.
        inside: false where the eye does not see the point.
        weight: the area across the ray that a unit of solid angle would cover from one origin, over that which azimuth
            and elevation cover.
    """

    azimuth: mi.Float
    elevation: mi.Float
    origin: mi.Point3f
    inside: mi.Bool
    weight: mi.Float


@dataclass(frozen=True)
class ViewingCircle:
    """Rays that touch a circle around the origin, level, as wide as the eyes are apart.

    Google, "Rendering Omni-directional Stereo Content" (2015): the ray of azimuth ``phi`` and elevation ``e`` starts at
    ``(+-r cos phi, -+r sin phi, 0)``, the right eye's with the upper signs, and goes along
    ``(sin phi cos e, cos phi cos e, sin e)``. As in Cycles, with ``convergence`` it goes through the point at that
    distance along this direction from the circle's middle, which then has no disparity; and toward zenith and nadir,
    where no circle serves all directions of view, ``r`` falls to 0 between two elevations.

    Attributes:
        interocular_distance: metres.
        convergence: metres; ``None`` for parallel lines of sight.
        zenith_merge: degrees above the horizon between which the eyes merge; ``NO_MERGE`` for never.
        nadir_merge: likewise, below.
    """

    interocular_distance: float
    convergence: float | None = None
    zenith_merge: Elevations = NO_MERGE
    nadir_merge: Elevations = NO_MERGE

    def rays(self, right: mi.Bool, azimuth: mi.Float, elevation: mi.Float) -> tuple[mi.Point3f, mi.Vector3f]:
        """Origins in metres and unit directions of the right eye's rays, or else of the left's."""
        import drjit as dr
        import mitsuba as mi

        sin_phi, cos_phi = dr.sincos(azimuth)
        sine, cosine = dr.sincos(elevation)
        radius, _ = self._radius(elevation)
        radius = dr.select(right, radius, -radius)
        origin = mi.Point3f(radius * cos_phi, -radius * sin_phi, 0.0)
        direction = mi.Vector3f(sin_phi * cosine, cos_phi * cosine, sine)
        if self.convergence is not None:
            direction = dr.normalize(direction - mi.Vector3f(origin) / self.convergence)
        return origin, direction

    def sight(self, right: mi.Bool, target: mi.Point3f) -> Sight:
        """The right eye's ray through points, or else the left's: :meth:`rays` inverted.

        With ``k`` the distance along the direction of the picture from the circle's middle, ``m`` its horizontal part
        and ``f = 1 - k / convergence``, the ray comes to ``f r`` beside the axis of view: ``m^2 + (f r)^2`` is the square
        of the point's horizontal distance. The left side grows with ``m``, which is found by halving an interval.
        """
        import drjit as dr
        import mitsuba as mi

        distance = dr.hypot(target.x, target.y)
        shortening = 0.0 if self.convergence is None else 1.0 / self.convergence

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
        azimuth = dr.atan2(target.x, target.y) - dr.atan2(dr.select(right, shift, -shift) * radius, horizontal)

        sin_phi, cos_phi = dr.sincos(azimuth)
        sine, cosine = dr.sincos(elevation)
        side = dr.select(right, radius, -radius)
        origin = mi.Point3f(side * cos_phi, -side * sin_phi, 0.0)
        # The area across the ray that azimuth and elevation cover there.
        turn = radius * shortening
        area = dr.square(along) * cosine - shift * radius * (shift * slope * sine + along * cosine * turn)
        from_one_point = dr.square(along) * (1.0 + dr.square(turn)) * dr.hypot(cosine, turn)
        # Inside the circle the rays of one elevation pass by.
        inside = dr.abs(dr.hypot(horizontal, shift * radius) - distance) < 1e-4 + 1e-3 * distance
        return Sight(azimuth, elevation, origin, inside, from_one_point / dr.maximum(area, 1e-12))

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


def check_circle(interocular_distance: float, convergence: float | None, **merges: Elevations) -> None:
    """Check settings that belong together.

    Args:
        interocular_distance: metres.
        convergence: metres, or ``None``.
        merges: elevations in degrees by the name of their setting.

    Raises:
        ValueError: the eyes cross nearer than they are apart, or elevations are out of order.
    """
    for name, (first, last) in merges.items():
        if (first, last) != NO_MERGE and not 0.0 <= first < last <= 90.0:
            raise ValueError(f"{name} must be two elevations, 0 <= from < to <= 90, or [90, 90] for no merging")
    if convergence is not None and convergence <= interocular_distance:
        raise ValueError("convergence_distance must be greater than interocular_distance")
