"""The light-depth map, and its file: one OpenEXR with radiance, distance and the capture pose."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.images.chromaticities import converted, primaries_of, to_rec709
from lightdepth.images.exr import ExrPart, read_exr, write_exr
from lightdepth.images.validation import validate_panorama

POSE = "worldToCamera"
"""Standard OpenEXR attribute. The matrix multiplies row vectors, ``(p, 1) M``, and leads from world to the standard's
camera space: x right, y up, z forward. As that is left-handed and the world right-handed, its determinant is -1."""
_CAMERA_AXES = [0, 2, 1]
"""Axes of light space (x right, y forward, z up) in the order of the standard's camera space."""


@dataclass(frozen=True)
class LightDepthMap:
    """A panorama of which every pixel is a point: ``p_world = position + rotation @ (depth * direction)``.

    Attributes:
        radiance: linear Rec.709, shape (height, 2 height, 3), float32.
        depth: distance along the ray, shape (height, 2 height), float32, metres; inf is sky.
        position: capture point, shape (3,), float64, world, metres.
        rotation: light space to world, shape (3, 3), float64.
    """

    radiance: NDArray[np.float32]
    depth: NDArray[np.float32]
    position: NDArray[np.float64]
    rotation: NDArray[np.float64]


def write_light_depth_map(path: Path, light_depth_map: LightDepthMap) -> None:
    """Write a light-depth map: channels ``R G B Z`` (float32), ``envmap = latlong``, pose as ``worldToCamera``.

    Raises:
        InputError: the file cannot be written.
    """
    pose = np.eye(4, dtype=np.float32)
    axes = light_depth_map.rotation[:, _CAMERA_AXES]
    pose[:3, :3], pose[3, :3] = axes, -light_depth_map.position @ axes
    channels = {"RGB": light_depth_map.radiance, "Z": light_depth_map.depth}
    write_exr(path, [ExrPart(channels, "", {"envmap": "latlong", POSE: pose})])


def read_light_depth_map(path: Path) -> LightDepthMap:
    """Read and check a light-depth map.

    Raises:
        InputError: the file is missing or unreadable; a channel or the pose is missing; the radiance is not that of a
            panorama; a distance is not positive; the pose is not a rotation and a translation.
    """
    part = read_exr(path, interleaved=True)[0]
    radiance = next((part.channels[name] for name in ("RGB", "RGBA") if name in part.channels), None)
    if radiance is None or "Z" not in part.channels:
        found = ", ".join(sorted(part.channels))
        raise InputError(f"{path}: a light-depth map has the channels R, G, B and Z; found {found}")
    if part.header.get("envmap", "latlong") != "latlong":
        raise InputError(f"{path}: envmap in its header must be latlong (equirectangular)")
    if POSE not in part.header:
        raise InputError(f"{path}: the capture pose is missing; its header must have {POSE}, a 4 x 4 matrix")
    linear = np.ascontiguousarray(radiance[:, :, :3], dtype=np.float32)
    matrix = to_rec709(primaries_of(part.header, path), path)
    valid = validate_panorama(converted(linear, matrix), path)
    depth = part.channels["Z"].astype(np.float32, copy=False)
    _check_depth(depth, path)
    return LightDepthMap(valid, depth, *_pose(np.asarray(part.header[POSE], dtype=np.float64), path))


def _check_depth(depth: NDArray[np.float32], path: Path) -> None:
    wrong = ~(depth > 0.0)
    if wrong.any():
        row, column = divmod(int(np.argmax(wrong)), depth.shape[1])
        raise InputError(
            f"{path}: {np.count_nonzero(wrong)} of {depth.size} distances in channel Z are not positive, the first at "
            f"row {row}, column {column} ({depth[row, column]}); allowed are metres above 0, and inf for sky"
        )


def _pose(matrix: NDArray[np.float64], path: Path) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Capture point and rotation (light space to world) of a ``worldToCamera`` matrix."""
    rotation = matrix[:3, _CAMERA_AXES]
    rigid = (
        np.isfinite(matrix).all()
        and np.allclose(matrix[:, 3], [0, 0, 0, 1], atol=1e-6)
        and np.allclose(rotation.T @ rotation, np.eye(3), atol=1e-4)
    )
    if not rigid:
        raise InputError(f"{path}: {POSE} in its header is not a rotation and a translation: {matrix.tolist()}")
    if np.linalg.det(rotation) < 0.0:
        raise InputError(
            f"{path}: {POSE} in its header leads to a right-handed camera space; OpenEXR's is left-handed (x right, y up, "
            "z forward). Earlier versions of lightdepth wrote the other one: write the map again with `lightdepth lightmap`"
        )
    u, _, v = np.linalg.svd(rotation)  # The nearest exact rotation: the file holds single precision.
    rotation = u @ v
    return -rotation @ matrix[3, _CAMERA_AXES], rotation
