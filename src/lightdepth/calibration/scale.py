"""The camera's height from one known length: a door, or a distance on the floor."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from lightdepth.calibration.clicks import read_clicks
from lightdepth.directions import FloatArray
from lightdepth.errors import InputError
from lightdepth.parameters.calibration import DEFAULT, CalibrationParameters

OPTION = "--scale-from"


@dataclass(frozen=True)
class KnownLength:
    """Two clicked points and what lies between them.

    Attributes:
        ends: their directions, unit, light space, shape (2, 3).
        length: metres.
    """

    ends: FloatArray
    length: float


def read_known_length(text: str, size: tuple[int, int] | None) -> KnownLength:
    """Read ``x,y x,y = 2.0 m``.

    Args:
        text: as it was written; the unit may be left out, and is metres.
        size: height and width of the panorama in pixels; ``None`` where points are angles.

    Raises:
        InputError: it is written otherwise, or the length is not positive.
    """
    points, equals, length = text.partition("=")
    match = re.fullmatch(r"\s*([0-9.]+(?:[eE][-+]?[0-9]+)?)\s*m?\s*", length)
    try:
        metres = float(match[1]) if match else 0.0
    except ValueError:
        metres = 0.0
    if not equals or not 0.0 < metres < np.inf:
        raise InputError(f"{OPTION} '{text}': write two points and the length between them as 'x,y x,y = 2.0 m'")
    return KnownLength(read_clicks(points, size, OPTION, 2), metres)


def height_from_length(known: KnownLength, rotation: FloatArray, tuned: CalibrationParameters = DEFAULT) -> float:
    """Height of the capture point above the floor, metres.

    Points one above the other are a plumb edge that begins on the floor, such as a door's; two others lie on the floor.

    Args:
        known: the points.
        rotation: light space to a level world, shape (3, 3).
        tuned: what counts as plumb.

    Raises:
        InputError: no point is on the floor, or the points coincide.
    """
    world = known.ends @ rotation.T
    slopes = world[:, 2] / np.maximum(np.hypot(world[:, 0], world[:, 1]), 1e-9)  # Tangents of the elevations.
    azimuths = np.degrees(np.arctan2(world[:, 0], world[:, 1]))
    apart = abs((azimuths[0] - azimuths[1] + 180.0) % 360.0 - 180.0)
    low = int(np.argmin(slopes))
    if slopes[low] > -0.01:
        raise InputError(f"{OPTION}: neither point lies below the horizon; one of them at least must be on the floor")
    if apart < tuned.plumb:
        rise = 1.0 - slopes[1 - low] / slopes[low]
        if rise < 1e-3:
            raise InputError(f"{OPTION}: the two points coincide; click the foot and the top of a plumb edge")
        return float(known.length / rise)
    if slopes.max() > -0.01:
        raise InputError(
            f"{OPTION}: the points lie {apart:.1f} degrees of azimuth apart, and one of them is not below the horizon; "
            f"click the foot and the top of a plumb edge (within {tuned.plumb:g} degrees), or two points on the floor"
        )
    floor = world[:, :2] / -world[:, 2:]
    return float(known.length / np.linalg.norm(floor[1] - floor[0]))
