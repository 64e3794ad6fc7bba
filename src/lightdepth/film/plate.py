"""The plate: the photograph as a camera sees it, free of noise."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.cameras import Viewpoint
from lightdepth.kernel.arrays import aligned
from lightdepth.kernel.row_bands import bands
from lightdepth.place.place import Place
from lightdepth.scene.model import Panorama

MOST_SUBPIXELS = 8


def render_plate(
    view: Viewpoint, panorama: Panorama, place: Place, draft: bool = False
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Resample the photograph for a camera.

    Args:
        view: the camera.
        panorama: the photograph.
        place: the same with its geometry.
        draft: one point in each pixel will do.

    Returns:
        ``(plate, alpha)``, shapes (height, width, 3) and (height, width), float32: radiance, black outside the
        camera's image, and the share of each pixel inside it. A camera whose pixels are the panorama's gets these,
        bit for bit; any other one the mean over a grid of points in each pixel, fine enough for the panorama's detail.
    """
    width, height = view.resolution
    if view.same_pixels(panorama.viewpoint):
        return panorama.radiance, np.ones((height, width), np.float32)
    subpixels = 1 if draft else _subpixels(view, place)
    plate = np.empty((height, width, 3), np.float32)
    alpha = np.empty((height, width), np.float32)
    for band in bands(width, height):
        total, share = dr.zeros(mi.Color3f, dr.width(band.row)), dr.zeros(mi.Float, dr.width(band.row))
        dr.make_opaque(total, share)  # Literal zeros would need a kernel of their own.
        for i in range(subpixels):
            for j in range(subpixels):
                # Point by point, so that one small kernel serves all of them.
                offset = mi.Point2f((i + 0.5) / subpixels, (j + 0.5) / subpixels)
                dr.make_opaque(offset)
                seen = view.pixel_rays(band.column, band.row, offset, mi.Point2f(0.5))
                hit = place.surfaces.first_real(seen.ray, seen.inside)
                total += place.photograph.sharp(hit, seen.ray.d) & seen.inside
                share += dr.select(seen.inside, 1.0, 0.0)
                dr.eval(total, share)
        scale = 1.0 / subpixels**2
        plate[band.rows] = (total * scale).numpy().T.reshape(*band.shape, 3)
        alpha[band.rows] = (share * scale).numpy().reshape(band.shape)
    return plate, alpha


def _subpixels(view: Viewpoint, place: Place) -> int:
    """Points along each side of a pixel, so that they lie at most one pixel of the panorama apart."""
    _, height = view.resolution
    x = mi.Float(aligned(np.linspace(0.1, 0.9, 9).repeat(9)))
    y = mi.Float(aligned(np.tile(np.linspace(0.1, 0.9, 9), 9)))
    seen = view.rays(mi.Point2f(x, y), mi.Point2f(0.5))
    beside = view.rays(mi.Point2f(x, y + 1.0 / height), mi.Point2f(0.5))
    angle = float(np.max(dr.norm(seen.ray.d - beside.ray.d).numpy()))
    return int(np.clip(np.ceil(angle * place.photograph.map.height / np.pi), 2, MOST_SUBPIXELS))
