"""The dome on which a dome master is projected: where its frame shows directions."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

if TYPE_CHECKING:
    import mitsuba as mi

    Triple = TypeVar("Triple", mi.Point3f, mi.Vector3f)

LARGEST = 8192
"""Width of the largest frame, pixels."""
WIDEST = 220.0
"""Largest field of view, degrees."""


@dataclass(frozen=True)
class Dome:
    """AFDI/IMERSA, "Dome Master Show File Format": an equidistant image of the dome as the audience sees it.

    The zenith is the frame's middle, its circle touches the edges. The front is at the bottom, and the right hand of who
    looks to the front is on the right: the picture of a camera that looks up with its back to the bottom edge is not
    mirrored. Dome space has its origin in the dome's middle, x to the right, y to the front in the plane of the spring
    line and z to the zenith of the dome.

    Attributes:
        fov: field of view, degrees; below 180 or above, the circle is not the spring line.
        tilt: degrees by which the front of the spring line is lower than the middle.
    """

    fov: float
    tilt: float

    def angles(self, film: mi.Point2f) -> tuple[mi.Float, mi.Float, mi.Bool]:
        """Azimuth from the front to the right and elevation in radians, and whether the circle has the place."""
        import drjit as dr

        right, front = 2.0 * film.x - 1.0, 2.0 * film.y - 1.0
        radius = dr.hypot(right, front)
        return dr.atan2(right, front), 0.5 * dr.pi - radius * math.radians(0.5 * self.fov), radius <= 1.0

    def film(self, azimuth: mi.Float, elevation: mi.Float) -> tuple[mi.Point2f, mi.Bool]:
        """:meth:`angles` inverted."""
        import drjit as dr
        import mitsuba as mi

        radius = (0.5 * dr.pi - elevation) / math.radians(0.5 * self.fov)
        sine, cosine = dr.sincos(azimuth)
        return mi.Point2f(0.5 + 0.5 * radius * sine, 0.5 + 0.5 * radius * cosine), radius <= 1.0

    def solid_angle(self, direction: mi.Vector3f) -> mi.Float:
        """Steradians per unit of film area around unit directions in dome space."""
        import drjit as dr

        sine = dr.hypot(direction.x, direction.y)
        theta = dr.atan2(sine, direction.z)
        return math.radians(self.fov) ** 2 * dr.select(theta > 1e-3, sine / dr.maximum(theta, 1e-3), 1.0)

    def to_camera(self, value: Triple) -> Triple:
        """From dome space to camera space, whose y is level and z upward."""
        return self._turned(value, self.tilt)

    def from_camera(self, value: Triple) -> Triple:
        """From camera space to dome space."""
        return self._turned(value, -self.tilt)

    @staticmethod
    def _turned(value: Triple, degrees: float) -> Triple:
        sine, cosine = math.sin(math.radians(degrees)), math.cos(math.radians(degrees))
        return type(value)(value.x, cosine * value.y + sine * value.z, cosine * value.z - sine * value.y)
