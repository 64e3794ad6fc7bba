"""What is seen at the pixels besides light: which object, how far, its normal and albedo."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.cameras import Viewpoint
from lightdepth.cameras.viewpoint import CameraRays
from lightdepth.kernel.row_bands import Band, bands
from lightdepth.preparation import Prepared

SUBPIXELS = 2
"""Points along each side of a pixel over which normal and albedo are averaged."""


def render_auxiliary(
    view: Viewpoint, prepared: Prepared
) -> tuple[NDArray[np.uint32], NDArray[np.float32], NDArray[np.float16], NDArray[np.float16]]:
    """Object ids (h, w) and depth (h, w) at pixel centres, mean normal and albedo (h, w, 3) of each pixel.

    The albedo of real surfaces is the photograph held to 1, which is what guides a denoiser best; that of mirrors and
    glass is 1.
    """
    width, height = view.resolution
    object_id = np.empty((height, width), np.uint32)
    depth = np.empty((height, width), np.float32)
    # As the file has them, of half precision and normals plane by plane: of a large image, this counts.
    normal = np.moveaxis(np.empty((3, height, width), np.float16), 0, -1)
    albedo = np.empty((height, width, 3), np.float16)
    for band in bands(width, height):

        def rays(offset: mi.Point2f, band: Band = band) -> CameraRays:
            return view.pixel_rays(band.column, band.row, offset, mi.Point2f(0.5))

        seen = rays(mi.Point2f(0.5))
        found = prepared.surfaces.all.ray_intersect_preliminary(seen.ray, coherent=True, active=seen.inside)
        ids = _object_ids(prepared, found, seen.inside)
        distance = dr.select(seen.inside & found.is_valid(), found.t, dr.inf)
        dr.eval(ids, distance)  # At once: one by one would trace all rays again.
        object_id[band.rows] = ids.numpy().reshape(band.shape)
        depth[band.rows] = distance.numpy().reshape(band.shape)
        mean_normal, mean_albedo = (dr.zeros(kind, dr.width(band.row)) for kind in (mi.Vector3f, mi.Color3f))
        dr.make_opaque(mean_normal, mean_albedo)  # Literal zeros would need a kernel of their own.
        for i in range(SUBPIXELS):
            for j in range(SUBPIXELS):
                # Point by point, so that one small kernel serves all of them.
                offset = mi.Point2f((i + 0.5) / SUBPIXELS, (j + 0.5) / SUBPIXELS)
                dr.make_opaque(offset)
                one_normal, one_albedo = _surface(prepared, rays(offset))
                mean_normal += one_normal
                mean_albedo += one_albedo
                dr.eval(mean_normal, mean_albedo)
        mean_normal *= dr.rsqrt(dr.maximum(dr.squared_norm(mean_normal), 1e-12))
        normal[band.rows] = mean_normal.numpy().T.reshape(*band.shape, 3)
        albedo[band.rows] = (mean_albedo / SUBPIXELS**2).numpy().T.reshape(*band.shape, 3)
    return object_id, depth, normal, albedo


def _object_ids(prepared: Prepared, found: mi.PreliminaryIntersection3f, inside: mi.Bool) -> mi.UInt32:
    """0 for real surfaces and sky, 1 + index of the object for synthetic ones."""
    result = dr.zeros(mi.UInt32, dr.width(found.t))
    for index, shape in prepared.shapes:
        result = dr.select(inside & found.is_valid() & (found.shape == mi.ShapePtr(shape)), index + 1, result)
    return result


def _surface(prepared: Prepared, seen: CameraRays) -> tuple[mi.Vector3f, mi.Color3f]:
    surfaces, place, ray, inside = prepared.surfaces, prepared.place, seen.ray, seen.inside
    found = surfaces.all.ray_intersect_preliminary(ray, coherent=True, active=inside)
    on_real = inside & surfaces.is_real(found)
    on_synthetic = inside & found.is_valid() & ~on_real
    hit = surfaces.real_hit(ray, found, on_real)
    si = found.compute_surface_interaction(ray, mi.RayFlags.All, on_synthetic)
    material = surfaces.materials.number(si, on_synthetic)
    diffuse = surfaces.materials.diffuse_reflectance(material, si, on_synthetic)
    diffuse = dr.select(dr.max(diffuse) > 0.0, dr.minimum(diffuse, 1.0), 1.0)
    normal = dr.select(on_synthetic, si.sh_frame.n, hit.normal & on_real)
    photographed = dr.minimum(place.photograph.sharp(hit, ray.d), 1.0) & inside
    return normal, dr.select(on_synthetic, diffuse, photographed)
