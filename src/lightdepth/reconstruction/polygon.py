"""Simple polygons of the plane: floor plans and footprints."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]


def signed_area(corners: FloatArray) -> float:
    """Area of a polygon of shape (n, 2), positive where its corners go counter-clockwise."""
    x, y = corners.T
    return float(0.5 * np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def contains(corners: FloatArray, point: FloatArray) -> bool:
    """Whether a point of shape (2,) lies inside a polygon of shape (n, 2), by the even-odd rule."""
    start, end = corners, np.roll(corners, -1, axis=0)
    crosses = (start[:, 1] > point[1]) != (end[:, 1] > point[1])
    rise = np.where(crosses, end[:, 1] - start[:, 1], 1.0)
    x = start[:, 0] + (point[1] - start[:, 1]) * (end[:, 0] - start[:, 0]) / rise
    return bool(np.count_nonzero(crosses & (x > point[0])) % 2)


def crossing_sides(corners: FloatArray) -> tuple[int, int] | None:
    """The first two sides of a polygon of shape (n, 2) that cut each other, or ``None`` in a simple polygon."""
    n = len(corners)
    ends = np.roll(corners, -1, axis=0)
    for i in range(n):
        for j in range(i + 2, n - (i == 0)):
            sides = [
                _turn(corners[i], ends[i], corners[j]) * _turn(corners[i], ends[i], ends[j]),
                _turn(corners[j], ends[j], corners[i]) * _turn(corners[j], ends[j], ends[i]),
            ]
            if max(sides) < 0.0:
                return i, j
    return None


def triangulate(corners: FloatArray) -> NDArray[np.int32]:
    """Triangles of a simple, counter-clockwise polygon by clipping its ears, roundest first.

    Args:
        corners: shape (n, 2), n at least 3, counter-clockwise, without crossing sides.

    Returns:
        Indices of corners, shape (n - 2, 3), counter-clockwise.
    """
    left = list(range(len(corners)))
    triangles = []
    while len(left) > 3:
        ears = [
            (_sharpest_angle(corners[[a, b, c]]), i)
            for i, (a, b, c) in enumerate(zip(left[-1:] + left[:-1], left, left[1:] + left[:1], strict=True))
            if _is_ear(corners, left, a, b, c)
        ]
        # A simple polygon always has an ear; three corners on one line may hide it from arithmetic.
        _, at = max(ears) if ears else (0.0, int(np.argmin([_corner_area(corners, left, i) for i in range(len(left))])))
        triangles.append([left[at - 1], left[at], left[(at + 1) % len(left)]])
        del left[at]
    return np.array([*triangles, left], dtype=np.int32)


def _turn(a: FloatArray, b: FloatArray, c: FloatArray) -> float:
    """Twice the signed area of a triangle: positive where c lies left of the line from a to b."""
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))


def _corner_area(corners: FloatArray, left: list[int], i: int) -> float:
    return abs(_turn(corners[left[i - 1]], corners[left[i]], corners[left[(i + 1) % len(left)]]))


def _is_ear(corners: FloatArray, left: list[int], a: int, b: int, c: int) -> bool:
    """Whether the triangle of a corner and its neighbours lies inside and holds no other corner."""
    p, q, r = corners[a], corners[b], corners[c]
    if _turn(p, q, r) <= 0.0:
        return False
    others = (corners[i] for i in left if i not in (a, b, c))
    return not any(_turn(p, q, o) >= 0.0 and _turn(q, r, o) >= 0.0 and _turn(r, p, o) >= 0.0 for o in others)


def _sharpest_angle(triangle: FloatArray) -> float:
    """The smallest angle of a triangle of shape (3, 2), in radians."""
    sides = np.roll(triangle, -1, axis=0) - triangle
    lengths = np.linalg.norm(sides, axis=1)
    cosines = -np.sum(sides * np.roll(sides, 1, axis=0), axis=1) / (lengths * np.roll(lengths, 1))
    return float(np.min(np.arccos(np.clip(cosines, -1.0, 1.0))))
