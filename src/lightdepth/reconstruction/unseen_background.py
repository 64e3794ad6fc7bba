"""The background behind the jumps of a depth image, unseen from the capture point: surfaces that close the cuts."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from lightdepth.directions import pixel_directions
from lightdepth.lightmap.depth_mesh import joined
from lightdepth.parameters.reconstruction import DEFAULT, DepthParameters
from lightdepth.reconstruction.depth_image import continued
from lightdepth.reconstruction.pose import Pose
from lightdepth.scene.model import Mesh

FloatArray = NDArray[np.float64]


def unseen_background(
    depth: FloatArray, pose: Pose, planes: FloatArray | None = None, tuned: DepthParameters = DEFAULT.depth
) -> Mesh:
    """Go on with the far side of every jump in depth behind its near side.

    From the capture point the cut between the two is then closed, and from beside it one looks at the wall behind an
    object, not through a gap.

    Args:
        depth: metres along the ray, inf for sky, shape (height, 2 height), float64, positive.
        pose: of the depth image.
        planes: reciprocal distance of what is known to go on behind each pixel, 1 / metres, the same shape; 0 where it is
            not known, and is continued from what is seen beside it.
        tuned: how far it goes on.

    Returns:
        World, metres, counter-clockwise seen from the capture point; without faces where nothing jumps.
    """
    height, width = depth.shape
    reciprocal = 1.0 / depth
    background = _background_beside_jumps(reciprocal)
    reach = round(tuned.behind_reach / 180.0 * height)
    unseen, near = _near_side(reciprocal, background, reach, tuned.behind_nearer)
    seen = (reciprocal > 0.0) & ~near
    layer = continued(reciprocal, unseen, seen, tuned)
    if planes is not None:
        layer = np.where(unseen & (planes > 0.0), planes, layer)
    layer[unseen] = np.minimum(layer[unseen], tuned.behind_gap * reciprocal[unseen])
    # A ring of what is seen belongs to the layer, slightly behind it, so that the two overlap.
    layer[~unseen] *= 0.999
    first = _round(ndimage.binary_dilation(_round(unseen, 1), np.ones((3, 3))), -1)
    usable = (unseen | seen) & (layer > 0.0)

    rows, columns = np.meshgrid(np.arange(height - 1), np.arange(width), indexing="ij")
    a, b = rows * width + columns, rows * width + (columns + 1) % width
    c, d = a + width, b + width
    faces = np.concatenate([np.stack(corners, axis=-1).reshape(-1, 3) for corners in ((a, d, b), (a, c, d))])
    wanted = usable.ravel()[faces].all(axis=1) & first.ravel()[faces].all(axis=1)
    used, compact = np.unique(faces[wanted], return_inverse=True)
    directions = pose.to_world(pixel_directions(height, width).reshape(-1, 3)[used])
    vertices = pose.position + directions / layer.ravel()[used, None]
    return Mesh(vertices.astype(np.float32), compact.reshape(-1, 3).astype(np.int32))


def _background_beside_jumps(reciprocal: FloatArray) -> FloatArray:
    """For each pixel on the near side of a jump the least reciprocal distance on its far sides; NaN elsewhere."""
    height, width = reciprocal.shape
    padded = np.pad(reciprocal, ((1, 1), (0, 0)), mode="edge")
    directions = np.pad(pixel_directions(height, width), ((1, 1), (0, 0), (0, 0)), mode="edge")
    background = np.full(reciprocal.shape, np.nan)
    for axis, cut in (
        (1, ~joined(padded, directions, axis=1)[1:-1]),
        (0, np.vstack([~joined(padded, directions, axis=0)[1:-1], np.zeros((1, width), dtype=bool)])),
    ):
        following = np.roll(reciprocal, -1, axis=axis)
        cut &= (reciprocal > 0.0) & (following > 0.0)
        here = np.where(cut & (following < reciprocal), following, np.nan)
        there = np.roll(np.where(cut & (following > reciprocal), reciprocal, np.nan), 1, axis=axis)
        background = np.fmin(background, np.fmin(here, there))
    return background


def _near_side(
    reciprocal: FloatArray, background: FloatArray, reach: int, nearer: float
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Which pixels the background goes on behind, and all that stand before it, as far as that is known."""
    beside = ~np.isnan(background)
    if not beside.any():
        return beside, beside
    distance, nearest = ndimage.distance_transform_edt(~_round(beside, 2 * reach), return_indices=True)
    compared = _round(background, 2 * reach)[tuple(nearest)]
    before = _round(reciprocal, 2 * reach) > nearer * compared
    near = before & (distance <= 2 * reach)
    return (
        _round((near & (distance <= reach)) | (distance == 0), -2 * reach),
        _round(near | (distance == 0), -2 * reach),
    )


def _round(image: NDArray, columns: int) -> NDArray:
    """Repeat that many columns of the other side at the left and right edge; negative: take them off again."""
    if columns < 0:
        return image[:, -columns:columns]
    return np.pad(image, ((0, 0), (columns, columns)), mode="wrap")
