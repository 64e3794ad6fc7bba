"""What is seen at the pixels besides light: which object, how far, its normal and albedo."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.cameras import Viewpoint
from lightdepth.cameras.viewpoint import CameraRays
from lightdepth.film.cryptomatte import Mattes
from lightdepth.kernel.arrays import aligned
from lightdepth.kernel.materials import registered
from lightdepth.kernel.row_bands import Band, bands
from lightdepth.kernel.sobol import sobol_points
from lightdepth.kernel.tracing import first_hit, interaction
from lightdepth.kernel.variables import as_vectors
from lightdepth.parameters.film import DEFAULT, FilmParameters
from lightdepth.preparation import Prepared

EDGES_AT_ONCE = 1 << 15
"""Pixels that show an object's edge at a time, which bounds the memory."""


@dataclass(frozen=True)
class Auxiliary:
    """Layers of a frame other than light.

    Attributes:
        mattes: how much of the pixels objects cover.
        depth: at pixel centres, shape (height, width), float32.
        normal: mean over each pixel, unit, world, shape (height, width, 3), float16.
        albedo: likewise. That of real surfaces is the photograph held to 1, which is what guides a denoiser best; that
            of mirrors and glass is 1.
    """

    mattes: Mattes
    depth: NDArray[np.float32]
    normal: NDArray[np.float16]
    albedo: NDArray[np.float16]


def render_auxiliary(
    view: Viewpoint,
    prepared: Prepared,
    names: tuple[tuple[str, ...], tuple[str, ...]],
    coverage: NDArray[np.float32] | None = None,
    parameters: FilmParameters = DEFAULT,
    picture: NDArray[np.float32] | None = None,
) -> Auxiliary:
    """Render the layers other than light.

    Args:
        view: the camera.
        prepared: the scene.
        names: of the object and of the material of each shape.
        coverage: share of each pixel that objects cover, as far as is known, shape (height, width): where it lies
            between 0 and 1 there is an edge, even if it is of an object that lies between all pixel centres.
        parameters: points in each pixel.
        picture: what the pixels show of the real surfaces, shape (height, width, 3); ``None`` takes the photograph.
    """
    width, height = view.resolution
    subpixels, numbers = parameters.layer_subpixels, _ShapeNumbers(prepared)
    shape = np.empty((height, width), np.uint16)
    edge = np.zeros((height, width), bool) if coverage is None else (coverage > 0.0) & (coverage < 1.0)
    depth = np.empty((height, width), np.float32)
    # As the file has them, of half precision and normals plane by plane: of a large image, this counts.
    normal = np.moveaxis(np.empty((3, height, width), np.float16), 0, -1)
    albedo = np.empty((height, width, 3), np.float16)
    for band in bands(width, height):

        def rays(offset: mi.Point2f, band: Band = band) -> CameraRays:
            return view.pixel_rays(band.column, band.row, offset, mi.Point2f(0.5))

        seen = rays(mi.Point2f(0.5))
        found = first_hit(prepared.surfaces.shown, seen.ray, coherent=True, active=seen.inside)
        middle = numbers.of(found, seen.inside)
        distance = dr.select(seen.inside & found.is_valid(), found.t, dr.inf)
        dr.eval(middle, distance)  # At once: one by one would trace all rays again.
        shown = None if picture is None else mi.Color3f(as_vectors(picture[band.rows].reshape(-1, 3)))
        shape[band.rows] = middle.numpy().reshape(band.shape)
        depth[band.rows] = distance.numpy().reshape(band.shape)
        mean_normal, mean_albedo = dr.zeros(mi.Vector3f, dr.width(band.row)), dr.zeros(mi.Color3f, dr.width(band.row))
        differs = dr.zeros(mi.UInt32, dr.width(band.row))
        # Literal zeros would need a kernel of their own, and so would pixels that the first of the points computes.
        dr.eval(band.row, band.column)
        dr.make_opaque(mean_normal, mean_albedo, differs)
        for i in range(subpixels):
            for j in range(subpixels):
                # Point by point, so that one small kernel serves all of them.
                offset = mi.Point2f((i + 0.5) / subpixels, (j + 0.5) / subpixels)
                dr.make_opaque(offset)
                one_normal, one_albedo, one_shape = _surface(prepared, numbers, rays(offset), shown)
                differs |= one_shape ^ middle
                mean_normal += one_normal
                mean_albedo += one_albedo
                dr.eval(mean_normal, mean_albedo, differs)
        mean_normal *= dr.rsqrt(dr.maximum(dr.squared_norm(mean_normal), 1e-12))
        normal[band.rows] = mean_normal.numpy().T.reshape(*band.shape, 3)
        albedo[band.rows] = (mean_albedo / subpixels**2).numpy().T.reshape(*band.shape, 3)
        edge[band.rows] |= differs.numpy().reshape(band.shape) != 0
    square = np.ones((3, 3), np.uint8)
    edge |= cv2.dilate(shape, square) != cv2.erode(shape, square)
    return Auxiliary(
        Mattes(*_coverage(view, prepared, numbers, shape, edge, parameters.edge_samples), *names), depth, normal, albedo
    )


