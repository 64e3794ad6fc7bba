"""The sun outside a place: a far, glowing disc."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from bench.places.objects import Color, Point, rgb
from lightdepth.scene.model import SunLight


@dataclass(frozen=True)
class Sun:
    """The sun as it stands over a place.

    Attributes:
        direction: toward the sun, world; any length.
        irradiance: on a surface that faces it, per channel.
        diameter: degrees.
        distance: metres; from a few thousand, its light would differ by two thousandths from one end of a court to the
            other.
    """

    direction: Point
    irradiance: Color
    diameter: float = 0.53
    distance: float = 1e5

    @property
    def radiance(self) -> Color:
        """Of the disc, per channel: a disc of half angle ``a`` gives the irradiance ``pi sin(a)^2`` times it."""
        projected = np.pi * np.sin(np.radians(0.5 * self.diameter)) ** 2
        red, green, blue = (value / projected for value in self.irradiance)
        return float(red), float(green), float(blue)

    def declared(self) -> SunLight:
        """The sun as a user declares it."""
        direction = np.array(self.direction) / np.linalg.norm(self.direction)
        return SunLight("sun", direction, self.diameter, np.array(self.irradiance))

    def mitsuba(self) -> dict[str, Any]:
        """The disc as the entry ``sun`` of a Mitsuba scene dictionary."""
        return sun_disc(self.direction, self.radiance, self.diameter, self.distance)


def sun_disc(direction: Point, radiance: Color, diameter: float, distance: float) -> dict[str, Any]:
    """A far, glowing disc as the entry ``sun`` of a Mitsuba scene dictionary.

    Args:
        direction: toward it, world; any length.
        radiance: per channel.
        diameter: degrees.
        distance: metres.
    """
    import mitsuba as mi

    toward = np.asarray(direction) / np.linalg.norm(direction)
    radius = distance * np.tan(np.radians(0.5 * diameter))
    transform = mi.ScalarTransform4f
    to_world = transform().look_at(
        origin=(distance * toward).tolist(), target=[0.0, 0.0, 0.0], up=[0.3, 0.2, 1.0]
    ) @ transform().scale(float(radius))
    return {
        "sun": {
            "type": "disk",
            "to_world": to_world,
            "bsdf": {"type": "diffuse", "reflectance": rgb((0.0, 0.0, 0.0))},
            "emitter": {"type": "area", "radiance": rgb(radiance)},
        }
    }
