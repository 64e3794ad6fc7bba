"""Closed surfaces of a place from a point cloud."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage
from scipy.spatial import KDTree

from lightdepth.errors import InputError
from lightdepth.parameters.reconstruction import DEFAULT, ReconstructionParameters
from lightdepth.reconstruction.cleaning import smoothed, thinned, without_outliers
from lightdepth.reconstruction.floor import Plane, find_floor, part_of
from lightdepth.reconstruction.from_depth import Measured, split_roles
from lightdepth.reconstruction.point_cloud import PointCloud
from lightdepth.reconstruction.poisson import poisson_surface
from lightdepth.reconstruction.pose import Pose
from lightdepth.reconstruction.unmeasured import continued_planes

FloatArray = NDArray[np.float64]


def surfaces_from_points(
    cloud: PointCloud,
    pose: Pose,
    cell: float = 0.04,
    most_faces: int = 300_000,
    floor_tolerance: float | None = 0.03,
    *,
    keep_open: bool = False,
    progress: Callable[[str, float], None] = lambda step, share: None,
    tuned: ReconstructionParameters = DEFAULT,
) -> Measured:
    """Make a closed surface of a scanned place.

    Args:
        cloud: world, metres.
        pose: of the panorama; surfaces face the capture point where the cloud does not say what they face.
        cell: size of the finest details, metres.
        most_faces: of the surface.
        floor_tolerance: largest distance of a floor point from the floor's plane, metres; ``None`` looks for no floor.
        keep_open: leave out the parts of the surface that no point lies near, as toward the sky.
        progress: called with the step's name and the share of it that is done.
        tuned: how points are cleaned and continued, and how the floor is found.

    Returns:
        ``floor`` (support) and ``place`` (environment); together they are closed, but for ``keep_open``.

    Raises:
        InputError: the points lie elsewhere than the capture point, too few are left after cleaning, or there is no floor.
        SetupError: PyMeshLab is missing.
        LightdepthError: the surface could not be reconstructed.
    """
    _check_place(cloud, pose)
    progress("Cleaning points", 0.0)
    cloud = without_outliers(thinned(cloud, cell / tuned.points.per_cell), tuned.points)
    if len(cloud.points) < 100:
        raise InputError(
            f"{len(cloud.points)} points are left after the outliers were removed, at a detail of {cell:g} m; at least "
            "100 are needed: give a larger --detail, or check --scale"
        )
    points, normals = smoothed(cloud, pose.position, lambda share: progress("Cleaning points", share), tuned.points)
    if floor_tolerance is not None:
        floor = find_floor(points, pose.position, floor_tolerance, tuned.floor)
        added = _floor_under_the_scanner(points, floor, floor_tolerance, cell)
        points = np.concatenate([points, added])
        normals = np.concatenate([normals, np.broadcast_to(floor.normal, added.shape)])
    if not keep_open:
        continued, facing = continued_planes(points, normals, pose.position, cell, tuned.points)
        points, normals = np.concatenate([points, continued]), np.concatenate([normals, facing])
    progress("Reconstructing the surface", 0.0)
    mesh = poisson_surface(points, normals, cell, most_faces, tuned.points)
    if keep_open:
        near = KDTree(points).query(mesh.vertices)[0] < tuned.points.open_cells * cell
        mesh = part_of(mesh, near[mesh.faces].all(axis=1))
    progress("Reconstructing the surface", 1.0)
    found, surfaces = split_roles(mesh, pose, floor_tolerance, tuned=tuned)
    return Measured(surfaces, found)


def _check_place(cloud: PointCloud, pose: Pose) -> None:
    """Refuse points that lie farther from the capture point than they reach, as in a surveyor's coordinates."""
    low, high = np.percentile(cloud.points, [1.0, 99.0], axis=0)
    away = float(np.linalg.norm(np.maximum(np.maximum(low - pose.position, pose.position - high), 0.0)))
    if away > np.linalg.norm(high - low):
        middle = ",".join(f"{value:.1f}" for value in (low + high) / 2.0)
        raise InputError(
            f"the points lie around {middle}, {away:.4g} m from the capture point, which is farther than they reach; bring "
            "them to the world of the pose by --origin, --scale and --up"
        )


def _floor_under_the_scanner(points: FloatArray, floor: Plane, tolerance: float, cell: float) -> FloatArray:
    """Points on the floor where it was not measured though it was all around, as below a tripod; shape (n, 3)."""
    on_floor = points[np.abs(floor.heights(points)) < tolerance]
    low = on_floor[:, :2].min(axis=0)
    spacing = 2.0 * cell
    cells = np.floor((on_floor[:, :2] - low) / spacing).astype(int)
    measured = np.zeros(cells.max(axis=0) + 1, dtype=bool)
    measured[tuple(cells.T)] = True
    inside = ndimage.binary_fill_holes(ndimage.binary_closing(np.pad(measured, 2), iterations=2))[2:-2, 2:-2]
    steps = np.arange(0.25, 1.0, 0.5)
    gaps = np.argwhere(inside & ~measured)[:, None, None] + np.stack(np.meshgrid(steps, steps), axis=-1)
    x, y = (low + spacing * gaps.reshape(-1, 2)).T
    return np.column_stack([x, y, (floor.offset - floor.normal[0] * x - floor.normal[1] * y) / floor.normal[2]])