def _coverage(
    view: Viewpoint,
    prepared: Prepared,
    numbers: _ShapeNumbers,
    shape: NDArray[np.uint16],
    edge: NDArray[np.bool_],
    edge_samples: int,
) -> tuple[NDArray[np.uint32], NDArray[np.uint32], NDArray[np.float32]]:
    """Pixels, indices of shapes and shares, as :class:`Mattes` has them.

    Args:
        view: the camera.
        prepared: the scene.
        numbers: of its shapes.
        shape: 1 + index of the shape in the middle of each pixel, 0 for none, shape (height, width).
        edge: pixels that show several.
        edge_samples: points in each of them.
    """
    inner = np.flatnonzero((shape > 0) & ~edge).astype(np.uint32)
    pixels, shapes = [inner], [shape.reshape(-1)[inner].astype(np.uint32) - 1]
    shares = [np.ones(len(inner), np.float32)]
    # In the pixel and on the lens; each coordinate takes all of its strata.
    points = sobol_points(edge_samples, 4) + 0.5 / edge_samples
    stratified = [mi.Float(aligned(part)) for part in points.T]
    edges = np.flatnonzero(edge).astype(np.uint32)
    width, each = dr.opaque(mi.UInt32, view.resolution[0]), dr.opaque(mi.UInt32, edge_samples)
    for first in range(0, len(edges), EDGES_AT_ONCE):
        some = edges[first : first + EDGES_AT_ONCE]
        lane = dr.arange(mi.UInt32, len(some) * edge_samples)
        pixel = dr.gather(mi.UInt32, mi.UInt32(aligned(some, np.uint32)), lane // each)
        x, y, *lens = (dr.gather(mi.Float, part, lane % each) for part in stratified)
        column, row = mi.Float(pixel % width), mi.Float(pixel // width)
        rays = view.pixel_rays(column, row, mi.Point2f(x, y), mi.Point2f(*lens))
        found = first_hit(prepared.surfaces.shown, rays.ray, coherent=True, active=rays.inside)
        seen = numbers.of(found, rays.inside).numpy().reshape(len(some), edge_samples)
        pairs, count = np.unique((np.arange(len(some))[:, None] << 16) | seen.astype(np.int64), return_counts=True)
        there = (pairs & 0xFFFF) > 0
        pixels.append(some[pairs[there] >> 16])
        shapes.append(((pairs[there] & 0xFFFF) - 1).astype(np.uint32))
        shares.append((count[there] / edge_samples).astype(np.float32))
    order = np.argsort(np.concatenate(pixels), kind="stable")
    return np.concatenate(pixels)[order], np.concatenate(shapes)[order], np.concatenate(shares)[order]


class _ShapeNumbers:
    """Which shapes are met: a table, not a comparison for each of them, so that one program serves all scenes."""

    def __init__(self, prepared: Prepared) -> None:
        places = [registered(mi.ShapePtr(shape)) for _, shape in prepared.shapes]
        table = np.zeros(max(places, default=0) + 1, np.uint32)
        table[places] = np.arange(1, len(places) + 1)
        self._table, self._size = mi.UInt32(aligned(table, np.uint32)), dr.opaque(mi.UInt32, len(table))

    def of(self, found: mi.PreliminaryIntersection3f, inside: mi.Bool) -> mi.UInt32:
        """0 for real surfaces and sky, 1 + index of the shape for synthetic ones."""
        place = dr.reinterpret_array(mi.UInt32, found.shape)
        return dr.gather(mi.UInt32, self._table, place, inside & found.is_valid() & (place < self._size))


def _surface(
    prepared: Prepared, numbers: _ShapeNumbers, seen: CameraRays, shown: mi.Color3f | None
) -> tuple[mi.Vector3f, mi.Color3f, mi.UInt32]:
    surfaces, place, ray, inside = prepared.surfaces, prepared.place, seen.ray, seen.inside
    found = first_hit(surfaces.shown, ray, coherent=True, active=inside)
    on_real = inside & surfaces.is_real(found)
    on_synthetic = inside & found.is_valid() & ~on_real
    hit = surfaces.real_hit(ray, found, on_real)
    si = interaction(surfaces.shown, found, ray, on_synthetic)
    material = surfaces.materials.index(si, on_synthetic)
    diffuse = surfaces.materials.diffuse_reflectance(material, si, on_synthetic)
    diffuse = dr.select(dr.max(diffuse) > 0.0, dr.minimum(diffuse, 1.0), 1.0)
    normal = dr.select(on_synthetic, mi.Vector3f(si.sh_frame.n), hit.normal & on_real)
    photographed = dr.clip(place.photograph.sharp(hit, ray) if shown is None else shown, 0.0, 1.0) & inside
    return normal, dr.select(on_synthetic, diffuse, photographed), numbers.of(found, inside)
