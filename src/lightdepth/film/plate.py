"""The plate: the photograph as a camera sees it, free of noise."""

from __future__ import annotations

from collections.abc import Sequence

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.cameras import Viewpoint
from lightdepth.cameras.viewpoint import CameraRays
from lightdepth.film.highlights import Highlights
from lightdepth.kernel.arrays import aligned
from lightdepth.kernel.row_bands import bands
from lightdepth.kernel.sobol import sobol_points
from lightdepth.parameters.film import DEFAULT, FilmParameters
from lightdepth.place.feather import mask_feather
from lightdepth.place.place import Place
from lightdepth.preparation import Prepared
from lightdepth.scene.identity import digest
from lightdepth.scene.model import Panorama

KEPT, LARGEST_KEPT = 2, 1 << 22
"""Plates that a prepared place keeps, and pixels of the largest."""


def kept_plate(
    view: Viewpoint,
    panoramas: Sequence[Panorama],
    prepared: Prepared,
    draft: bool = False,
    parameters: FilmParameters = DEFAULT,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """:func:`render_plate`, taken from the prepared place where it keeps it: objects play no part in it."""
    width, height = view.resolution
    if any(view.same_pixels(each.viewpoint) for each in panoramas) or width * height > LARGEST_KEPT:
        return render_plate(view, panoramas, prepared.place, draft, prepared.gains, parameters)
    plates, key = prepared.plates, digest(view, draft, parameters)
    if key not in plates:
        plates[key] = render_plate(view, panoramas, prepared.place, draft, prepared.gains, parameters)
        while len(plates) > KEPT:
            plates.pop(next(iter(plates)))
    plate, alpha = plates[key]
    return plate.copy(), alpha.copy()  # They become part of the frame, which its owner may change.


def render_plate(
    view: Viewpoint,
    panoramas: Sequence[Panorama],
    place: Place,
    draft: bool = False,
    gains: NDArray[np.float32] | None = None,
    parameters: FilmParameters = DEFAULT,
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Resample what was photographed for a camera.

    Args:
        view: the camera.
        panoramas: the photographs.
        place: the same with their geometry.
        draft: one point in each pixel will do.
        gains: of each photograph, per channel, shape (k, 3); ``None`` is 1.
        parameters: how many points at least and at most.

    Returns:
        ``(plate, alpha)``, shapes (height, width, 3) and (height, width), float32: radiance, black outside the
        camera's image, and the share of each pixel inside it. A camera whose pixels are those of a panorama gets these,
        bit for bit, but for what its mask leaves out; any other one the mean over a grid of points in each pixel, fine
        enough for the panorama's detail.
        A lens with an aperture blurs the photograph as it blurs the objects: the mean is over points of the lens as well.
        What glossy surfaces mirror is that which they mirror toward this camera (:mod:`lightdepth.film.highlights`).
    """
    own = next((index for index, each in enumerate(panoramas) if view.same_pixels(each.viewpoint)), None)
    if own is None:
        return _resampled(view, place, draft, parameters)
    pixels, mask = panoramas[own].shown_radiance, panoramas[own].mask
    if gains is not None and not (gains[own] == 1.0).all():
        pixels = pixels * gains[own]
    if mask is None:
        return pixels, np.ones(pixels.shape[:2], np.float32)
    around, alpha = _resampled(view, place, draft, parameters)
    return np.where((mask_feather(mask, place.parameters) == 1.0)[..., None], pixels, around), alpha


def render_shares(view: Viewpoint, place: Place, parameters: FilmParameters = DEFAULT) -> NDArray[np.float32] | None:
    """Share of each photograph in a plate, shape (height, width, k); ``None`` where there is one photograph.

    All are 0 where no photograph sees what the pixel shows.

    Args:
        view: the camera.
        place: the photographs with their geometry.
        parameters: at how many points in each pixel they are looked up.
    """
    points = parameters.share_subpixels
    if len(place.photograph.each) == 1:
        return None
    width, height = view.resolution
    shares = np.empty((height, width, len(place.photograph.each)), np.float32)
    for band in bands(width, height):
        totals = [dr.zeros(mi.Float, dr.width(band.row)) for _ in place.photograph.each]
        dr.make_opaque(totals)
        for i, j in np.ndindex(points, points):
            offset = mi.Point2f((i + 0.5) / points, (j + 0.5) / points)
            dr.make_opaque(offset)
            seen = view.pixel_rays(band.column, band.row, offset, mi.Point2f(0.5))
            hit = place.surfaces.first_real(seen.ray, seen.inside)
            found = place.photograph.shares(hit, seen.ray)
            totals = [total + dr.select(seen.inside, share, 0.0) for total, share in zip(totals, found, strict=True)]
            dr.eval(totals)
        shares[band.rows] = np.stack([total.numpy() for total in totals], axis=-1).reshape(*band.shape, -1)
    return shares / np.float32(points**2)


def _resampled(
    view: Viewpoint, place: Place, draft: bool, parameters: FilmParameters
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """The mean over points in each pixel, and the share of it inside the camera's image."""
    width, height = view.resolution
    subpixels = 1 if draft else _subpixels(view, place, parameters.most_plate_subpixels)
    grid = (np.arange(subpixels) + 0.5) / subpixels
    middle = np.full((subpixels, subpixels), 0.5)
    points = np.stack([*np.meshgrid(grid, grid, indexing="ij"), middle, middle], axis=-1).reshape(-1, 4)
    blurred = view.camera.has_aperture
    if blurred:
        fewest, most = parameters.fewest_lens_points, parameters.most_lens_points
        count = fewest if draft else _lens_points(view, place, fewest, most)
        points = sobol_points(count, 4, seed=0)
    highlights = Highlights(place, len(points), draft, parameters) if Highlights.move(view, place) else None
    plate = np.empty((height, width, 3), np.float32)
    alpha = np.empty((height, width), np.float32)
    for band in bands(width, height):
        total, share = dr.zeros(mi.Color3f, dr.width(band.row)), dr.zeros(mi.Float, dr.width(band.row))
        dr.make_opaque(total, share)  # Literal zeros would need a kernel of their own.
        # Points of the lens that are further apart than a pixel where the photograph is blurred would show as dots.
        margin: mi.Float | float = 1.0
        if blurred:
            radius = _blur(view, place, view.pixel_rays(band.column, band.row, mi.Point2f(0.5), mi.Point2f(0.5)))
            margin = dr.maximum(1.0, radius * float(np.sqrt(np.pi / len(points))))
            dr.eval(margin)
        moved = None if highlights is None else highlights.of_band(band)
        for point in points:
            # Point by point, so that one small kernel serves all of them.
            offset, lens = mi.Point2f(*map(float, point[:2])), mi.Point2f(*map(float, point[2:]))
            dr.make_opaque(offset, lens)
            within = 0.5 + (offset - 0.5) * margin if blurred else offset
            seen = view.pixel_rays(band.column, band.row, within, lens)
            hit = place.surfaces.first_real(seen.ray, seen.inside, coherent=True)
            total += place.photograph.sharp(hit, seen.ray) & seen.inside
            share += dr.select(seen.inside, 1.0, 0.0)
            dr.eval(total, share)
            if moved is not None:
                moved.add(hit, seen)
        scale = 1.0 / len(points)
        plate[band.rows] = (total * scale).numpy().T.reshape(*band.shape, 3)
        if moved is not None:
            plate[band.rows] = np.maximum(plate[band.rows] + moved.change(), 0.0)
        alpha[band.rows] = (share * scale).numpy().reshape(band.shape)
    return plate, alpha


def _blur(view: Viewpoint, place: Place, middle: CameraRays) -> mi.Float:
    """Radius in pixels of the disk over which the lens blurs what rays through its middle meet."""
    hit = place.surfaces.first_real(middle.ray, middle.inside)
    depth = dr.dot(hit.point - middle.ray.o, mi.Vector3f(*view.rotation[:, 1].tolist()))
    return view.camera.blur(dr.select(hit.valid, depth, dr.inf))


def _lens_points(view: Viewpoint, place: Place, fewest: int, most: int) -> int:
    """Points of the lens for each pixel: about one for each pixel of the largest disk that a point is blurred to."""
    x, y = (mi.Float(aligned(grid)) for grid in np.meshgrid(np.linspace(0.05, 0.95, 16), np.linspace(0.05, 0.95, 16)))
    radius = _blur(view, place, view.rays(mi.Point2f(x, y), mi.Point2f(0.5)))
    needed = np.pi * float(np.max(radius.numpy())) ** 2
    return int(np.clip(2 ** np.ceil(np.log2(max(needed, 1.0))), fewest, most))


def _subpixels(view: Viewpoint, place: Place, most: int) -> int:
    """Points along each side of a pixel, so that they lie at most one pixel of the panorama apart."""
    _, height = view.resolution
    x = mi.Float(aligned(np.linspace(0.1, 0.9, 9).repeat(9)))
    y = mi.Float(aligned(np.tile(np.linspace(0.1, 0.9, 9), 9)))
    seen = view.rays(mi.Point2f(x, y), mi.Point2f(0.5))
    beside = view.rays(mi.Point2f(x, y + 1.0 / height), mi.Point2f(0.5))
    angle = float(np.max(dr.norm(seen.ray.d - beside.ray.d).numpy()))
    return int(np.clip(np.ceil(angle * place.photograph.rows / np.pi), 2, most))
