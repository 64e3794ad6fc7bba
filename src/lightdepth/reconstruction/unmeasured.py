"""Where a scan saw nothing: its large planes go on, so that walls stay flat and meet in their corners."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import KDTree

from lightdepth.directions import euler_rotation, pixel_directions
from lightdepth.parameters.reconstruction import DEFAULT, PointParameters

FloatArray = NDArray[np.float64]


def continued_planes(
    points: FloatArray,
    normals: FloatArray,
    capture_point: FloatArray,
    cell: float,
    tuned: PointParameters = DEFAULT.points,
    seed: int = 0,
) -> tuple[FloatArray, FloatArray]:
    """Points on the continuation of the place's planes into the directions that were not measured.

    Around every unmeasured region planes are looked for (RANSAC). Those that one nowhere sees past are the place's walls,
    floor or ceiling: they go on, and the nearest of them is what is seen, at the farthest the box along the walls that
    holds all measured points. Where the rim of an unmeasured region is something else, as a piece of furniture's, no points
    are added: the surface is to bridge that by itself.

    Args:
        points: without outliers and noise, world, metres, shape (n, 3).
        normals: unit, into the open, shape (n, 3).
        capture_point: where unmeasured directions start, world, metres, shape (3,).
        cell: size of the finest details, metres.
        tuned: what was not measured, and which planes go on.
        seed: of the random trials.

    Returns:
        Added points and their normals, each of shape (m, 3), about a cell apart.
    """
    random = np.random.default_rng(seed)
    ways = points - capture_point
    ranges = np.linalg.norm(ways, axis=1)
    wanted = np.clip(np.pi * np.median(ranges) / cell, tuned.gap_fewest_rows, tuned.gap_most_rows)
    height = 2 * int(wanted / 2)
    directions = pixel_directions(height, 2 * height)
    angle, nearest = KDTree(ways / ranges[:, None]).query(directions.reshape(-1, 3))
    unmeasured = (angle * ranges[nearest] > tuned.gap_cells * cell).reshape(height, 2 * height)
    regions = _regions(unmeasured)
    box = _box(points, normals)
    added, facing = [np.empty((0, 3))], [np.empty((0, 3))]
    for region in range(1, regions.max() + 1):
        chosen = regions == region
        inside = directions[chosen]
        if len(inside) == 0:
            continue
        ring = _around(inside, ways / ranges[:, None], np.radians(tuned.ring))
        planes = _planes(points, normals, ring, cell, tuned, random)
        rim = points[nearest.reshape(unmeasured.shape)[chosen]]
        inside = inside[(np.abs(rim @ planes[:, :3].T - planes[:, 3]) < cell).any(axis=1)]
        walls = np.concatenate([planes, box])
        approach = -inside @ walls[:, :3].T
        clearance = walls[:, :3] @ capture_point - walls[:, 3]
        met = (approach > 1e-6) & (clearance > 0.0)
        distance = np.divide(clearance, approach, out=np.full(approach.shape, np.inf), where=met)
        first, reach = distance.argmin(axis=1), distance.min(axis=1)
        met_any = np.isfinite(reach)  # A capture point outside the box sees past it.
        added.append(capture_point + inside[met_any] * reach[met_any, None])
        facing.append(walls[first[met_any], :3])
    return np.concatenate(added), np.concatenate(facing)


def _around(inside: FloatArray, directions: FloatArray, across: float) -> NDArray[np.bool_]:
    """Which directions lie in the ring, so many radians across, around some, all unit vectors; shape (n,)."""
    middle = inside.mean(axis=0)
    middle /= max(float(np.linalg.norm(middle)), 1e-9)
    reach = np.arccos(np.clip((inside @ middle).min(), -1.0, 1.0)) + across
    near = np.arccos(np.clip(directions @ middle, -1.0, 1.0)) < reach  # The tree need not be asked for all.
    near[near] = KDTree(inside).query(directions[near], distance_upper_bound=across)[0] < np.inf
    return near


def _box(points: FloatArray, normals: FloatArray) -> FloatArray:
    """The box along the walls that holds all points: inward normals and offsets of its sides, shape (6, 4)."""
    fourfold = np.sum((normals[:, 0] + 1j * normals[:, 1]) ** 4)  # Alike for all four walls of a room.
    axes = euler_rotation([0.0, 0.0, np.degrees(np.angle(fourfold)) / 4.0]).T
    extents = points @ axes.T
    low = np.column_stack([axes, extents.min(axis=0)])
    return np.concatenate([low, np.column_stack([-axes, -extents.max(axis=0)])])


def _regions(mask: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Connected regions of a panorama from 1 on, joined across its left and right edge; 0 elsewhere."""
    labels, _ = ndimage.label(mask)
    for left, right in zip(labels[:, 0], labels[:, -1], strict=True):
        if left and right and left != right:
            labels[labels == right] = left
    return labels


def _planes(
    points: FloatArray,
    normals: FloatArray,
    ring: NDArray[np.bool_],
    cell: float,
    tuned: PointParameters,
    random: np.random.Generator,
) -> FloatArray:
    """Planes that many points of the ring lie on and hardly any behind: normals and offsets, shape (k, 4)."""
    planes = []
    left = ring.copy()
    needed = max(tuned.plane_share * ring.sum(), tuned.plane_fewest)
    while left.sum() > needed:
        trials = random.choice(np.flatnonzero(left), tuned.plane_trials)
        some = random.choice(np.flatnonzero(left), min(tuned.plane_judges, int(left.sum())), replace=False)
        counts = [
            _on(points[some], normals[some], normals[i], normals[i] @ points[i], cell, tuned).sum() for i in trials
        ]
        best = trials[int(np.argmax(counts))]
        normal, offset = normals[best], normals[best] @ points[best]
        for _ in range(4):
            own = _on(points, normals, normal, offset, cell, tuned)  # Also beyond the ring: the longer, the straighter.
            centre = points[own].mean(axis=0)
            fitted = np.linalg.eigh((points[own] - centre).T @ (points[own] - centre))[1][:, 0]
            normal = fitted * np.sign(fitted @ normal)
            offset = normal @ centre
        own = _on(points, normals, normal, offset, cell, tuned) & left
        if own.sum() < needed:
            break
        left &= ~own
        if np.mean(points[ring] @ normal - offset < -tuned.plane_behind * cell) < tuned.plane_beyond:
            planes.append([*normal, offset])
    return np.array(planes).reshape(-1, 4)


def _on(
    points: FloatArray, normals: FloatArray, normal: FloatArray, offset: float, cell: float, tuned: PointParameters
) -> NDArray[np.bool_]:
    """Which points lie on a plane and look its way."""
    near = np.abs(points @ normal - offset) < tuned.plane_thickness * cell
    return near & (normals @ normal > tuned.plane_normal)
