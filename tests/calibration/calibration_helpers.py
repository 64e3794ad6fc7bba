"""Random poses, and what is seen from them."""

import numpy as np
from scipy.spatial.transform import Rotation

from lightdepth.directions import direction_to_latlong, euler_rotation, latlong_to_direction


class Poses:
    """Random numbers, and what a calibration test draws with them."""

    def __init__(self, seed: int):
        self.random = np.random.default_rng(seed)

    def rotation(self, tilt: float = 40.0) -> np.ndarray:
        """Any heading, and a tilt up to some degrees."""
        toward = self.random.uniform(0, 2 * np.pi)
        axis = np.array([np.cos(toward), np.sin(toward), 0.0])
        lean = Rotation.from_rotvec(np.radians(self.random.uniform(0, tilt)) * axis).as_matrix()
        return lean @ euler_rotation([0, 0, self.random.uniform(-180, 180)])

    def room_floor(self) -> tuple[np.ndarray, np.ndarray]:
        """Corners of the floor of a room, shape (4, 3), first at the origin, and a camera somewhere inside."""
        width, length = self.random.uniform(3, 7, 2)
        x, y = self.random.uniform(0.2, 0.8, 2)
        corners = np.array([[0, 0, 0], [width, 0, 0], [width, length, 0], [0, length, 0]])
        return corners, np.array([x * width, y * length, self.random.uniform(1, 2)])

    def plumb_edges(self, camera: np.ndarray, count: int) -> np.ndarray:
        """Ends of edges from floor to ceiling all around the camera, shape (count, 2, 3)."""
        angle = 2 * np.pi * np.arange(count) / count + self.random.uniform(-0.4, 0.4, count)
        foot = camera * [1, 1, 0] + 3.0 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
        return np.stack([foot, foot + np.array([0, 0, 2.5])], axis=1)

    def click(self, directions: np.ndarray, within: float = 0.0, deviation: float = 0.0) -> np.ndarray:
        """Directions clicked on a panorama of 2048 pixels, missed in pixels: within a disk, or normally distributed."""
        u, v = direction_to_latlong(directions)
        angle = self.random.uniform(0, 2 * np.pi, u.shape)
        radius = within * np.sqrt(self.random.uniform(0, 1, u.shape))
        x = u * 2048 + radius * np.cos(angle) + deviation * self.random.normal(size=u.shape)
        y = v * 1024 + radius * np.sin(angle) + deviation * self.random.normal(size=u.shape)
        return latlong_to_direction(x / 2048, y / 1024)


def seen_from(camera: np.ndarray, rotation: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Directions in light space of world points."""
    toward = (points - camera) @ rotation
    return toward / np.linalg.norm(toward, axis=-1, keepdims=True)


def angle_between(first: np.ndarray, second: np.ndarray) -> float:
    """Degrees between two rotations, or two unit vectors."""
    if first.ndim == 2:
        return float(np.degrees(Rotation.from_matrix(first @ second.T).magnitude()))
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(first, second)), first @ second)))
