"""Recovering what the support surfaces reflect, from the irradiance at their vertices.

Equation: docs/theory.md, eq. (6): ``rho(p) = pi M(p) / E(p)``. The division happens at every shaded point, with M at
full resolution; only E is stored at vertices, as the paper stores its scale factor (section 5.4).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from lightdepth.kernel.arrays import aligned
from lightdepth.kernel.opaque import opaque_point
from lightdepth.kernel.real_surfaces import FaceKind, RealSurfaces, face_normals
from lightdepth.transport.adaptive_irradiance import DARK, estimate_on_mesh, share_of_view
from lightdepth.transport.bounds import Sphere
from lightdepth.transport.irradiance import estimate_irradiance, estimate_mirrored
from lightdepth.transport.place import Place
from lightdepth.transport.refinement import RefinedMesh
from lightdepth.transport.support import SpecularLobes

CHECK_POINTS = 512
GLOWING = 1.5
"""Ratio ``pi M / E`` above which a support surface is taken to shine by itself."""


@dataclass(frozen=True)
class IrradianceReport:
    """How well the irradiance of the support surfaces is known.

    Attributes:
        vertices: how many vertices carry it.
        mean_error: mean error of the interpolated irradiance at random points of the support, which lie the denser the
            more of the view the objects fill there, relative to the mean irradiance of these points: a ratio point by
            point would be ruled by places under furniture that receive next to nothing.
        largest_error: 95th percentile of the error relative to the irradiance of each point.
    """

    vertices: int
    mean_error: float
    largest_error: float


def recover_irradiance(
    place: Place,
    surfaces: RealSurfaces,
    spheres: Sequence[Sphere],
    generator: np.random.Generator,
    samples: int,
) -> tuple[RealSurfaces, IrradianceReport]:
    """Give the support surfaces the irradiance that the place had, on meshes as fine as this needs.

    Faces are wound so that their normals point to the side that the capture point sees.

    Args:
        place: the place before insertion, traced with ``surfaces``.
        surfaces: the real surfaces as modelled.
        spheres: what encloses the synthetic objects; the meshes are finest near them.
        generator: source of randomness.
        samples: of each technique at each point, an even number; fewer also refine less, since noise hides deviations.

    Returns:
        The real surfaces with refined support and irradiance, and what is known of its accuracy.
    """
    receiving = surfaces.kind != FaceKind.ENVIRONMENT
    if not receiving.any():
        return surfaces, IrradianceReport(0, 0.0, 0.0)
    support = _separate(surfaces, receiving)
    support = replace(support, faces=_wind_toward_capture(place, support))
    mesh, irradiance = estimate_on_mesh(place, support, spheres, generator, samples)
    mirrored = np.zeros_like(irradiance)
    if surfaces.glosses:
        gloss = np.zeros(len(mesh.points), np.uint32)
        gloss[mesh.faces] = support.gloss[mesh.parent][:, None]
        shiny = np.flatnonzero(gloss)
        mirrored[shiny] = estimate_mirrored(
            place,
            mesh.inside()[shiny],
            mesh.vertex_normals()[shiny],
            SpecularLobes(surfaces.glosses),
            gloss[shiny],
            generator,
            samples,
        )
    report = _check(place, mesh, irradiance, spheres, generator, 4 * samples)
    return _merge(surfaces, receiving, support, mesh, irradiance, mirrored), report


def _separate(surfaces: RealSurfaces, chosen: NDArray[np.bool_]) -> RealSurfaces:
    """The chosen faces alone; their corners share a vertex only where position and face normal agree."""
    faces = surfaces.faces[chosen]
    normals = face_normals(surfaces.rest, faces)
    corner = faces.reshape(-1)
    key = np.concatenate(
        [
            np.round(surfaces.vertices[corner] / 1e-5),
            np.round(surfaces.rest[corner] / 1e-5),
            np.round(np.repeat(normals, 3, axis=0) * 1e3),
        ],
        axis=1,
    ).astype(np.int64)
    _, first, inverse = np.unique(key, axis=0, return_index=True, return_inverse=True)
    kept = corner[first]
    return replace(
        surfaces,
        vertices=surfaces.vertices[kept],
        rest=surfaces.rest[kept],
        irradiance=surfaces.irradiance[kept],
        mirrored=surfaces.mirrored[kept],
        faces=inverse.reshape(-1, 3).astype(np.int32),
        kind=surfaces.kind[chosen],
        gloss=surfaces.gloss[chosen],
    )


def _wind_toward_capture(place: Place, surfaces: RealSurfaces) -> NDArray[np.int32]:
    """Wind every connected piece so that most of what the capture point sees of it faces the capture point."""
    faces = surfaces.faces
    centre = surfaces.rest[faces].mean(axis=1)
    normal = face_normals(surfaces.rest, faces)
    offset = centre - place.capture.astype(np.float32)
    distance = np.linalg.norm(offset, axis=1)
    direction = mi.Vector3f(*(mi.Float(aligned(axis)) for axis in (offset / distance[:, None]).T))
    ray = mi.Ray3f(opaque_point(place.capture), direction)
    free = place.surfaces.real.ray_intersect_preliminary(ray, coherent=False).t.numpy() > 0.999 * distance
    twice_area = np.linalg.norm(
        np.cross(
            surfaces.rest[faces[:, 1]] - surfaces.rest[faces[:, 0]],
            surfaces.rest[faces[:, 2]] - surfaces.rest[faces[:, 0]],
        ),
        axis=1,
    )
    facing = -np.sign((normal * offset).sum(axis=1)) * twice_area * np.where(free, 1.0, 1e-6)
    count = len(surfaces.vertices)
    _, same_position = np.unique(np.round(surfaces.vertices / 1e-5).astype(np.int64), axis=0, return_inverse=True)
    merged = same_position.reshape(-1)[faces]
    ones = np.ones(len(faces))
    links = [coo_matrix((ones, (merged[:, 0], merged[:, k])), shape=(count, count)) for k in (1, 2)]
    _, piece_of_vertex = connected_components(links[0] + links[1], directed=False)
    piece = piece_of_vertex[merged[:, 0]]
    turned = np.bincount(piece, weights=facing)[piece] < 0.0
    return np.where(turned[:, None], faces[:, ::-1], faces).astype(np.int32)


def _check(
    place: Place,
    mesh: RefinedMesh,
    irradiance: NDArray[np.float32],
    spheres: Sequence[Sphere],
    generator: np.random.Generator,
    samples: int,
) -> IrradianceReport:
    """Compare the interpolated irradiance with a careful estimate at random points, most of them near objects."""
    points, faces = mesh.points, mesh.faces
    corners = points[faces].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    importance = area * share_of_view(corners.mean(axis=1), spheres)
    face = generator.choice(len(faces), CHECK_POINTS, p=importance / importance.sum())
    weights = generator.dirichlet((1.0, 1.0, 1.0), CHECK_POINTS)
    at = np.einsum("nk,nkx->nx", weights, corners[face]).astype(np.float32)
    truth, noise = estimate_irradiance(place, at, face_normals(points, faces)[face], generator, samples)
    interpolated = np.einsum("nk,nkx->nx", weights, irradiance[faces[face]].astype(np.float64))
    found, wanted = interpolated.mean(axis=1), truth.mean(axis=1).astype(np.float64)
    lit = wanted > DARK * np.median(wanted)
    if not lit.any():
        return IrradianceReport(len(points), 0.0, 0.0)
    found, wanted = found[lit], wanted[lit]
    # The careful estimate's own noise is in the difference as well.
    error = np.sqrt(np.maximum(np.square(found - wanted) - np.square(noise * wanted), 0.0))
    return IrradianceReport(len(points), float(error.sum() / wanted.sum()), float(np.quantile(error / wanted, 0.95)))


def _merge(
    surfaces: RealSurfaces,
    receiving: NDArray[np.bool_],
    support: RealSurfaces,
    mesh: RefinedMesh,
    irradiance: NDArray[np.float32],
    mirrored: NDArray[np.float32],
) -> RealSurfaces:
    """The environment's faces as they were, followed by the refined support."""
    offset = len(surfaces.vertices)
    return replace(
        surfaces,
        vertices=np.concatenate([surfaces.vertices, mesh.vertices]),
        rest=np.concatenate([surfaces.rest, mesh.points]),
        irradiance=np.concatenate([surfaces.irradiance, irradiance]),
        mirrored=np.concatenate([surfaces.mirrored, mirrored]),
        faces=np.concatenate([surfaces.faces[~receiving], mesh.faces + offset]),
        kind=np.concatenate([surfaces.kind[~receiving], support.kind[mesh.parent]]),
        gloss=np.concatenate([surfaces.gloss[~receiving], support.gloss[mesh.parent]]),
    )


def reflectance(radiance: mi.Color3f, irradiance: mi.Color3f, mirrored: mi.Color3f) -> tuple[mi.Color3f, mi.Color3f]:
    """Recovered albedo ``rho`` and the factor on the specular lobe, per channel (theory, eq. 6).

    A ratio a little above 1 is noise of the photograph or the geometry and is clamped; one above ``GLOWING`` in any
    channel means that the surface glows by itself, or that the geometry is wrong: it scatters nothing.

    Args:
        radiance: M at points of support.
        irradiance: E there.
        mirrored: S there, 0 without gloss.
    """
    ratio = dr.pi * dr.maximum(radiance - mirrored, 0.0) / dr.maximum(irradiance, 1e-20)
    glowing = dr.max(ratio) > GLOWING
    specular_scale = dr.minimum(radiance / dr.maximum(mirrored, 1e-20), 1.0)
    return dr.select(glowing, 0.0, dr.minimum(ratio, 1.0)), dr.select(glowing, 0.0, specular_scale)
