"""Real surfaces from a depth image: the mesh that stands in where the user gives depth instead of meshes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import latlong_to_direction
from lightdepth.parameters.place import DEFAULT, PlaceParameters
from lightdepth.scene.model import Mesh

SHIFT = 0.1
"""Vertices lie this share of a pixel beside the pixels' centres: rays through centres would slip through vertices."""


def mesh_from_depth(
    depth: NDArray[np.float32],
    position: NDArray[np.float64],
    rotation: NDArray[np.float64],
    max_width: int | None = None,
    tuned: PlaceParameters = DEFAULT,
) -> Mesh:
    """Make a triangle mesh of what the capture point sees, open at jumps in depth and at sky.

    Two neighbouring pixels lie on one surface if the line between their points meets the view at more than
    ``depth_angle``, or else if a plane goes on from one of them to the other: on a plane the reciprocal distance is
    linear in the direction, so that the two pixels before (or behind) predict the next one. The second test keeps
    floors and walls whole that are seen at a grazing angle, where depth changes fast. Across any other step the mesh is
    cut, and nothing closes the gap behind the nearer surface. The panorama's edge is joined, and the poles are closed.

    Args:
        depth: distance along the ray, metres, inf for sky, shape (height, 2 height), float32, positive.
        position: capture point, world, metres, shape (3,).
        rotation: light space to world, shape (3, 3).
        max_width: a wider depth image is thinned out to at most this many columns: ``max_width ** 2``
            triangles are the most; ``None`` is ``depth_width``.
        tuned: which pixels are joined.

    Returns:
        A mesh in world space whose faces are counter-clockwise seen from the capture point, without unused vertices;
        without any where all is sky.
    """
    height, width = depth.shape
    stride = -(-width // (tuned.depth_width if max_width is None else max_width))
    columns, rows = np.arange(stride // 2, width, stride), np.arange(stride // 2, height, stride)
    u, v = np.broadcast_arrays((columns[None, :] + 0.5) / width, (rows[:, None] + 0.5) / height)
    reciprocal = 1.0 / depth[np.ix_(rows, columns)].astype(np.float64)
    reciprocal = np.vstack([_pole(reciprocal[0]), reciprocal, _pole(reciprocal[-1])])
    directions = _with_poles(latlong_to_direction(u, v))
    right, down = (joined(reciprocal, directions, axis, tuned) for axis in (1, 0))
    reciprocal[1:-1] += _slope(reciprocal[1:-1], right[1:-1], down[1:-1])
    directions = _with_poles(latlong_to_direction(u + SHIFT * stride / width, v + SHIFT * stride / height))
    used, faces = np.unique(_faces(right, down), return_inverse=True)
    points = directions.reshape(-1, 3)[used] / reciprocal.reshape(-1, 1)[used]
    vertices = np.asarray(position) + points @ np.asarray(rotation).T
    return Mesh(vertices.astype(np.float32), faces.reshape(-1, 3).astype(np.int32))


def _with_poles(directions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Directions of a panorama's pixels with a row for each pole added."""
    zenith = np.broadcast_to([0.0, 0.0, 1.0], (1, *directions.shape[1:]))
    return np.concatenate([zenith, directions, -zenith])


def _slope(reciprocal: NDArray[np.float64], right: NDArray[np.bool_], down: NDArray[np.bool_]) -> NDArray[np.float64]:
    """By how much the reciprocal distance grows over the way of ``SHIFT``, as far as the same surface goes on.

    Args:
        reciprocal: without the poles, shape (rows, columns).
        right: whether each is joined to the next one to the right, shape (rows, columns).
        down: whether each is joined to the next one below, shape (rows - 1, columns).
    """
    to_right = np.where(right, np.roll(reciprocal, -1, axis=1) - reciprocal, np.nan)
    below = np.full_like(reciprocal, np.nan)
    below[:-1] = np.where(down, np.diff(reciprocal, axis=0), np.nan)
    slope = np.zeros_like(reciprocal)
    for ahead, back in ((to_right, np.roll(to_right, 1, axis=1)), (below, np.roll(below, 1, axis=0))):
        slope += np.nan_to_num(np.where(np.isnan(ahead), back, ahead))
    return SHIFT * slope


def _pole(row: NDArray[np.float64]) -> NDArray[np.float64]:
    """Reciprocal distance at a pole from the row around it, repeated for every column, shape (1, columns)."""
    return np.full((1, row.size), np.median(row))


def joined(
    reciprocal: NDArray[np.float64],
    directions: NDArray[np.float64],
    axis: int,
    tuned: PlaceParameters = DEFAULT,
) -> NDArray[np.bool_]:
    """Whether each pixel lies on one surface with the next one along an axis.

    Args:
        reciprocal: 1 / distance, 0 for sky, shape (rows, columns).
        directions: unit vectors, shape (rows, columns, 3).
        axis: 0 down, where the last row has no next one, or 1 to the right, which goes round.
        tuned: which are joined.

    Returns:
        Shape (rows - 1, columns) or (rows, columns).
    """

    def shifted(values: NDArray[np.float64], by: int) -> NDArray[np.float64]:
        if axis == 1:
            return np.roll(values, -by, axis=1)
        count = len(values)
        return values[np.clip(np.arange(count - 1) + by, 0, count - 1)]

    first, second = shifted(reciprocal, 0), shifted(reciprocal, 1)
    cosine = np.einsum("ijk,ijk->ij", shifted(directions, 0), shifted(directions, 1))
    # Toward the poles neighbours in a row come so close that noise would cut the mesh: a row's height is the least.
    cosine = np.minimum(cosine, np.cos(np.pi / (len(reciprocal) - 2)))
    # In the triangle of both points and the capture point, with distances 1 / q, the angle at the farther point has
    # tan = q_far sin a / (q_near - q_far cos a).
    near, far = np.maximum(first, second), np.minimum(first, second)
    facing = far * np.sqrt(1.0 - cosine**2) >= np.tan(np.radians(tuned.depth_angle)) * (near - far * cosine)
    step = second - first
    before, behind = first - shifted(reciprocal, -1), shifted(reciprocal, 2) - second
    predicted = np.minimum(np.abs(step - before), np.abs(step - behind)) <= tuned.depth_unexplained * np.abs(step)
    return (far > 0.0) & (facing | predicted)


def _faces(right: NDArray[np.bool_], down: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Two triangles between each four neighbours, where both of a triangle's sides on the grid are joined.

    Args:
        right: see :func:`joined`, shape (rows, columns); the first and the last row are the poles.
        down: the same for the other axis, shape (rows - 1, columns).

    Returns:
        Indices into the grid, shape (n, 3), each pole always by its first one.
    """
    rows, columns = right.shape
    index = np.arange(rows * columns).reshape(rows, columns)
    index[0], index[-1] = index[0, 0], index[-1, 0]
    beside = np.roll(index, -1, axis=1)
    upper = right[:-1] & np.roll(down, -1, axis=1)
    lower = right[1:] & down
    upper[0] = lower[-1] = False  # Two of their corners would be the same pole.
    return np.concatenate(
        [
            np.stack([index[:-1], beside[1:], beside[:-1]], axis=-1)[upper],
            np.stack([index[:-1], index[1:], beside[1:]], axis=-1)[lower],
        ]
    )
