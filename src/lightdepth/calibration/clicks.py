"""Clicks on a panorama, as a person writes them, to directions of light space."""

from __future__ import annotations

import re

import numpy as np
from numpy.typing import ArrayLike

from lightdepth.directions import FloatArray, latlong_to_direction
from lightdepth.errors import InputError


def parse_points(text: str, count: int, option: str) -> FloatArray:
    """Read points written as ``"x,y x,y ..."``.

    Args:
        text: the numbers; spaces or semicolons part the points, a comma parts the two numbers of a point.
        count: how many points there must be.
        option: the command-line option that the text belongs to, for messages.

    Returns:
        The points, shape (count, 2), float64.

    Raises:
        InputError: another number of points, or something that is not two finite numbers.
    """
    words = re.split(r"[\s;]+", re.sub(r"\s*,\s*", ",", text.strip()))
    points = []
    for word in words:
        try:
            x, y = (float(number) for number in word.split(","))
        except ValueError:
            raise InputError(
                f"{option} {text!r}: '{word}' is not a point; write each one as x,y with spaces between them"
            ) from None
        points.append((x, y))
    if len(points) != count:
        raise InputError(f"{option} {text!r}: {len(points)} points, {count} are needed")
    array = np.array(points)
    if not np.isfinite(array).all():
        raise InputError(f"{option} {text!r}: a coordinate is not a finite number")
    return array


def pixels_to_directions(pixels: ArrayLike, width: int, height: int, option: str) -> FloatArray:
    """Directions seen at positions of a panorama picture.

    Args:
        pixels: x to the right and y down, shape (..., 2); 0,0 is the picture's upper left corner, so that the first
            pixel's centre is at 0.5,0.5. An x beyond the left or right edge continues on the other side.
        width: the picture's width in pixels.
        height: the picture's height in pixels.
        option: the command-line option that the pixels belong to, for messages.

    Returns:
        Unit vectors in light space, shape (..., 3), float64.

    Raises:
        InputError: a y is outside the picture, or an x more than a width away from it.
    """
    x, y = np.moveaxis(np.asarray(pixels, dtype=np.float64), -1, 0)
    outside = (y < 0) | (y > height) | (x < -width) | (x > 2 * width)
    if outside.any():
        at = int(np.argmax(outside))
        raise InputError(
            f"{option}: the point {x.flat[at]:g},{y.flat[at]:g} is outside the panorama of {width} x {height} pixels"
        )
    return latlong_to_direction(x / width, y / height)


def angles_to_directions(angles: ArrayLike, option: str) -> FloatArray:
    """Directions at horizontal and vertical angles.

    Args:
        angles: degrees, shape (..., 2): to the right of the panorama's centre column in [-360, 360], and above its
            middle row in [-90, 90].
        option: the command-line option that the angles belong to, for messages.

    Returns:
        Unit vectors in light space, shape (..., 3), float64.

    Raises:
        InputError: an angle is out of its range.
    """
    right, up = np.moveaxis(np.asarray(angles, dtype=np.float64), -1, 0)
    outside = (np.abs(up) > 90) | (np.abs(right) > 360)
    if outside.any():
        at = int(np.argmax(outside))
        raise InputError(
            f"{option}: the angles {right.flat[at]:g},{up.flat[at]:g} are out of range; allowed are -360 to 360 "
            "degrees to the right and -90 to 90 degrees up"
        )
    return latlong_to_direction(right / 360.0 + 0.5, 0.5 - up / 180.0)
