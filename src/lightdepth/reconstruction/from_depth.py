"""Surfaces of a place from an equirectangular depth image."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.lightmap.depth_mesh import mesh_from_depth
from lightdepth.parameters.reconstruction import DEFAULT, ReconstructionParameters
from lightdepth.reconstruction.depth_image import DepthImage, denoised, fill_missing, reduced
from lightdepth.reconstruction.floor import Plane, find_floor, split_floor, spread_points
from lightdepth.reconstruction.pose import Pose
from lightdepth.reconstruction.simplification import simplified
from lightdepth.reconstruction.unseen_background import unseen_background
from lightdepth.scene.model import Mesh, RealSurface, Role

SHELL_FACES = 12
"""Of the box that may be put around everything."""


@dataclass(frozen=True)
class Measured:
    """Surfaces made from measurements.

    Attributes:
        surfaces: world, metres.
        floor: the plane that was found, or ``None`` where none was asked for.
        sky: directions that are sky, shape (height, 2 height); ``None`` where none is.
    """

    surfaces: list[RealSurface]
    floor: Plane | None
    sky: NDArray[np.bool_] | None = None


def surfaces_from_depth(
    image: DepthImage,
    pose: Pose,
    max_width: int = 1024,
    floor_tolerance: float | None = 0.03,
    progress: Callable[[float], None] = lambda share: None,
    most_faces: int = 50_000,
    tuned: ReconstructionParameters = DEFAULT,
) -> Measured:
    """Mesh a depth image: cut at its jumps, closed where it has holes and behind what stands in front.

    Args:
        image: the measured distances.
        pose: of the image, which is that of the panorama.
        max_width: wider images are reduced to at most this many columns.
        floor_tolerance: largest distance of a floor point from the floor's plane, metres; ``None`` looks for no floor.
        progress: called with the share that is done.
        most_faces: of all surfaces together, which are simplified to these.
        tuned: how it is cleaned and continued, and how the floor is found.

    Returns:
        ``floor`` (support), ``place`` and, where something stands in front of something, ``behind`` (environment).

    Raises:
        InputError: there is no floor.
    """
    image = denoised(reduced(image, max_width), tuned.depth)
    depth = fill_missing(image, tuned.depth)
    progress(0.3)
    mesh = mesh_from_depth(depth.astype(np.float32), pose.position, pose.rotation, max_width)
    if len(mesh.faces) == 0:
        raise InputError("the depth image has no surface: everything in it is sky")
    progress(0.6)
    hidden = unseen_background(depth, pose, tuned=tuned.depth)
    behind = simplified(hidden, round(tuned.depth.behind_share * most_faces), tuned.depth.unseen_error)
    progress(0.8)
    floor, surfaces = split_roles(mesh, pose, floor_tolerance, most_faces - len(behind.faces) - SHELL_FACES, tuned)
    if len(behind.faces):
        surfaces.append(RealSurface("behind", behind, Role.ENVIRONMENT))
    sky = np.isinf(depth)
    progress(1.0)
    return Measured(surfaces, floor, sky if sky.any() else None)


def split_roles(
    mesh: Mesh,
    pose: Pose,
    floor_tolerance: float | None,
    most_faces: int | None = None,
    tuned: ReconstructionParameters = DEFAULT,
) -> tuple[Plane | None, list[RealSurface]]:
    """The floor as support, the rest as environment; without a tolerance all is environment.

    Args:
        mesh: of the place, world, metres.
        pose: of the panorama.
        floor_tolerance: largest distance of a floor point from the floor's plane, metres.
        most_faces: of the surfaces, which are simplified to these; ``None`` keeps all.
        tuned: how the floor is found, and how far surfaces may move.

    Raises:
        InputError: there is no floor.
    """
    if floor_tolerance is None:
        few = mesh if most_faces is None else simplified(mesh, most_faces, tuned.depth.unseen_error)
        return None, [RealSurface("place", few, Role.ENVIRONMENT)]
    floor = find_floor(spread_points(mesh, tuned.floor.points), pose.position, floor_tolerance, tuned.floor)
    level, rest = split_floor(mesh, floor, floor_tolerance, most_faces, tuned)
    named = [RealSurface("floor", level, Role.SUPPORT), RealSurface("place", rest, Role.ENVIRONMENT)]
    return floor, [surface for surface in named if len(surface.mesh.faces)]
