"""Making the light-depth map: the panorama, and the distance to the real surface in every pixel."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import latlong_to_direction
from lightdepth.kernel.raycasting import RayCaster
from lightdepth.lightmap.file import LightDepthMap

if TYPE_CHECKING:
    from lightdepth.scene.model import Scene

_PIXELS_AT_ONCE = 2**20


def build_light_depth_map(scene: Scene, progress: Callable[[float], None] | None = None) -> LightDepthMap:
    """Give a scene's panorama the depth of its real surfaces, in the resolution of the panorama.

    The depth is the one that the user gave with the panorama, resampled, or else the distance along the ray through
    each pixel's centre to the first real surface, inf where there is none.

    Args:
        scene: its panorama and real surfaces are used.
        progress: called with the share that is done, in [0, 1].
    """
    panorama = scene.panorama
    height, width = panorama.radiance.shape[:2]
    depth = np.empty((height, width), np.float32)
    caster = None if panorama.depth is not None else RayCaster([surface.mesh for surface in scene.real])
    rows = max(1, _PIXELS_AT_ONCE // width)
    for top in range(0, height, rows):
        band = np.arange(top, min(top + rows, height))
        if caster is None:
            assert panorama.depth is not None
            depth[band] = _resampled(panorama.depth, band, height, width, scene.render.parameters.place.depth_step)
        else:
            u, v = np.broadcast_arrays((np.arange(width) + 0.5) / width, (band[:, None] + 0.5) / height)
            directions = latlong_to_direction(u, v).reshape(-1, 3) @ panorama.rotation.T
            depth[band] = caster.cast(panorama.position, directions).distance.reshape(len(band), width)
        if progress is not None:
            progress((band[-1] + 1) / height)
    return LightDepthMap(panorama.radiance, depth, panorama.position, panorama.rotation)


def _resampled(
    depth: NDArray[np.float32], band: NDArray[np.intp], height: int, width: int, largest_step: float
) -> NDArray[np.float32]:
    """Rows of a depth image in another resolution.

    The reciprocal distance is interpolated bilinearly, for on a plane it is linear in the direction. Across jumps in
    depth and at sky the nearest pixel counts.
    """
    rows, columns = depth.shape
    if (rows, columns) == (height, width):
        return depth[band]
    y = (band + 0.5) * rows / height - 0.5
    x = (np.arange(width) + 0.5) * columns / width - 0.5
    upper, left = np.floor(y).astype(int), np.floor(x).astype(int)
    beside = np.stack([left, left + 1]) % columns
    near, far = np.inf, 0.0
    reciprocal = np.zeros((len(band), width))
    for row, weight in ((upper, upper + 1 - y), (upper + 1, y - upper)):
        over_pole = (row < 0) | (row >= rows)
        row = np.clip(row, 0, rows - 1)
        for column, share in zip(beside, (left + 1 - x, x - left), strict=True):
            # Over a pole the row continues on the other side of the panorama.
            across = np.where(over_pole[:, None], (column + columns // 2) % columns, column)
            value = depth[row[:, None], across]
            near, far = np.minimum(near, value), np.maximum(far, value)
            reciprocal += weight[:, None] * share / value
    nearest = depth[np.clip(np.rint(y), 0, rows - 1).astype(int)[:, None], np.rint(x).astype(int) % columns]
    interpolated = np.divide(1.0, reciprocal, out=np.full_like(reciprocal, np.inf), where=reciprocal > 0.0)
    return np.where(far <= largest_step * near, interpolated, nearest).astype(np.float32)
