"""Point clouds made even, without outliers and without scanner noise, and given normals."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from lightdepth.parameters.reconstruction import DEFAULT, PointParameters
from lightdepth.reconstruction.point_cloud import PointCloud

FloatArray = NDArray[np.float64]

CHUNK = 50_000


def thinned(cloud: PointCloud, cell: float) -> PointCloud:
    """One point, the mean, for each cube of ``cell`` metres that holds any: even density, and less noise."""
    cells = np.floor((cloud.points - cloud.points.min(axis=0)) / cell).astype(np.int64)
    extent = cells.max(axis=0) + 1
    keys = (cells[:, 0] * extent[1] + cells[:, 1]) * extent[2] + cells[:, 2]
    _, group, counts = np.unique(keys, return_inverse=True, return_counts=True)

    def mean(vectors: FloatArray) -> FloatArray:
        sums = [np.bincount(group, weights=vectors[:, axis], minlength=len(counts)) for axis in range(3)]
        return np.stack(sums, axis=-1) / counts[:, None]

    return PointCloud(mean(cloud.points), None if cloud.toward_air is None else mean(cloud.toward_air))


def without_outliers(cloud: PointCloud, tuned: PointParameters = DEFAULT.points) -> PointCloud:
    """Drop points that are much farther from their neighbours than these are from theirs, stray ones and small clumps.

    The comparison is local (after Breunig and others, LOF: Identifying Density-Based Local Outliers, 2000), for a
    scan is dense near the scanner and sparse far from it.

    Args:
        cloud: of even density.
        tuned: what an outlier is.
    """
    count = len(cloud.points)
    distances, neighbours = KDTree(cloud.points).query(cloud.points, k=tuned.outlier_neighbours + 1)
    distances, neighbours = distances[:, 1:], neighbours[:, 1:]
    reach = distances.mean(axis=1)
    usual = np.median(reach[neighbours], axis=1)
    near = distances <= tuned.outlier_factor * np.minimum(usual[:, None], usual[neighbours])
    starts = np.repeat(np.arange(count), tuned.outlier_neighbours)[near.ravel()]
    joined = coo_array((np.ones(len(starts)), (starts, neighbours.ravel()[near.ravel()])), shape=(count, count))
    clump = connected_components(joined, directed=False)[1]
    large = np.bincount(clump)[clump] >= tuned.smallest_clump
    stray = reach > tuned.stray_factor * np.median(reach)  # Among its like, a stray point is unremarkable.
    return cloud.chosen((reach <= tuned.outlier_factor * usual) & large & ~stray)


def smoothed(
    cloud: PointCloud,
    capture_point: FloatArray,
    progress: Callable[[float], None] = lambda share: None,
    tuned: PointParameters = DEFAULT.points,
) -> tuple[FloatArray, FloatArray]:
    """Project every point onto the plane through its neighbours: scanner noise goes, edges stay within a few points.

    The plane is fitted twice, the second time with less weight on neighbours off the first (Tukey's biweight), so that
    the plane at an edge is that of the point's own side.

    Args:
        cloud: even and without outliers.
        capture_point: what the surfaces face where the cloud has no normals, world, metres, shape (3,).
        progress: called with the share that is done.
        tuned: how many neighbours count.

    Returns:
        The points, and unit normals into the open, each of shape (n, 3), float64.
    """
    points = cloud.points
    tree = KDTree(points)
    smooth, normals = np.empty_like(points), np.empty_like(points)
    for start in range(0, len(points), CHUNK):
        here = slice(start, start + CHUNK)
        distances, indices = tree.query(points[here], k=min(tuned.smoothing_neighbours, len(points)))
        around = points[indices]
        nearness = np.exp(-2.0 * (distances / distances[:, -1:]) ** 2)
        weights = nearness
        for _ in range(2):
            total = weights.sum(axis=1)
            centre = np.einsum("nk,nki->ni", weights, around) / total[:, None]
            offsets = around - centre[:, None]
            spread = np.einsum("nk,nki,nkj->nij", weights, offsets, offsets)
            normal = np.linalg.eigh(spread)[1][:, :, 0]
            residuals = np.einsum("nki,ni->nk", offsets, normal)
            scale = 4.685 * 1.4826 * np.median(np.abs(residuals), axis=1, keepdims=True) + 1e-9
            weights = nearness * np.clip(1.0 - (residuals / scale) ** 2, 0.0, None) ** 2 + 1e-12
        smooth[here] = points[here] - np.einsum("ni,ni->n", points[here] - centre, normal)[:, None] * normal
        normals[here] = normal
        progress(min(1.0, (start + CHUNK) / len(points)))
    facing = capture_point - points if cloud.toward_air is None else cloud.toward_air
    normals *= np.where(np.einsum("ni,ni->n", normals, facing) < 0.0, -1.0, 1.0)[:, None]
    return smooth, normals
