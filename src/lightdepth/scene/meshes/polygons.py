"""Polygons to triangles: convex ones by fans, all others by ear clipping."""

from __future__ import annotations

from dataclasses import dataclass

import mapbox_earcut
import numpy as np
from numpy.typing import NDArray

_LARGEST_TRIED = 8
"""Corners that are tried as the origin of a fan."""


@dataclass(frozen=True)
class Triangulation:
    """Triangles of many polygons.

    Attributes:
        corners: shape (m, 3), int64: which of all corners each triangle joins.
        polygon: which polygon each triangle belongs to, shape (m,), int64, ascending.
        crossing: polygons whose outline crosses itself, or that could not be filled as their outline says.
    """

    corners: NDArray[np.int64]
    polygon: NDArray[np.int64]
    crossing: NDArray[np.int64]


def triangulated(points: NDArray[np.float64], sizes: NDArray[np.int64]) -> Triangulation:
    """Triangles that fill polygons, concave ones and ones with a slit to a hole included, facing as these do.

    Args:
        points: the polygons' corners one after the other, shape (n, 3).
        sizes: how many corners each has, shape (k,), each 3 or more, n in sum.
    """
    starts = np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64) if len(sizes) else np.zeros(0, np.int64)
    corners: list[NDArray[np.int64]] = [np.zeros((0, 3), np.int64)]
    owners: list[NDArray[np.int64]] = [np.zeros(0, np.int64)]
    crossing: list[int] = []
    for size in np.unique(sizes):
        which = np.flatnonzero(sizes == size)
        index = starts[which, None] + np.arange(size)
        if size == 3:
            corners.append(index)
            owners.append(which)
            continue
        if size == 4:
            origin, sound = _quad_origins(points, index)
            good = np.ones(len(which), np.bool_)  # Two triangles are all that there can be.
            crossing += which[~sound].tolist()
        else:
            origin, good = _fan_origins(points, index)
        turned = np.take_along_axis(index, (origin[:, None] + np.arange(size)) % size, axis=1)[good]
        fans = np.stack([np.broadcast_to(turned[:, :1], turned[:, 2:].shape), turned[:, 1:-1], turned[:, 2:]], axis=2)
        corners.append(fans.reshape(-1, 3))
        owners.append(np.repeat(which[good], size - 2))
        for polygon in np.flatnonzero(~good):
            triangles, whole = _clipped(points[index[polygon]])
            corners.append(index[polygon][triangles])
            owners.append(np.full(len(triangles), which[polygon]))
            if not whole:
                crossing.append(int(which[polygon]))
    owner = np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return Triangulation(np.concatenate(corners)[order], owner[order], np.array(sorted(crossing), np.int64))


def _fan_origins(points: NDArray[np.float64], index: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """A corner of each of some equally large polygons from which a fan fills it, and whether there is one.

    It is a fan where none of its triangles is turned over: the polygon is then star-shaped around that corner. Best is
    one without flat triangles, so that a corner on a straight edge stays a corner.
    """
    origin = np.zeros(len(index), np.int64)
    good = np.zeros(len(index), np.bool_)
    size = index.shape[1]
    normal = _newell(points, index)
    squares = np.einsum("ni,ni->n", normal, normal)[:, None]
    for least in (1e-9, 0.0):
        for first in range(min(size, _LARGEST_TRIED)):
            areas = _fan_areas(points, np.roll(index, -first, axis=1), normal)
            fits = ~good & (areas >= least * squares).all(axis=1)
            origin[fits] = first
            good |= fits
            if good.all():
                return origin, good
    return origin, good


def _quad_origins(points: NDArray[np.float64], index: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """From which corner the better of the two diagonals of quads runs, and whether no triangle is then turned over."""
    normal = _newell(points, index)
    least = np.stack([_fan_areas(points, np.roll(index, -first, axis=1), normal).min(axis=1) for first in (0, 1)])
    # The first diagonal unless it runs outside, or along an edge.
    origin = (least[0] < 1e-9 * np.einsum("ni,ni->n", normal, normal)) & (least[1] > least[0])
    return origin.astype(np.int64), np.where(origin, least[1], least[0]) >= 0.0


def _fan_areas(
    points: NDArray[np.float64], fans: NDArray[np.int64], normal: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Areas of the triangles of fans from the first corner of polygons, against a normal of each, shape (k, n - 2)."""
    spokes = points[fans[:, 1:]] - points[fans[:, :1]]
    areas: NDArray[np.float64] = np.einsum("nij,nj->ni", np.cross(spokes[:, :-1], spokes[:, 1:]), normal)
    return areas


def _newell(points: NDArray[np.float64], index: NDArray[np.int64]) -> NDArray[np.float64]:
    """Twice the vector areas of polygons, shape (k, 3)."""
    relative = points[index] - points[index[:, :1]]
    area: NDArray[np.float64] = np.cross(relative, np.roll(relative, -1, axis=1)).sum(axis=1)
    return area


def _clipped(points: NDArray[np.float64]) -> tuple[NDArray[np.int64], bool]:
    """Triangles of one polygon, shape (m, 3), and whether they fill its area."""
    every = np.arange(len(points))[None]
    normal = _newell(points, every)[0]
    length = float(np.linalg.norm(normal))
    if not np.isfinite(length) or length == 0.0:
        return np.stack([np.zeros(len(points) - 2, np.int64), every[0, 1:-1], every[0, 2:]], axis=1), length == 0.0
    normal /= length
    across = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal))])
    across /= np.linalg.norm(across)
    flat = (points - points[0]) @ np.stack([across, np.cross(normal, across)], axis=1)
    found = mapbox_earcut.triangulate_float64(flat, np.array([len(flat)], np.uint32))
    triangles = found.astype(np.int64).reshape(-1, 3)
    a, b, c = (flat[triangles[:, corner]] for corner in range(3))
    twice = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    triangles[twice < 0.0] = triangles[twice < 0.0, ::-1]
    return triangles, bool(abs(np.abs(twice).sum() - length) <= 1e-6 * length)
