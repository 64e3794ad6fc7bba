"""Which pixels new objects may influence: only these are sampled."""

from __future__ import annotations

from functools import reduce

import cv2
import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.cameras import Topology, Viewpoint
from lightdepth.kernel.row_bands import bands
from lightdepth.kernel.tracing import first_hit
from lightdepth.parameters.film import DEFAULT
from lightdepth.place.real_surfaces import FaceKind
from lightdepth.preparation import Prepared

LENS_POINTS = ((0.5, 0.5), *((x, y) for x in (0.0, 0.25, 0.75, 1.0) for y in (0.0, 0.25, 0.75, 1.0)))
"""Of a lens with an aperture, its middle first."""


def influenced_pixels(view: Viewpoint, prepared: Prepared, tile: int = DEFAULT.selection_tile) -> NDArray[np.uint32]:
    """Pixels that see new surfaces or surfaces that receive their influence, row-major indices, ascending.

    A ray is traced through each corner and the middle of every tile; a tile counts if it or any of its neighbours meets
    a synthetic surface, support, or a glossy surface, or if a part of an object comes near it, so that nothing thin is
    missed.

    Args:
        view: the camera.
        prepared: the scene.
        tile: pixels along the side of the tiles.
    """
    surfaces = prepared.surfaces
    width, height = view.resolution
    if not surfaces.has_synthetic and FaceKind.RELIT not in surfaces.kinds:
        return np.zeros(0, np.uint32)
    columns, rows = -(-width // tile), -(-height // tile)
    kept = np.zeros((rows, columns), bool)
    # Over the lens as well: what it blurs is seen from any point of it.
    lenses = LENS_POINTS if view.camera.has_aperture else LENS_POINTS[:1]
    for band in bands(columns, rows):
        reached = mi.Bool(False)
        rays: list[mi.Ray3f] = []
        for place in ((0.5, 0.5), (0.02, 0.02), (0.98, 0.02), (0.02, 0.98), (0.98, 0.98)):
            in_tile = mi.Point2f(*place)
            if len(lenses) > 1:
                dr.make_opaque(in_tile)  # Point by point, and one program for all of them.
            film = dr.minimum(
                (mi.Point2f(band.column, band.row) + in_tile) * mi.Point2f(tile / width, tile / height), 1.0
            )
            for number, lens in enumerate(lenses):
                on_lens = mi.Point2f(*lens)
                if len(lenses) > 1:
                    dr.make_opaque(on_lens)
                seen = view.rays(film, on_lens)
                ray, inside = seen.ray, seen.inside
                found = first_hit(surfaces.seen, ray, coherent=True, active=inside)
                on_real = surfaces.is_real(found)
                hit = surfaces.real_hit(ray, found, on_real)
                reached |= inside & found.is_valid() & (~on_real | surfaces.scatters(hit))
                if number == 0:
                    rays.append(ray)
                else:
                    dr.eval(reached)
        middle, *corners = rays
        cosines = [dr.dot(corner.d, middle.d) for corner in corners]
        radius = dr.acos(dr.clip(reduce(dr.minimum, cosines), -1, 1))
        if prepared.outline is not None:
            reached |= prepared.outline.near(middle, radius, view, radius * (2.0 / tile))
        kept[band.rows] = reached.numpy().reshape(band.shape)
    return _pixels_of(_grown(kept, view.topology, tile), tile, width, height)


def shown_in_the_middle(view: Viewpoint, prepared: Prepared) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """What the pixels show in their middle.

    Returns:
        Which show support without gloss, whose change does not depend on the camera, surfaces with rest positions left
        out, since what they show is not a share of the photograph; and which show, like all pixels beside them, nothing
        that changes. Shape (height, width) each.
    """
    surfaces = prepared.surfaces
    width, height = view.resolution
    support, unchanged = np.empty((height, width), bool), np.empty((height, width), np.uint8)
    for band in bands(width, height):
        seen = view.pixel_rays(band.column, band.row, mi.Point2f(0.5), mi.Point2f(0.5))
        found = first_hit(surfaces.seen, seen.ray, coherent=True, active=seen.inside)
        on_real = seen.inside & surfaces.is_real(found)
        hit = surfaces.real_hit(seen.ray, found, on_real)
        matte = on_real & (hit.kind == int(FaceKind.SUPPORT)) & (hit.gloss == 0)
        same = ~(seen.inside & found.is_valid()) | (on_real & ~surfaces.scatters(hit))
        dr.eval(matte, same)
        support[band.rows] = matte.numpy().reshape(band.shape)
        unchanged[band.rows] = same.numpy().reshape(band.shape)
    return support, cv2.erode(unchanged, np.ones((3, 3), np.uint8)) > 0


def _grown(kept: NDArray[np.bool_], topology: Topology, tile: int) -> NDArray[np.bool_]:
    """The kept tiles and all their neighbours, beyond edges and seams of the film as well."""
    result = kept.copy()
    for chart in topology.charts:
        rows, columns = _sides(chart.top, chart.bottom, tile), _sides(chart.left, chart.right, tile)
        here = np.ix_(rows[1] // tile, columns[1] // tile)
        for row in rows:
            for column in columns:
                above, beside = row[:, None], column[None, :]
                if not topology.endless:
                    above = np.clip(above, chart.top, chart.bottom - 1)
                    beside = np.clip(beside, chart.left, chart.right - 1)
                i, j = topology.beyond(chart, above, beside)
                result[here] |= kept[i // tile, j // tile]
    return result


def _sides(first: int, end: int, tile: int) -> tuple[NDArray[np.intp], ...]:
    """Of the tiles that rows or columns of a chart lie in: the pixels before, first, last and after them, in the chart."""
    tiles = np.arange(first // tile, -(-end // tile))
    begins, ends = np.maximum(tiles * tile, first), np.minimum((tiles + 1) * tile, end) - 1
    return begins - 1, begins, ends, ends + 1


def _pixels_of(tiles: NDArray[np.bool_], tile: int, width: int, height: int) -> NDArray[np.uint32]:
    pixels = np.repeat(np.repeat(tiles, tile, axis=0), tile, axis=1)[:height, :width]
    return np.flatnonzero(pixels).astype(np.uint32)
