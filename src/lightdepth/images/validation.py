"""Is an image a usable panorama? What is wrong with it, where, and how it is repaired."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import latlong_to_direction, pixel_solid_angles
from lightdepth.errors import InputError
from lightdepth.parameters.checks import DEFAULT, ChecksParameters

SMALLEST_WIDTH = 8
NEGLIGIBLE_NEGATIVE = 0.01
"""Negative radiance is negligible down to minus this share of the panorama's mean radiance."""
NEGLIGIBLE_NEGATIVE_SUM = 1e-4
"""And all of it together up to this share of the panorama's light. Sharpening and colour conversion leave traces so."""
LARGEST_HALF = 65504.0


@dataclass(frozen=True)
class Defect:
    """Pixels with one kind of impossible radiance.

    Attributes:
        kind: ``NaN`` | ``infinite`` | ``negative``.
        count: number of pixels with it in any channel.
        share: that number as a share of all pixels.
        row: row of the first such pixel, 0 at the zenith.
        column: column of the first such pixel.
        direction: where that pixel looks, unit vector in light space.
        negligible: it is negative by so little that it means black; see ``NEGLIGIBLE_NEGATIVE``.
    """

    kind: str
    count: int
    share: float
    row: int
    column: int
    u: float
    v: float
    direction: tuple[float, float, float]
    negligible: bool = False

    def __str__(self) -> str:
        x, y, z = self.direction
        return (
            f"{self.count} {'pixel has' if self.count == 1 else 'pixels have'} {self.kind} radiance "
            f"({100 * self.share:.3g} % of all), the first at row {self.row}, column {self.column} "
            f"(u {self.u:.4f}, v {self.v:.4f}, direction {x:.3f} {y:.3f} {z:.3f})"
        )


def find_defects(radiance: NDArray[np.float32]) -> list[Defect]:
    """Find radiance that light cannot have.

    Args:
        radiance: linear RGB of a panorama, shape (height, width, 3), float32.

    Returns:
        At most one entry for each of NaN, infinite (of either sign) and negative; empty if all is well.
    """
    height, width = radiance.shape[:2]
    found = []
    for kind, wrong in (
        ("NaN", np.isnan(radiance)),
        ("infinite", np.isinf(radiance)),
        ("negative", (radiance < 0.0) & np.isfinite(radiance)),
    ):
        pixels = wrong.any(axis=2)
        count = int(np.count_nonzero(pixels))
        if count == 0:
            continue
        row, column = divmod(int(np.argmax(pixels)), width)
        u, v = (column + 0.5) / width, (row + 0.5) / height
        x, y, z = latlong_to_direction(u, v).tolist()
        negligible = kind == "negative" and _is_negligible(radiance, wrong)
        found.append(Defect(kind, count, count / (height * width), row, column, u, v, (x, y, z), negligible))
    return found


def _is_negligible(radiance: NDArray[np.float32], negative: NDArray[np.bool_]) -> bool:
    light = float(np.sum(radiance, where=np.isfinite(radiance) & ~negative, dtype=np.float64))
    below = radiance[negative]
    return bool(
        below.min() >= -NEGLIGIBLE_NEGATIVE * light / radiance.size
        and -below.sum(dtype=np.float64) <= NEGLIGIBLE_NEGATIVE_SUM * light
    )


