"""How much a declared gloss may mirror: no more than the photograph shows.

Of what a glossy surface sends to the capture point, ``S`` is mirrored (theory, eq. 6b) and the rest is diffuse: ``S <= M``
at every point. Where a declared lobe breaks this, the surface would lose more than it sends once an object stands
before what it mirrors.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace

import cv2
import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.cameras import Viewpoint
from lightdepth.kernel.row_bands import bands
from lightdepth.kernel.variables import as_vectors
from lightdepth.parameters.recovery import DEFAULT, RecoveryParameters
from lightdepth.place.photograph import Photograph
from lightdepth.place.place import Place
from lightdepth.place.real_surfaces import RealSurfaces
from lightdepth.place.support_scattering import SpecularLobes
from lightdepth.place.traced_surfaces import RealHit
from lightdepth.recovery.irradiance import estimate_irradiance, estimate_mirrored
from lightdepth.recovery.mesh_components import wind_toward_capture
from lightdepth.scene.identity import digest, place_digest
from lightdepth.scene.meshes.geometry import face_areas, face_normals
from lightdepth.scene.model import Gloss, Scene


def fit_glosses(
    place: Place, surfaces: RealSurfaces, seed: int = 0, parameters: RecoveryParameters = DEFAULT
) -> tuple[Gloss, ...]:
    """The specular lobes with the share of each that the photograph leaves room for, and the albedo beneath.

    Args:
        place: the place before insertion, traced with ``surfaces``.
        surfaces: the real surfaces as modelled.
        seed: of the points and samples.
        parameters: how carefully.
    """
    if not surfaces.glosses:
        return ()
    generator = np.random.default_rng(seed)
    faces = wind_toward_capture(place, surfaces)
    areas, normals = face_areas(surfaces.vertices, faces), face_normals(surfaces.vertices, faces)
    lobes = SpecularLobes(tuple(replace(gloss, scale=1.0) for gloss in surfaces.glosses))
    fitted = []
    for index, declared in enumerate(surfaces.glosses, 1):
        weights = np.where(surfaces.gloss == index, areas, 0.0)
        face = (
            generator.choice(len(faces), parameters.gloss_points, p=weights / weights.sum())
            if weights.any()
            else np.zeros(0, int)
        )
        barycentric = generator.dirichlet((1.0, 1.0, 1.0), len(face))
        points = np.einsum("nk,nkx->nx", barycentric, surfaces.vertices[faces[face]]).astype(np.float32)
        at, facing = (as_vectors(each) for each in (points, normals[face]))
        sees, _, radiance = place.photograph.sight(at, facing)
        seen = sees.numpy() if len(face) else np.zeros(0, bool)
        if not seen.any():
            fitted.append(declared)
            continue
        points, normal, shown = points[seen], normals[face][seen], radiance.numpy().T[seen]
        gloss = np.full(len(points), index, np.uint32)
        mirrored = _weighted_mirrored(place, points, normal, lobes, gloss, generator, parameters)
        irradiance, _ = estimate_irradiance(place, points, normal, generator, parameters.gloss_samples)
        room = (shown / np.maximum(mirrored, 1e-20)).min(axis=1)
        scale = min(1.0, float(np.quantile(room, parameters.gloss_broken)))
        albedo = np.median(np.pi * np.maximum(shown - scale * mirrored, 0.0) / np.maximum(irradiance, 1e-20), axis=0)
        red, green, blue = np.minimum(albedo, 1.0).tolist()
        fitted.append(replace(declared, scale=scale, albedo=(red, green, blue)))
    return tuple(fitted)


def _weighted_mirrored(
    place: Place,
    points: NDArray[np.float32],
    normals: NDArray[np.float32],
    lobes: SpecularLobes,
    gloss: NDArray[np.uint32],
    generator: np.random.Generator,
    parameters: RecoveryParameters,
) -> NDArray[np.float32]:
    """What lobes send to the capture points, weighted like the photographs there, shape (n, 3)."""
    shares = place.photograph.shares_at(*(as_vectors(each) for each in (points, normals)))
    total = np.zeros((len(points), 3), np.float32)
    for photograph, share in zip(place.photograph.each, shares, strict=True):
        capture = photograph.capture
        found = estimate_mirrored(
            place, points, normals, lobes, gloss, generator, parameters.gloss_samples, capture=capture
        )
        total += share[:, None] * found
    return total


def fitted_glosses(
    scene: Scene, surfaces: RealSurfaces, place: Callable[[], Place], parameters: RecoveryParameters
) -> tuple[Gloss, ...]:
    """:func:`fit_glosses`, once for each of the places seen last: checking a scene and preparing it both need them.

    Args:
        scene: what the place belongs to.
        surfaces: its real surfaces as modelled.
        place: makes the place before insertion, where it is needed.
        parameters: how carefully.
    """
    if not surfaces.glosses:
        return ()
    key = digest(place_digest(scene), parameters)
    if key not in _fitted:
        _fitted[key] = fit_glosses(place(), surfaces, parameters=parameters)
        while len(_fitted) > KEPT:
            _fitted.popitem(last=False)
    return _fitted[key]


KEPT = 4
_fitted: OrderedDict[str, tuple[Gloss, ...]] = OrderedDict()


def recover_mirrored(
    place: Place, surfaces: RealSurfaces, seed: int = 0, parameters: RecoveryParameters = DEFAULT
) -> tuple[NDArray[np.float32], ...]:
    """The radiance ``S`` that specular lobes mirror to each capture point, pixel by pixel (eq. 6b).

    In the layout of the panorama, since a lobe mirrors narrow things: at the vertices of the irradiance mesh they would
    be lost.

    Args:
        place: the place before insertion, traced with ``surfaces``.
        surfaces: the real surfaces.
        seed: of the samples.
        parameters: how carefully.

    Returns:
        Shapes (h, 2 h, 3), for :meth:`~lightdepth.place.place.Place.with_mirrored`; empty where nothing is glossy.
    """
    if not surfaces.glosses:
        return ()
    generator = np.random.default_rng(seed)
    return tuple(_mirrored(place, each, surfaces, generator, parameters) for each in place.photograph.each)


def plate_mirrored(
    place: Place, view: Viewpoint, seed: int = 0, parameters: RecoveryParameters = DEFAULT
) -> NDArray[np.float32] | None:
    """The radiance ``S`` that specular lobes mirror to the camera of a plate, over its picture.

    Args:
        place: the place before insertion, whose glosses are known.
        view: the camera.
        seed: of the samples.
        parameters: how carefully.

    Returns:
        Shape (h, w, 3), with at most ``plate_mirrored_height`` rows; ``None`` where nothing is glossy.
    """
    if not place.glosses or place.infinite:
        return None
    width, height = view.resolution
    rows = min(parameters.plate_mirrored_height, height)
    columns = max(1, round(width * rows / height))

    def look(column: mi.Float, row: mi.Float) -> tuple[RealHit, mi.Bool]:
        seen = view.rays(mi.Point2f((column + 0.5) / columns, (row + 0.5) / rows), mi.Point2f(0.5))
        return place.surfaces.first_real(seen.ray, seen.inside), seen.inside

    eye = np.asarray(view.position, np.float64)
    return _image(place, (rows, columns), eye, look, place.glosses, np.random.default_rng(seed), parameters)


def _mirrored(
    place: Place,
    photograph: Photograph,
    surfaces: RealSurfaces,
    generator: np.random.Generator,
    parameters: RecoveryParameters,
) -> NDArray[np.float32]:
    """The same of one photograph."""
    height = min(parameters.mirrored_height, photograph.map.height)

    def look(column: mi.Float, row: mi.Float) -> tuple[RealHit, mi.Bool]:
        return photograph.look((column + 0.5) / (2 * height), (row + 0.5) / height), mi.Bool(True)

    return _image(place, (height, 2 * height), photograph.capture, look, surfaces.glosses, generator, parameters)


def _image(
    place: Place,
    shape: tuple[int, int],
    eye: NDArray[np.float64],
    look: Callable[[mi.Float, mi.Float], tuple[RealHit, mi.Bool]],
    glosses: tuple[Gloss, ...],
    generator: np.random.Generator,
    parameters: RecoveryParameters,
) -> NDArray[np.float32]:
    """What is mirrored toward an eye, in the pixels of an image: what each sees, and whether it is inside."""
    rows, columns = shape
    image = np.zeros((rows, columns, 3), np.float32)
    lobes = SpecularLobes(glosses)
    for band in bands(columns, rows):
        hit, inside = look(band.column, band.row)
        glossy = (inside & hit.valid & (hit.gloss > 0)).numpy()
        normal = dr.mulsign(mi.Vector3f(hit.normal), dr.dot(hit.normal, mi.Vector3f(*eye.tolist()) - hit.point))
        points, normals = (value.numpy().T[glossy] for value in (hit.point, normal))
        gloss = hit.gloss.numpy()[glossy].astype(np.uint32)
        found = np.zeros((len(glossy), 3), np.float32)
        found[glossy] = estimate_mirrored(
            place, points, normals, lobes, gloss, generator, parameters.mirrored_samples, capture=eye
        )
        image[band.rows] = found.reshape(*band.shape, 3)
    weight = (image > 0.0).any(axis=2).astype(np.float32)
    # Neighbours share their noise; beyond the surface's edge the value goes on, for lookups between the two.
    size = (parameters.mirrored_blur, parameters.mirrored_blur)
    return np.asarray(cv2.blur(image, size) / np.maximum(cv2.blur(weight, size), 1e-6)[..., None], np.float32)
