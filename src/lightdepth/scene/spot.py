"""What a pixel of the panorama shows: the point of the real place there, and how an object is put onto it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import direction_to_latlong, latlong_to_direction
from lightdepth.errors import InputError
from lightdepth.scene.model import AnalyticShape, Mesh, Panorama, RealSurface

FloatArray = NDArray[np.float64]

STEEPEST = 45.0
"""Degrees to the horizontal up to which an object that keeps upright can stand on a surface."""
EDGE = 1e-9
"""Barycentric tolerance: a ray through an edge meets one of the two triangles at least."""


@dataclass(frozen=True)
class Spot:
    """A point of the real place.

    Attributes:
        surface: name of the real surface; ``depth`` where the place is a depth image.
        point: world, metres, shape (3,), float64.
        normal: unit, world, on the side that the capture point sees, shape (3,), float64.
        distance: from the capture point, metres.
    """

    surface: str
    point: FloatArray
    normal: FloatArray
    distance: float

    @property
    def slope(self) -> float:
        """Angle between the surface and the horizontal, degrees: 0 is a floor, 90 a wall, 180 a ceiling."""
        return float(np.degrees(np.arccos(np.clip(self.normal[2], -1.0, 1.0))))


def pixel_direction(x: float, y: float, size: tuple[int, int]) -> FloatArray:
    """Unit vector in light space through a point of a panorama, shape (3,).

    Args:
        x: pixels to the right of the picture's left edge, so that the first pixel's centre is at 0.5.
        y: pixels below its upper edge.
        size: height and width of the panorama in pixels.

    Raises:
        InputError: the point is not on the panorama.
    """
    height, width = size
    if not (0.0 <= x <= width and 0.0 <= y <= height):
        raise InputError(
            f"at: the point {x:g}, {y:g} is not on the panorama; allowed are x from 0 to {width} and y from 0 to "
            f"{height} pixels"
        )
    return latlong_to_direction(x / width, y / height)


def angles_direction(right: float, up: float) -> FloatArray:
    """Unit vector in light space, shape (3,), from degrees right of the centre column and above the middle row.

    Raises:
        InputError: the angles are beyond the panorama.
    """
    if not (-360.0 <= right <= 360.0 and -90.0 <= up <= 90.0):
        raise InputError(f"at_angles: {right:g}, {up:g}; allowed are -360 to 360 degrees right and -90 to 90 up")
    return latlong_to_direction(right / 360.0 + 0.5, 0.5 - up / 180.0)


def find_spot(panorama: Panorama, real: Sequence[RealSurface], direction: FloatArray) -> Spot | None:
    """Find what the capture point sees in a direction.

    Args:
        panorama: its pose, and its depth where there are no real surfaces.
        real: the real surfaces.
        direction: unit, light space, shape (3,).

    Returns:
        The spot, or ``None`` where no real surface is met.
    """
    if real:
        return _on_meshes(panorama, real, panorama.rotation @ direction)
    return None if panorama.depth is None else _on_depth(panorama, panorama.depth, direction)


def _on_meshes(panorama: Panorama, real: Sequence[RealSurface], ray: FloatArray) -> Spot | None:
    found: Spot | None = None
    for surface in real:
        hit = first_hit(surface.mesh, panorama.position, ray)
        if hit is not None and (found is None or hit[0] < found.distance):
            distance, normal = hit
            normal = normal if normal @ ray < 0.0 else -normal
            found = Spot(surface.name, panorama.position + distance * ray, normal, distance)
    return found


def first_hit(mesh: Mesh, origin: FloatArray, ray: FloatArray) -> tuple[float, FloatArray] | None:
    """Where a ray first meets a mesh, from either side (T. Moeller and B. Trumbore, 1997), in double precision.

    Args:
        mesh: world, metres.
        origin: world, metres, shape (3,).
        ray: unit, world, shape (3,).

    Returns:
        The distance in metres and the unit normal of the face as it is wound, or ``None``.
    """
    a, b, c = (mesh.vertices[mesh.faces[:, corner]].astype(np.float64) for corner in range(3))
    first, second, away = b - a, c - a, origin - a
    across = np.cross(ray, second)
    determinant = np.einsum("ij,ij->i", first, across)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.einsum("ij,ij->i", away, across) / determinant
        turned = np.cross(away, first)
        v = (turned @ ray) / determinant
        distance = np.einsum("ij,ij->i", second, turned) / determinant
        met = (u >= -EDGE) & (v >= -EDGE) & (u + v <= 1.0 + EDGE) & (distance > 1e-9)
    if not met.any():
        return None
    face = int(np.argmin(np.where(met, distance, np.inf)))
    normal = np.cross(first[face], second[face])
    return float(distance[face]), normal / np.linalg.norm(normal)


def _on_depth(panorama: Panorama, depth: NDArray[np.float32], direction: FloatArray) -> Spot | None:
    """On the surface between the four nearest distances, whose reciprocals are linear in the direction on a plane."""
    height, width = depth.shape
    u, v = direction_to_latlong(direction)
    x, y = float(u) * width - 0.5, float(np.clip(v * height - 0.5, 0.0, height - 1.0))
    left, upper = int(np.floor(x)), min(int(y), height - 2)
    columns, rows = np.array([left, left + 1]) % width, np.array([upper, upper + 1])
    near = depth[np.ix_(rows, columns)].astype(np.float64)
    nearest = near[round(y - upper), round(x - left)]
    if not np.isfinite(nearest):
        return None
    near = np.where(np.abs(near - nearest) < 0.2 * nearest, near, nearest)  # Not across a jump in depth.
    across, along = x - left, y - upper
    weights = np.outer([1.0 - along, along], [1.0 - across, across])
    distance = float(1.0 / np.sum(weights / near))
    around = latlong_to_direction(
        np.broadcast_to((np.array([left, left + 1]) + 0.5) / width, (2, 2)),
        np.broadcast_to(((rows + 0.5) / height)[:, None], (2, 2)),
    )
    points = around * near[..., None] @ panorama.rotation.T
    normal = np.cross(points[1, 1] - points[0, 0], points[0, 1] - points[1, 0])
    normal /= np.linalg.norm(normal)
    ray = panorama.rotation @ direction
    normal = normal if normal @ ray < 0.0 else -normal
    return Spot("depth", panorama.position + distance * ray, normal, distance)


def standing_placement(
    spot: Spot, bodies: Sequence[Mesh | AnalyticShape], linear: FloatArray, stand: bool, align: bool
) -> FloatArray:
    """Matrix that puts an object onto a spot, shape (4, 4), float64.

    Args:
        spot: where.
        bodies: the object's parts in its own coordinates; shapes of unit size, whose own matrix plays no part.
        linear: the object's scale and rotation, shape (3, 3).
        stand: its lowest point is at the spot's height, its middle above the spot; else its origin is at the spot.
        align: turn its z axis to the spot's normal; *lowest* is then meant along the normal.

    Raises:
        InputError: it is to stand upright on what is too steep for that.
    """
    if stand and not align and spot.slope > STEEPEST:
        raise InputError(
            f'at: shows "{spot.surface}", which is {spot.slope:.0f} degrees steep there; nothing stands on it. Take a '
            "point on the floor or on a table, write `align = true` to fasten the object to the surface, or "
            "`stand = false` to put its origin there"
        )
    axes = _turned_to(spot.normal) if align else np.eye(3)
    matrix = np.eye(4)
    matrix[:3, :3] = axes @ linear
    matrix[:3, 3] = spot.point
    if stand:
        low, high = extents(bodies, matrix[:3, :3], axes)
        middle = np.array([*(low + high)[:2] / 2.0, low[2]])
        matrix[:3, 3] -= axes @ middle
    return matrix


def extents(
    bodies: Sequence[Mesh | AnalyticShape], linear: FloatArray, axes: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Least and greatest coordinates along three axes of an object under a linear map.

    Args:
        bodies: its parts; shapes of unit size, whose own matrix plays no part.
        linear: shape (3, 3).
        axes: unit vectors as columns, shape (3, 3).

    Returns:
        Two arrays of shape (3,).
    """
    to_axes = axes.T @ linear
    spans: list[tuple[FloatArray, FloatArray]] = []
    for body in bodies:
        if isinstance(body, Mesh):
            along = body.vertices.astype(np.float64) @ to_axes.T
            spans.append((along.min(axis=0), along.max(axis=0)))
        else:
            spans.append(_shape_extents(body.kind, to_axes))
    return np.stack([low for low, _ in spans]).min(axis=0), np.stack([high for _, high in spans]).max(axis=0)


def _shape_extents(kind: str, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The same of a shape as Mitsuba defines it, exactly."""
    around = np.hypot(rows[:, 0], rows[:, 1])
    match kind:
        case "sphere":
            reach = np.linalg.norm(rows, axis=1)
        case "cube":
            reach = np.abs(rows).sum(axis=1)
        case "rectangle":
            reach = np.abs(rows[:, :2]).sum(axis=1)
        case "disk":
            reach = around
        case _:  # The cylinder, from z = 0 to 1.
            return np.minimum(rows[:, 2], 0.0) - around, np.maximum(rows[:, 2], 0.0) + around
    return -reach, reach


def _turned_to(normal: FloatArray) -> FloatArray:
    """The shortest rotation of z to a unit normal, shape (3, 3)."""
    cosine = float(normal[2])
    if cosine < -1.0 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    x, y = float(normal[0]), float(normal[1])
    # Rodrigues' formula about the axis z x n.
    return np.array(
        [
            [1.0 - x * x / (1.0 + cosine), -x * y / (1.0 + cosine), x],
            [-x * y / (1.0 + cosine), 1.0 - y * y / (1.0 + cosine), y],
            [-x, -y, cosine],
        ]
    )
