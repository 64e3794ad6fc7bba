"""The plate: the photograph as a camera sees it, free of noise."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from scipy.stats.qmc import Sobol

from lightdepth.cameras import Equirectangular
from lightdepth.kernel.arrays import aligned
from lightdepth.kernel.bands import bands
from lightdepth.kernel.opaque import opaque_matrix, opaque_point
from lightdepth.scene.model import CameraView, Panorama
from lightdepth.transport.place import Place

MOST_SUBPIXELS = 8
MOST_LENS_POINTS = 256
FEWEST_LENS_POINTS = 64
"""Powers of two, in which Sobol's sequence is even."""


def is_capture_camera(view: CameraView, panorama: Panorama) -> bool:
    """Whether a camera's pixels are those of the panorama."""
    return (
        isinstance(view.camera, Equirectangular)
        and view.camera.resolution == panorama.radiance.shape[1::-1]
        and np.allclose(view.position, panorama.position, rtol=0.0, atol=1e-9)
        and np.allclose(view.rotation, panorama.rotation, rtol=0.0, atol=1e-9)
    )


def render_plate(
    view: CameraView, panorama: Panorama, place: Place, draft: bool = False
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
        A lens with an aperture blurs the photograph as it blurs the objects: the mean is over points of the lens as well.
    """
    width, height = view.camera.resolution
    if is_capture_camera(view, panorama):
        return panorama.radiance, np.ones((height, width), np.float32)
    subpixels = 1 if draft else _subpixels(view, place)
    grid = (np.arange(subpixels) + 0.5) / subpixels
    middle = np.full((subpixels, subpixels), 0.5)
    points = np.stack([*np.meshgrid(grid, grid, indexing="ij"), middle, middle], axis=-1).reshape(-1, 4)
    aperture = float(getattr(view.camera, "aperture", 0.0))
    if aperture > 0.0:
        count = FEWEST_LENS_POINTS if draft else _lens_points(view, place)
        points = Sobol(4, rng=0).random(count)
    plate = np.empty((height, width, 3), np.float32)
    alpha = np.empty((height, width), np.float32)
    origin, rotation = opaque_point(view.position), opaque_matrix(view.rotation)
    for band in bands(width, height):
        total, share = dr.zeros(mi.Color3f, dr.width(band.row)), dr.zeros(mi.Float, dr.width(band.row))
        dr.make_opaque(total, share)  # Literal zeros would need a kernel of their own.
        # Points of the lens that are further apart than a pixel where the photograph is blurred would show as dots.
        spread: mi.Float | float = 1.0
        if aperture > 0.0:
            centre = mi.Point2f((band.column + 0.5) / width, (band.row + 0.5) / height)
            radius = _blur(view, place, centre, origin, rotation)
            spread = dr.maximum(1.0, radius * float(np.sqrt(np.pi / len(points))))
            dr.eval(spread)
        for point in points:
            # Point by point, so that one small kernel serves all of them.
            offset, lens = mi.Point2f(*map(float, point[:2])), mi.Point2f(*map(float, point[2:]))
            dr.make_opaque(offset, lens)
            within = 0.5 + (offset - 0.5) * spread
            film = mi.Point2f((band.column + within.x) / width, (band.row + within.y) / height)
            start, direction, inside = view.camera.camera_rays(film, lens)
            ray = mi.Ray3f(origin + rotation @ start, rotation @ direction)
            hit = place.surfaces.first_real(ray, inside)
            total += place.photograph(hit, ray.d) & inside
            share += dr.select(inside, 1.0, 0.0)
            dr.eval(total, share)
        scale = 1.0 / len(points)
        plate[band.rows] = (total * scale).numpy().T.reshape(*band.shape, 3)
        alpha[band.rows] = (share * scale).numpy().reshape(band.shape)
    return plate, alpha


def _blur(view: CameraView, place: Place, film: mi.Point2f, origin: mi.Point3f, rotation: mi.Matrix3f) -> mi.Float:
    """Radius in pixels of the disk over which a point of what is seen there is spread by the lens."""
    width, _ = view.camera.resolution
    focus = float(getattr(view.camera, "focus_distance", None) or 0.0)
    if focus == 0.0:
        look_at = np.asarray(getattr(view.camera, "look_at", None), np.float64)
        focus = float(np.linalg.norm(look_at - view.position))
    start, direction, inside = view.camera.camera_rays(film, mi.Point2f(0.5))
    hit = place.surfaces.first_real(mi.Ray3f(origin + rotation @ start, rotation @ direction), inside)
    depth = dr.dot(hit.point - origin, rotation @ mi.Vector3f(0.0, 1.0, 0.0))
    nearness = dr.select(hit.valid, dr.rcp(dr.maximum(depth, 1e-3)), 0.0)
    half_width = float(np.tan(np.radians(0.5 * view.camera.fov)))  # type: ignore[attr-defined]
    pixels = 0.5 * width / half_width
    return float(getattr(view.camera, "aperture", 0.0)) * pixels * dr.abs(nearness - 1.0 / focus)


def _lens_points(view: CameraView, place: Place) -> int:
    """Points of the lens for each pixel: about one for each pixel of the largest disk that a point is spread over."""
    x, y = (mi.Float(aligned(grid)) for grid in np.meshgrid(np.linspace(0.05, 0.95, 16), np.linspace(0.05, 0.95, 16)))
    radius = _blur(view, place, mi.Point2f(x, y), opaque_point(view.position), opaque_matrix(view.rotation))
    needed = np.pi * float(np.max(radius.numpy())) ** 2
    return int(np.clip(2 ** np.ceil(np.log2(max(needed, 1.0))), FEWEST_LENS_POINTS, MOST_LENS_POINTS))


def _subpixels(view: CameraView, place: Place) -> int:
    """Points along each side of a pixel, so that they lie at most one pixel of the panorama apart."""
    _, height = view.camera.resolution
    x = mi.Float(aligned(np.linspace(0.1, 0.9, 9).repeat(9)))
    y = mi.Float(aligned(np.tile(np.linspace(0.1, 0.9, 9), 9)))
    _, direction, _ = view.camera.camera_rays(mi.Point2f(x, y), mi.Point2f(0.5))
    _, beside, _ = view.camera.camera_rays(mi.Point2f(x, y + 1.0 / height), mi.Point2f(0.5))
    angle = float(np.max(dr.norm(direction - beside).numpy()))
    return int(np.clip(np.ceil(angle * place.map.height / np.pi), 2, MOST_SUBPIXELS))
