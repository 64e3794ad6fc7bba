"""Directions of light space, pixels of an equirectangular panorama, and rotations: the conventions of every folder.

Light space and world are right-handed with z up, in metres. A panorama is twice as wide as high; row 0 is the zenith;
pixel centres lie at ``(i + 0.5) / n``; the centre column looks along +y and columns grow toward +x:

    w = (sin(theta) sin(phi), sin(theta) cos(phi), cos(theta)),  theta = pi v,  phi = 2 pi (u - 0.5)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lightdepth.errors import InputError

FloatArray = NDArray[np.float64]


def latlong_to_direction(u: ArrayLike, v: ArrayLike) -> FloatArray:
    """Directions seen at panorama coordinates.

    Args:
        u: horizontal coordinate in [0, 1], 0 at the left edge, any shape.
        v: vertical coordinate in [0, 1], 0 at the zenith, the same shape.

    Returns:
        Unit vectors in light space, shape (..., 3), float64.
    """
    theta = np.pi * np.asarray(v, dtype=np.float64)
    phi = 2.0 * np.pi * (np.asarray(u, dtype=np.float64) - 0.5)
    return np.stack([np.sin(theta) * np.sin(phi), np.sin(theta) * np.cos(phi), np.cos(theta)], axis=-1)


def direction_to_latlong(direction: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Panorama coordinates of directions: the inverse of :func:`latlong_to_direction`.

    Args:
        direction: vectors in light space, shape (..., 3); they need not be normalised, but must not be zero.

    Returns:
        ``(u, v)``, each of shape (...), float64, u in [0, 1), v in [0, 1].
    """
    x, y, z = np.moveaxis(np.asarray(direction, dtype=np.float64), -1, 0)
    u = np.arctan2(x, y) / (2.0 * np.pi) + 0.5
    v = np.arctan2(np.hypot(x, y), z) / np.pi
    return np.where(u >= 1.0, 0.0, u), v


def pixel_directions(height: int, width: int) -> FloatArray:
    """Unit vectors in light space through all pixel centres of a panorama, shape (height, width, 3), float64."""
    u = (np.arange(width) + 0.5) / width
    v = (np.arange(height) + 0.5) / height
    return latlong_to_direction(*np.broadcast_arrays(u[None, :], v[:, None]))


def pixel_solid_angles(height: int, width: int) -> FloatArray:
    """Exact solid angle of the pixels of each row in steradian, shape (height,), float64; the whole sums to 4 pi."""
    edges = np.cos(np.pi * np.arange(height + 1) / height)
    return (edges[:-1] - edges[1:]) * (2.0 * np.pi / width)


def euler_rotation(degrees: ArrayLike) -> FloatArray:
    """Rotation matrix of XYZ Euler angles in degrees, as Blender means them: first about x, then y, then z.

    Args:
        degrees: three angles, shape (3,).

    Returns:
        Matrix ``R`` of shape (3, 3), float64; ``R @ v`` turns a column vector.
    """
    (cx, cy, cz), (sx, sy, sz) = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return about_z @ about_y @ about_x


def rotation_to_euler(rotation: ArrayLike) -> FloatArray:
    """XYZ Euler angles in degrees of a rotation matrix of shape (3, 3): the inverse of :func:`euler_rotation`."""
    r = np.asarray(rotation, dtype=np.float64)
    y = np.arctan2(-r[2, 0], np.hypot(r[0, 0], r[1, 0]))
    if np.hypot(r[0, 0], r[1, 0]) > 1e-9:
        x, z = np.arctan2(r[2, 1], r[2, 2]), np.arctan2(r[1, 0], r[0, 0])
    else:  # Looking straight along z: only the sum of x and z is determined.
        x, z = np.arctan2(-r[1, 2], r[1, 1]), 0.0
    return np.degrees([x, y, z])


def look_at_rotation(position: ArrayLike, target: ArrayLike) -> FloatArray:
    """Rotation that turns +y toward ``target`` and keeps z as upright as it can be.

    Args:
        position: where one stands, world, metres, shape (3,).
        target: the point to look at, world, metres, shape (3,).

    Returns:
        Matrix of shape (3, 3), float64, whose columns are right, forward and up.

    Raises:
        InputError: the two points coincide.
    """
    forward = np.asarray(target, dtype=np.float64) - np.asarray(position, dtype=np.float64)
    length = np.linalg.norm(forward)
    if length < 1e-12:
        raise InputError(f"look_at: the target {np.asarray(target).tolist()} is the position itself")
    forward /= length
    up = np.array([0.0, 0.0, 1.0]) if abs(forward[2]) < 0.999999 else np.array([0.0, -np.sign(forward[2]), 0.0])
    right = np.cross(forward, up)
    right /= np.linalg.norm(right)
    return np.stack([right, forward, np.cross(right, forward)], axis=1)
