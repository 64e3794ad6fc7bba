"""Recovering what the support surfaces reflect, from the irradiance at their vertices.

Equation: docs/theory.md, eq. (6): ``rho(p) = pi M(p) / E(p)``. The division happens at every shaded point, with M at
full resolution; only E is stored at vertices, as the paper stores its scale factor (section 5.4).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lightdepth.parameters.recovery import DEFAULT, RecoveryParameters
from lightdepth.place.object_bounds import Sphere
from lightdepth.place.place import Place
from lightdepth.place.real_surfaces import RealSurfaces
from lightdepth.recovery.irradiance import estimate_irradiance
from lightdepth.recovery.irradiance_mesh import estimate_on_mesh
from lightdepth.recovery.mesh_components import separate, wind_toward_capture, with_refined
from lightdepth.recovery.mesh_refinement import RefinedMesh
from lightdepth.recovery.vertex_grids import lay_out
from lightdepth.scene.meshes.geometry import face_areas, face_normals

BARELY_SEEN = 1e-6
"""Share of the view that objects are taken to fill at least, so that points far from all of them count a little."""


@dataclass(frozen=True)
class IrradianceReport:
    """How well the irradiance of the support surfaces is known.

    Attributes:
        vertices: how many vertices carry it.
        mean_error: mean error of the interpolated irradiance at random points of the support, weighted by the share of
            the view that the objects fill there, relative to the mean irradiance of these points: a ratio point by point
            would be dominated by points under furniture that receive next to nothing.
        largest_error: 95th percentile of the error relative to the irradiance of each point.
    """

    vertices: int
    mean_error: float
    largest_error: float


@dataclass(frozen=True)
class IrradianceErrors:
    """Errors of the interpolated irradiance at points distributed evenly over the support.

    Attributes:
        vertices: how many vertices carry the irradiance.
        points: world, metres, shape (n, 3), float32.
        irradiance: mean over the channels, by a careful estimate, shape (n,).
        error: absolute error of the interpolated one, without the careful estimate's own noise, shape (n,).
    """

    vertices: int
    points: NDArray[np.float32]
    irradiance: NDArray[np.float64]
    error: NDArray[np.float64]

    def report(self, spheres: Sequence[Sphere]) -> IrradianceReport:
        """The errors that matter to objects, from spheres that enclose them; without any, those of the whole support."""
        if not len(self.points):
            return IrradianceReport(self.vertices, 0.0, 0.0)
        weight = share_of_view(self.points, spheres)
        relative = self.error / self.irradiance
        order = np.argsort(relative)
        reached = np.cumsum(weight[order]) >= 0.95 * weight.sum()
        return IrradianceReport(
            self.vertices,
            float((weight * self.error).sum() / (weight * self.irradiance).sum()),
            float(relative[order[np.argmax(reached)]]),
        )


def share_of_view(points: NDArray, spheres: Sequence[Sphere]) -> NDArray[np.float64]:
    """About the share of the hemisphere that spheres fill, seen from points of shape (n, 3); shape (n,), above 0."""
    share = np.full(len(points), BARELY_SEEN)
    for centre, radius in spheres:
        squared = np.sum(np.square(points - centre), axis=1)
        share += np.minimum(1.0, radius**2 / np.maximum(squared, 1e-12))
    return share


def recover_irradiance(
    place: Place,
    surfaces: RealSurfaces,
    generator: np.random.Generator,
    samples: int,
    parameters: RecoveryParameters = DEFAULT,
) -> tuple[RealSurfaces, IrradianceErrors]:
    """Give support and glossy surfaces the irradiance that the place had, on meshes as fine as this needs.

    Faces are wound so that their normals point to the side that the capture point sees.

    Args:
        place: the place before insertion, traced with ``surfaces``.
        surfaces: the real surfaces as modelled.
        generator: source of randomness.
        samples: of each technique at each point, an even number; fewer also refine less, since noise hides deviations.
        parameters: how carefully.

    Returns:
        The real surfaces with refined support and irradiance, and the errors of it.
    """
    chosen = surfaces.scattering
    if not chosen.any():
        return surfaces, IrradianceErrors(0, np.zeros((0, 3), np.float32), np.zeros(0), np.zeros(0))
    support = separate(surfaces, chosen)
    support = replace(support, faces=wind_toward_capture(place, support))
    mesh, irradiance = estimate_on_mesh(
        place, support, generator, samples, parameters.interpolation_tolerance, parameters
    )
    errors = _check(place, mesh, irradiance, generator, samples, parameters)
    return with_refined(surfaces, chosen, support, lay_out(mesh, parameters), irradiance), errors


def _check(
    place: Place,
    mesh: RefinedMesh,
    irradiance: NDArray[np.float32],
    generator: np.random.Generator,
    samples: int,
    parameters: RecoveryParameters,
) -> IrradianceErrors:
    """Compare the interpolated irradiance with a careful estimate at random points of the support."""
    points, faces, count = mesh.points, mesh.faces, parameters.check_points
    corners = points[faces].astype(np.float64)
    ends = np.cumsum(face_areas(points, faces))
    steps = (np.arange(count) + generator.random(count)) / count
    face = np.minimum(np.searchsorted(ends, steps * ends[-1], "right"), len(faces) - 1)
    weights = generator.dirichlet((1.0, 1.0, 1.0), count)
    at = np.einsum("nk,nkx->nx", weights, corners[face]).astype(np.float32)
    normals = face_normals(points, faces)[face]
    truth, noise = estimate_irradiance(place, at, normals, generator, parameters.check_samples * samples, parameters)
    interpolated = np.einsum("nk,nkx->nx", weights, irradiance[faces[face]].astype(np.float64))
    found, wanted = interpolated.mean(axis=1), truth.mean(axis=1).astype(np.float64)
    lit = wanted > parameters.dark * np.median(wanted)
    found, wanted = found[lit], wanted[lit]
    # The careful estimate's own noise is in the difference as well.
    error = np.sqrt(np.maximum(np.square(found - wanted) - np.square(noise * wanted), 0.0))
    return IrradianceErrors(len(points), at[lit], wanted, error)
