"""Recovering what the support surfaces reflect, from the irradiance at their vertices.

Equation: docs/theory.md, eq. (6): ``rho(p) = pi M(p) / E(p)``. The division happens at every shaded point, with M at
full resolution; only E is stored at vertices, as the paper stores its scale factor (section 5.4).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lightdepth.place.object_bounds import Sphere
from lightdepth.place.place import Place
from lightdepth.place.real_surfaces import RealSurfaces
from lightdepth.recovery.irradiance import estimate_irradiance
from lightdepth.recovery.irradiance_mesh import DARK, estimate_on_mesh, share_of_view
from lightdepth.recovery.mesh_components import separate, wind_toward_capture, with_refined
from lightdepth.recovery.mesh_refinement import RefinedMesh
from lightdepth.recovery.vertex_grids import lay_out
from lightdepth.scene.meshes.geometry import face_areas, face_normals

CHECK_POINTS = 512


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
    receiving = surfaces.receiving
    if not receiving.any():
        return surfaces, IrradianceReport(0, 0.0, 0.0)
    support = separate(surfaces, receiving)
    support = replace(support, faces=wind_toward_capture(place, support))
    mesh, irradiance = estimate_on_mesh(place, support, spheres, generator, samples)
    report = _check(place, mesh, irradiance, spheres, generator, 4 * samples)
    return with_refined(surfaces, receiving, support, lay_out(mesh), irradiance), report


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
    importance = face_areas(points, faces) * share_of_view(corners.mean(axis=1), spheres)
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
