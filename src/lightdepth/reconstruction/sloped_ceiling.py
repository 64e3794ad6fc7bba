"""A room under sloped ceilings: the lowest of several planes is the ceiling, and the walls reach up to it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.parameters.reconstruction import DEFAULT, ClickParameters
from lightdepth.reconstruction.polygon import triangulate
from lightdepth.reconstruction.pose import Pose

FloatArray = NDArray[np.float64]


def on_walls(directions: FloatArray, corners: FloatArray, pose: Pose) -> FloatArray:
    """Where clicked directions meet the walls over a floor plan.

    Args:
        directions: light space, shape (n, 3), none of them straight up or down.
        corners: the floor plan around the capture point, world, metres, shape (m, 2).
        pose: of the panorama.

    Returns:
        World points, metres, shape (n, 3).
    """
    world = pose.to_world(directions)
    sides = np.roll(corners, -1, axis=0) - corners
    start = corners - pose.position[:2]
    points = []
    for way in world:
        level = way[:2] / max(float(np.linalg.norm(way[:2])), 1e-9)
        determinant = level[0] * sides[:, 1] - level[1] * sides[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = (start[:, 0] * sides[:, 1] - start[:, 1] * sides[:, 0]) / determinant
            along = (start[:, 0] * level[1] - start[:, 1] * level[0]) / determinant
        met = np.isfinite(distance) & (distance > 0.0) & (along >= -1e-9) & (along <= 1.0 + 1e-9)
        reach = float(distance[met].min())
        rise = reach * way[2] / max(float(np.linalg.norm(way[:2])), 1e-9)
        points.append([*(pose.position[:2] + reach * level), pose.position[2] + rise])
    return np.array(points)


def slope_plane(
    directions: FloatArray, corners: FloatArray, pose: Pose, what: str, tuned: ClickParameters = DEFAULT.clicks
) -> FloatArray:
    """The plane of a sloped ceiling through points where it meets walls.

    Args:
        directions: the clicks, light space, shape (n, 3).
        corners: the floor plan, world, metres, shape (m, 2).
        pose: of the panorama.
        what: the option, for messages.
        tuned: how flat, and how wide, the slope must be.

    Returns:
        ``(a, b, c)`` of ``z = a x + b y + c``, world, metres.

    Raises:
        InputError: fewer than three clicks, points nearly in a line, or a plane that is nearly upright.
    """
    if len(directions) < 3:
        raise InputError(f"{what}: {len(directions)} clicks found; at least 3 are needed, where the slope meets walls")
    points = on_walls(directions, corners, pose)
    middle = points.mean(axis=0)
    _, sizes, axes = np.linalg.svd(points - middle)
    if sizes[1] < tuned.thinnest_slope * sizes[0]:
        raise InputError(
            f"{what}: the clicks lie nearly in one line; click corners of the slope on different walls, such as both ends "
            "of its lower edge and one of its upper edge"
        )
    normal = axes[2] * (np.sign(axes[2, 2]) or 1.0)
    tilt = np.degrees(np.arccos(np.clip(normal[2], -1.0, 1.0)))
    if tilt > tuned.steepest_slope:
        raise InputError(
            f"{what}: the plane through the clicks is {tilt:.0f} degrees steep; up to {tuned.steepest_slope:g} are "
            "allowed. Each click must be where the slope meets a wall that stands on a side of --floor"
        )
    a, b = -normal[:2] / normal[2]
    return np.array([a, b, middle[2] - a * middle[0] - b * middle[1]])


def ceiling_under(planes: Sequence[FloatArray], corners: FloatArray) -> tuple[FloatArray, NDArray[np.int32]]:
    """The lower envelope of planes over a floor plan.

    Args:
        planes: each ``(a, b, c)`` of ``z = a x + b y + c``.
        corners: the plan, counter-clockwise, metres, shape (n, 2).

    Returns:
        Vertices of shape (m, 3) and faces of shape (k, 3) that look down.
    """
    vertices: list[FloatArray] = []
    faces: list[list[int]] = []
    for triangle in triangulate(corners):
        for index, plane in enumerate(planes):
            piece = corners[triangle]
            for other, rival in enumerate(planes):
                if other != index and len(piece):
                    # Equal planes: the first of them counts.
                    margin = 0.0 if other > index else 1e-12
                    piece = _clipped(piece, rival - plane, margin)
            if len(piece) < 3:
                continue
            first = len(vertices)
            vertices += [np.array([x, y, plane @ [x, y, 1.0]]) for x, y in piece]
            faces += [[first, first + i + 1, first + i] for i in range(1, len(piece) - 1)]
    return np.array(vertices), np.array(faces, dtype=np.int32)


def walls_under(
    planes: Sequence[FloatArray], corners: FloatArray, floor: float
) -> tuple[FloatArray, NDArray[np.int32]]:
    """Upright walls over the sides of a floor plan, up to the lower envelope of planes.

    Args:
        planes: each ``(a, b, c)`` of ``z = a x + b y + c``.
        corners: the plan, counter-clockwise, metres, shape (n, 2).
        floor: height of the floor, metres.

    Returns:
        Vertices of shape (m, 3) and faces of shape (k, 3) that look inward.
    """
    vertices: list[list[float]] = []
    faces: list[list[int]] = []
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        shares = [0.0, 1.0]
        for index, plane in enumerate(planes):
            for rival in planes[index + 1 :]:
                here, there = ((plane - rival) @ [*point, 1.0] for point in (start, end))
                if here * there < 0.0:
                    shares.append(float(here / (here - there)))
        points = [start + share * (end - start) for share in sorted(shares)]
        tops = [min(float(plane @ [*point, 1.0]) for plane in planes) for point in points]
        # The top is concave, so that a fan from one end of the foot fills the wall.
        foot, top = len(vertices), len(vertices) + 2
        vertices += [[*start, floor], [*end, floor]]
        vertices += [[*point, height] for point, height in zip(points, tops, strict=True)]
        faces.append([foot, len(vertices) - 1, foot + 1])
        faces += [[foot, i, i + 1] for i in range(top, len(vertices) - 1)]
    return np.array(vertices), np.array(faces, dtype=np.int32)


def _clipped(polygon: FloatArray, line: FloatArray, margin: float) -> FloatArray:
    """The part of a convex polygon of shape (n, 2) where ``line . (x, y, 1)`` is at least a margin."""
    side = polygon @ line[:2] + line[2] - margin
    kept = []
    for i in range(len(polygon)):
        here, there = side[i], side[(i + 1) % len(polygon)]
        if here >= 0.0:
            kept.append(polygon[i])
        if here * there < 0.0:
            kept.append(polygon[i] + here / (here - there) * (polygon[(i + 1) % len(polygon)] - polygon[i]))
    return np.array(kept).reshape(-1, 2)
