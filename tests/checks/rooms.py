"""A room of plain boxes and quads, for scenes with known mistakes."""

import numpy as np
import trimesh

from lightdepth.scene.materials import Diffuse
from lightdepth.scene.model import (
    AnalyticShape,
    Mesh,
    Panorama,
    RealSurface,
    Role,
    Scene,
    SyntheticObject,
    SyntheticPart,
)

LOW, HIGH = np.array([-2.0, -3.0, 0.0]), np.array([2.0, 3.0, 2.5])
CAPTURE = np.array([0.0, 0.0, 1.25])
SIDES = {"floor": (2, 0), "ceiling": (2, 1), "left": (0, 0), "right": (0, 1), "back": (1, 0), "front": (1, 1)}


def to_mesh(source, rest=None):
    return Mesh(np.asarray(source.vertices, np.float32), np.asarray(source.faces, np.int32), rest=rest)


def box(low, high):
    return to_mesh(trimesh.creation.box(bounds=[low, high]))


def side(name):
    """One side of the room as two triangles facing inward."""
    axis, end = SIDES[name]
    u, v = (axis + 1) % 3, (axis + 2) % 3
    corners = np.empty((4, 3))
    corners[:, axis] = (LOW, HIGH)[end][axis]
    corners[:, u] = np.array([LOW, HIGH, HIGH, LOW])[:, u][[0, 1, 2, 3]]
    corners[:, v] = np.array([LOW, LOW, HIGH, HIGH])[:, v]
    faces = np.array([[0, 1, 2], [0, 2, 3]])
    return Mesh(corners.astype(np.float32), (faces if end == 0 else faces[:, ::-1]).astype(np.int32))


def room(without=()):
    return tuple(
        RealSurface(name, side(name), Role.SUPPORT if name == "floor" else Role.ENVIRONMENT)
        for name in SIDES
        if name not in without
    )


def thing(geometry, name="thing"):
    return SyntheticObject(name, (SyntheticPart(geometry, Diffuse(type="diffuse", color=(0.5, 0.5, 0.5))),))


def sphere(center, radius, name="ball"):
    to_world = np.diag([radius, radius, radius, 1.0])
    to_world[:3, 3] = center
    return thing(AnalyticShape("sphere", to_world), name)


def scene(real=None, synthetic=(), position=CAPTURE, rotation=None, radiance=None, depth=None, sky=False):
    if radiance is None:
        radiance = np.full((32, 64, 3), 0.5, np.float32)
        radiance[10, 12] = 50.0
    rotation = np.eye(3) if rotation is None else rotation
    panorama = Panorama(radiance, np.asarray(position, float), rotation, depth, sky)
    return Scene(panorama, room() if real is None else tuple(real), tuple(synthetic))