def validate_panorama(radiance: NDArray[np.float32], path: Path, repair: bool = False) -> NDArray[np.float32]:
    """Make sure that an image can be a panorama: its shape, and radiance that light can have.

    Negative radiance that is negligible (what sharpening or a conversion of colours leaves) becomes 0 without a word.

    Args:
        radiance: linear RGB, shape (height, width, 3), float32.
        path: the file it came from, for messages.
        repair: replace impossible radiance instead of refusing it: NaN by the median of its neighbours, infinite by the
            channel's largest finite value, negative by 0. :func:`find_defects` reports them without changing anything.

    Returns:
        Radiance that is finite and not negative, shape (height, 2 height, 3), float32: the array given, where nothing
        had to be replaced, else a copy.

    Raises:
        InputError: it is not twice as wide as high, too small, or has impossible radiance that was not to be repaired.
    """
    if radiance.ndim != 3 or radiance.shape[2] != 3:
        raise InputError(f"{path}: an RGB image of shape (height, width, 3) is needed, got {radiance.shape}")
    height, width = radiance.shape[:2]
    if width != 2 * height:
        raise InputError(
            f"{path}: is {width} x {height} pixels; a panorama must be twice as wide as high (360 x 180 degrees), "
            f"such as {2 * height} x {height}{_other_projection(width, height)}"
        )
    if width < SMALLEST_WIDTH:
        raise InputError(
            f"{path}: is {width} x {height} pixels; a panorama must be at least {SMALLEST_WIDTH} pixels wide"
        )
    defects = find_defects(radiance)
    severe = [defect for defect in defects if not defect.negligible]
    if severe and not repair:
        raise InputError(f"{path}: {'; '.join(map(str, severe))}. `--repair` replaces them")
    return _repaired(radiance) if defects else radiance


def _other_projection(width: int, height: int) -> str:
    """What else a picture of this shape may be, for a message."""
    if width == height:
        return ". A square picture may be a light probe, a fisheye or a stereo pair, one above the other"
    if any(width * rows == height * columns for columns, rows in ((4, 3), (3, 4), (6, 1), (1, 6), (3, 2))):
        return ". A picture of this shape may be a cube map; convert it first"
    return ""


def _repaired(radiance: NDArray[np.float32]) -> NDArray[np.float32]:
    """A copy with every impossible value replaced."""
    repaired = radiance.copy()
    for channel in range(3):
        values = repaired[:, :, channel]
        infinite = np.isinf(values)
        finite = np.isfinite(values)
        values[values < 0.0] = 0.0
        values[infinite] = values[finite].max() if finite.any() else 0.0
        nowhere = np.argwhere(np.isnan(values))
        values[tuple(nowhere.T)] = [_median_around(radiance[:, :, channel], row, column) for row, column in nowhere]
    return repaired


def _median_around(values: NDArray[np.float32], row: int, column: int) -> float:
    """Median of the possible values in the 5 x 5 pixels around one; columns go round; 0 where there is none."""
    height, width = values.shape
    rows = np.arange(max(row - 2, 0), min(row + 3, height))
    around = values[rows[:, None], np.arange(column - 2, column + 3) % width]
    possible = around[np.isfinite(around) & (around >= 0.0)]
    return float(np.median(possible)) if possible.size else 0.0


@dataclass(frozen=True)
class Plateau:
    """The brightest pixels, where there are suspiciously many of equal value.

    Attributes:
        value: the largest radiance of any channel.
        count: number of pixels whose brightest channel is about that.
        share: their share of the sphere's solid angle.
    """

    value: float
    count: int
    share: float


def clipped_plateau(radiance: NDArray[np.float32], tuned: ChecksParameters = DEFAULT) -> Plateau | None:
    """Recognise a panorama whose bright lights were clipped: they all have the same value.

    A sun disk or a small lamp may be flat by itself; so a plateau counts from some pixels and several sun disks on, or
    if its value is the largest that a half float can hold. What was scaled down after clipping has no plateau any more
    and is not recognised.

    Args:
        radiance: linear RGB of a panorama, shape (height, 2 height, 3), float32, finite and not negative.
        tuned: from how many pixels on, and how large.

    Returns:
        The plateau, or ``None``.
    """
    height, width = radiance.shape[:2]
    brightest = radiance.max(axis=2)
    value = float(brightest.max())
    per_row = np.count_nonzero(brightest >= tuned.plateau_level * value, axis=1)
    count = int(per_row.sum())
    share = float(per_row @ pixel_solid_angles(height, width)) / (4.0 * np.pi)
    large = count >= tuned.plateau_pixels and share >= tuned.plateau_share
    if value > 0.0 and (large or (count >= 2 and value == LARGEST_HALF)):
        return Plateau(value, count, share)
    return None
