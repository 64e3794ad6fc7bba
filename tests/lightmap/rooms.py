"""Rooms whose depth has a closed form."""

import numpy as np
import trimesh

from lightdepth.directions import euler_rotation
from lightdepth.scene.model import Mesh, Panorama, RealSurface, Role, Scene

LOW, HIGH = np.array([-2.0, -3.0, 0.0]), np.array([4.0, 2.5, 2.8])
POSITION, ROTATION = np.array([0.5, -0.4, 1.6]), euler_rotation([3.0, -5.0, 40.0])


def to_mesh(source):
    return Mesh(np.asarray(source.vertices, np.float32), np.asarray(source.faces, np.int32))


def box(low=LOW, high=HIGH):
    return to_mesh(trimesh.creation.box(bounds=[low, high]))


def box_depth(directions, position=POSITION, low=LOW, high=HIGH):
    """Distances to a box's walls from inside, for unit directions in world space."""
    with np.errstate(divide="ignore"):
        return np.maximum((low - position) / directions, (high - position) / directions).min(axis=-1)


def scene(meshes, height, depth=None):
    radiance = np.random.default_rng(7).uniform(0, 1, (height, 2 * height, 3)).astype(np.float32)
    surfaces = tuple(RealSurface(str(i), mesh, Role.ENVIRONMENT) for i, mesh in enumerate(meshes))
    return Scene(Panorama(radiance, POSITION, ROTATION, depth), surfaces)
