"""``[[light]]`` with ``type = "sun"``: a sun that shines into the place and that the capture point does not see."""

from __future__ import annotations

import math
from datetime import datetime
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from lightdepth.errors import InputError
from lightdepth.images.radiance import read_radiance
from lightdepth.packages import optional_package
from lightdepth.quantities import BRIGHTEST
from lightdepth.scene.lights.frame import sun_direction
from lightdepth.scene.lights.light import LightTable
from lightdepth.scene.model import SunLight
from lightdepth.scene.values import Angle, InputFile, Metres, Name, Number, Radiance, Vector3

SUN_DIAMETER = 0.53
"""Degrees, as seen from the earth."""


class SunTable(LightTable):
    """A sun: where it stands, in one of three ways, and how strong it is.

    ``direction`` points toward the sun, world. ``azimuth`` counts clockwise from +y as seen from above. With ``latitude``,
    ``longitude`` and ``time`` the direction is computed, and ``north`` is the azimuth of true north in the scene. All
    angles are in degrees. ``irradiance`` is that of a surface which faces the sun, in the panorama's unit of radiance
    times steradian. ``mask`` is an image, or ``recover``: the pattern that the patch of sun in the photograph shows.
    """

    type: Literal["sun"]
    name: Name = "sun"
    direction: Vector3 | None = None
    azimuth: Angle | None = None
    elevation: Annotated[Number | None, Field(ge=-90.0, le=90.0)] = None
    latitude: Annotated[Number | None, Field(ge=-90.0, le=90.0)] = None
    longitude: Annotated[Number | None, Field(ge=-180.0, le=180.0)] = None
    time: datetime | None = None
    north: Angle | None = None
    diameter: Number = Field(default=SUN_DIAMETER, ge=0.001, le=10.0)
    irradiance: tuple[Radiance, Radiance, Radiance]
    mask: Annotated[Literal["recover"] | InputFile | None, Field(union_mode="left_to_right")] = None
    mask_extent: tuple[Metres, Metres, Metres, Metres] | None = None

    @model_validator(mode="after")
    def _one_way(self) -> SunTable:
        ways: dict[str, list[object]] = {
            "direction": [self.direction],
            "azimuth and elevation": [self.azimuth, self.elevation],
            "latitude, longitude and time": [self.latitude, self.longitude, self.time],
        }
        begun = [name for name, values in ways.items() if any(value is not None for value in values)]
        if len(begun) != 1 or any(value is None for value in ways[begun[0]]):
            raise ValueError(f"give one of: {'; '.join(ways)}")
        if self.time is not None and self.time.tzinfo is None:
            raise ValueError("time needs an offset from UTC, as in 2026-06-21T15:30:00+02:00")
        if self.north is not None and self.latitude is None:
            raise ValueError("north goes with latitude, longitude and time")
        if self.direction is not None and not any(self.direction):
            raise ValueError("direction must not be (0, 0, 0)")
        if not any(self.irradiance):
            raise ValueError("irradiance must not be 0 in all channels")
        if (
            radiance := max(self.irradiance) / (math.pi * math.sin(math.radians(0.5 * self.diameter)) ** 2)
        ) > BRIGHTEST:
            raise ValueError(
                f"irradiance {max(self.irradiance):g} from a diameter of {self.diameter:g} degrees is a radiance of "
                f"{radiance:.3g}; allowed are up to {BRIGHTEST:g}"
            )
        if self.mask == "recover" and self.mask_extent is not None:
            raise ValueError('mask = "recover" finds the extent itself; mask_extent goes with an image')
        if self.mask != "recover" and (self.mask is None) != (self.mask_extent is None):
            raise ValueError("an image as mask and mask_extent = [left, bottom, right, top] go together")
        return self

    def light(self) -> SunLight:
        """As for every light.

        Raises:
            InputError: as :meth:`toward`, or the mask cannot be read or is none.
            SetupError: as :meth:`toward`.
        """
        mask = None
        if isinstance(self.mask, Path):
            mask = read_radiance(self.mask)
            if mask.max() > 1.0:
                raise InputError(
                    f"{self.mask}: a mask holds shares of light from 0 to 1, but this one has {mask.max():.3g}"
                )
        irradiance, recover = np.array(self.irradiance), self.mask == "recover"
        return SunLight(self.name, self.toward(), self.diameter, irradiance, mask, self.mask_extent, recover)

    def toward(self) -> NDArray[np.float64]:
        """The unit direction toward the sun, world, shape (3,).

        Raises:
            InputError: the sun is not above the horizon.
            SetupError: the package ``pvlib``, which knows where the sun is at a time, is missing.
        """
        if self.direction is not None:
            direction = np.array(self.direction) / math.hypot(*self.direction)
        elif self.azimuth is not None and self.elevation is not None:
            direction = sun_direction(self.azimuth, self.elevation)
        else:
            direction = self._at_time()
        if direction[2] <= 0.0:
            below = math.degrees(math.asin(-direction[2]))
            raise InputError(f"light '{self.name}': the sun stands {below:.1f} degrees below the horizon")
        return np.asarray(direction)

    def _at_time(self) -> NDArray[np.float64]:
        pvlib = optional_package("pvlib.solarposition", "sun")
        position = pvlib.get_solarposition(self.time, self.latitude, self.longitude)
        azimuth, elevation = float(position["azimuth"].iloc[0]), float(position["apparent_elevation"].iloc[0])
        return sun_direction(azimuth + (self.north or 0.0), elevation)
