"""A room with a pillar whose surfaces send known radiance: photographs of it from anywhere, without noise."""

from __future__ import annotations

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray

from lightdepth.directions import euler_rotation, pixel_directions
from lightdepth.kernel.raycasting import RayCaster
from lightdepth.scene.model import Mesh, Panorama, RealSurface, Role

LOW, HIGH = np.array([-3.0, -2.0, 0.0]), np.array([3.0, 2.0, 2.5])
PILLAR = np.array([-0.3, -0.3, 0.0]), np.array([0.3, 0.3, 2.5])
LAMP = np.array([1.2, -0.8])
"""Middle of a lamp in the ceiling, which the pillar hides from half of the room."""
CAPTURES = np.array([[-1.8, 0.2, 1.4], [1.9, -0.3, 1.5]])


def _box(low: NDArray, high: NDArray, inward: bool) -> Mesh:
    box = trimesh.creation.box(bounds=[low, high])
    faces = np.asarray(box.faces[:, ::-1] if inward else box.faces, np.int32)
    return Mesh(np.asarray(box.vertices, np.float32), faces)


REAL = (
    RealSurface("room", _box(LOW, HIGH, True), Role.SUPPORT),
    RealSurface("pillar", _box(*PILLAR, False), Role.SUPPORT),
)


def radiance(points: NDArray, lamp: float = 30.0) -> NDArray[np.float64]:
    """What points of the room send, linear RGB, shape (n, 3)."""
    x, y, z = points.T
    wave = 0.5 + 0.2 * np.sin(1.3 * x + 0.4) * np.cos(1.1 * y) + 0.15 * np.cos(2.0 * z)
    colour = np.stack([wave, 0.8 * wave + 0.05 * np.sin(x + z), 0.6 * wave + 0.05 * np.cos(y)], axis=1)
    far = np.linalg.norm(points[:, :2] - LAMP, axis=1)
    shines = (z > HIGH[2] - 1e-3) * np.clip(6.0 * (0.45 - far), 0.0, 1.0)
    return colour + lamp * shines[:, None] * np.array([1.0, 0.9, 0.7])


def photograph(
    position: ArrayLike, height: int = 128, turn: ArrayLike = (0.0, 0.0, 0.0), lamp: float = 30.0, **panorama: object
) -> Panorama:
    """The room from a capture point; what the pixels' centres see."""
    rotation = euler_rotation(turn)
    at = np.asarray(position, np.float64)
    world = pixel_directions(height, 2 * height).reshape(-1, 3) @ rotation.T
    distance = RayCaster([surface.mesh for surface in REAL]).cast(at, world).distance
    seen = radiance(at + distance[:, None] * world, lamp).reshape(height, 2 * height, 3)
    return Panorama(seen.astype(np.float32), at, rotation, **panorama)
