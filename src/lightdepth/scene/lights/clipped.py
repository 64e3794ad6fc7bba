"""``[[light]]`` with ``type = "clipped"``: a source that the panorama clipped, and what it really sends.

It gives this light to surfaces, reflections and objects; the plate stays as the panorama has it.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field
from scipy import ndimage

from lightdepth.directions import latlong_to_direction, pixel_solid_angles
from lightdepth.errors import InputError
from lightdepth.scene.lights.light import LightTable
from lightdepth.scene.model import Panorama
from lightdepth.scene.values import Name, Number, Radiance

SAME = 0.98
"""Share of the radiance at the source's pixel from which on its neighbours belong to the plateau."""
PARTS = 8
"""Each way, into which a pixel is cut to see how much of it a disc covers."""


Coordinate = Annotated[Number, Field(ge=0.0)]


class ClippedTable(LightTable):
    """A clipped source.

    ``pixel`` is a place in it in the panorama, x to the right and y down; ``radiance`` what it really has, in the
    panorama's unit with its ``scale`` applied. All that is joined to the pixel and as bright gets it, or, with ``diameter``
    (degrees), a disc around it.
    """

    type: Literal["clipped"]
    name: Name = "clipped"
    pixel: tuple[Coordinate, Coordinate]
    radiance: tuple[Radiance, Radiance, Radiance]
    diameter: Number | None = Field(default=None, gt=0.0, le=30.0)

    def corrected(self, panorama: Panorama) -> Panorama:
        """As for every light: its light is that of the source, and the picture stays what it was."""
        if not panorama.radiance.size:
            return panorama
        return replace(panorama, unclipped=unclipped(panorama.light_radiance, self.source()))

    def source(self) -> ClippedSource:
        """The source as plain data."""
        return ClippedSource(self.pixel, np.array(self.radiance), self.diameter, self.name)


@dataclass(frozen=True, eq=False)
class ClippedSource:
    """Where a clipped source is in the panorama, and its radiance.

    Attributes:
        pixel: x and y in the panorama's pixels, inside its plateau.
        radiance: of the source, linear RGB, in the panorama's unit with its scale applied, shape (3,), float64.
        diameter: degrees of a disc around ``pixel`` to which the source is limited, such as the sun in a sky that
            clipped too; ``None`` means the whole plateau.
        name: for messages.
    """

    pixel: tuple[float, float]
    radiance: NDArray[np.float64]
    diameter: float | None = None
    name: str = "clipped"


def unclipped(radiance: NDArray[np.float32], source: ClippedSource) -> NDArray[np.float32]:
    """A copy of a panorama in which a source has its own radiance; for light alone, the plate stays.

    Args:
        radiance: linear RGB, shape (height, 2 height, 3), float32.
        source: no pixel gets darker than it was.

    Raises:
        InputError: the source's pixel is not on the panorama.
    """
    share = covered(radiance, source)[..., None].astype(np.float32)
    bright = np.maximum(radiance, np.asarray(source.radiance, np.float32))
    return np.asarray(radiance + share * (bright - radiance))


def covered(radiance: NDArray[np.float32], source: ClippedSource) -> NDArray[np.float64]:
    """Share of each pixel that belongs to a source, shape (height, 2 height).

    Args:
        radiance: linear RGB, shape (height, 2 height, 3).
        source: its own radiance does not matter.

    Raises:
        InputError: the source's pixel is not on the panorama.
    """
    height, width = radiance.shape[:2]
    x, y = source.pixel
    if not (0.0 <= x < width and 0.0 <= y < height):
        raise InputError(
            f"light '{source.name}': its pixel {x:g},{y:g} is not on the panorama of {width} x {height} pixels"
        )
    if source.diameter is not None:
        return _disc(height, width, x, y, source.diameter)
    return plateau(radiance, int(x), int(y)).astype(np.float64)


def plateau(radiance: NDArray[np.float32], column: int, row: int) -> NDArray[np.bool_]:
    """Pixels as bright as one of them and joined to it, across the panorama's edge too; shape (height, 2 height)."""
    brightest = radiance.max(axis=2)
    turn = radiance.shape[1] // 2 - column
    same = np.roll(brightest >= SAME * brightest[row, column], turn, axis=1)
    labels, _ = ndimage.label(same, np.ones((3, 3)))
    return np.roll(labels == labels[row, radiance.shape[1] // 2], -turn, axis=1)


def _disc(height: int, width: int, x: float, y: float, diameter: float) -> NDArray[np.float64]:
    """Share of each pixel within a disc; in sum the disc's solid angle, also where it is smaller than a pixel."""
    middle = latlong_to_direction(x / width, y / height)
    radius = np.radians(0.5 * diameter)
    reach = int(np.ceil(radius / np.pi * height)) + 1
    first, last = max(0, int(y) - reach), min(height, int(y) + reach + 1)
    u = (np.arange(width * PARTS) + 0.5) / (width * PARTS)
    v = (np.arange(first * PARTS, last * PARTS) + 0.5) / (height * PARTS)
    inside = latlong_to_direction(u[None, :] + 0.0 * v[:, None], v[:, None] + 0.0 * u[None, :]) @ middle >= np.cos(
        radius
    )
    share = np.zeros((height, width))
    share[first:last] = inside.reshape(last - first, PARTS, width, PARTS).mean(axis=(1, 3))
    angle = float((share * pixel_solid_angles(height, width)[:, None]).sum())
    wanted = 4.0 * np.pi * np.sin(0.5 * radius) ** 2
    if angle <= 0.0:
        share[int(y), int(x)] = 1.0
        angle = float(pixel_solid_angles(height, width)[int(y)])
    return np.asarray(share * min(wanted / angle, 1.0))
