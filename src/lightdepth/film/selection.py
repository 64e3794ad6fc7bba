"""Which pixels new objects may influence: only these are sampled."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.kernel.row_bands import bands
from lightdepth.kernel.variables import as_matrix, as_point
from lightdepth.place.real_surfaces import FaceKind
from lightdepth.preparation import Prepared
from lightdepth.scene.model import CameraView

TILE = 8
"""Pixels along the side of the tiles that are kept or skipped as a whole."""


def influenced_pixels(view: CameraView, prepared: Prepared) -> NDArray[np.uint32]:
    """Pixels that see new surfaces or surfaces that receive their influence, row-major indices, ascending.

    A ray is traced through each corner and the middle of every tile; a tile counts if it or any of its neighbours meets
    a synthetic or a support surface, or if an object's bounds reach into it, so that nothing thin is missed.
    """
    surfaces = prepared.surfaces
    width, height = view.camera.resolution
    if not surfaces.has_synthetic and FaceKind.RELIT not in surfaces.kinds:
        return np.zeros(0, np.uint32)
    columns, rows = -(-width // TILE), -(-height // TILE)
    kept = np.zeros((rows, columns), bool)
    origin, rotation = as_point(view.position), as_matrix(view.rotation)
    for band in bands(columns, rows):
        reached = mi.Bool(False)
        middle, corners = None, []
        for x, y in ((0.5, 0.5), (0.02, 0.02), (0.98, 0.02), (0.02, 0.98), (0.98, 0.98)):
            film = mi.Point2f(
                dr.minimum((band.column + x) * (TILE / width), 1.0), dr.minimum((band.row + y) * (TILE / height), 1.0)
            )
            start, direction, inside = view.camera.camera_rays(film, mi.Point2f(0.5))
            ray = mi.Ray3f(origin + rotation @ start, rotation @ direction)
            found = surfaces.all.ray_intersect_preliminary(ray, coherent=True, active=inside)
            on_real = surfaces.is_real(found)
            hit = surfaces.real_hit(ray, found, on_real)
            reached |= inside & found.is_valid() & (~on_real | surfaces.receives(hit))
            if middle is None:
                middle = ray
            else:
                corners.append(dr.dot(ray.d, middle.d))
        radius = dr.acos(
            dr.clip(dr.minimum(dr.minimum(corners[0], corners[1]), dr.minimum(corners[2], corners[3])), -1, 1)
        )
        if prepared.integrator.bounds is not None:
            reached |= prepared.integrator.bounds.near(middle, radius)
        kept[band.rows] = reached.numpy().reshape(band.shape)
    return _pixels_of(_grown(kept), width, height)


def _grown(kept: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The kept tiles and all their neighbours, across the image's left and right edges as well."""
    padded = np.pad(np.pad(kept, ((0, 0), (1, 1)), mode="wrap"), ((1, 1), (0, 0)))
    rows, columns = kept.shape
    result = np.zeros_like(kept)
    for i in range(3):
        for j in range(3):
            result |= padded[i : i + rows, j : j + columns]
    return result


def _pixels_of(tiles: NDArray[np.bool_], width: int, height: int) -> NDArray[np.uint32]:
    pixels = np.repeat(np.repeat(tiles, TILE, axis=0), TILE, axis=1)[:height, :width]
    return np.flatnonzero(pixels).astype(np.uint32)
