"""Albedo and light of unseen surfaces: coloured like what is seen of them or near them, lit by the place around them.

Theory, section 1, eq. (1b): ``M = rho E / pi`` where the photograph shows something else that stands before a point.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lightdepth.kernel.variables import as_vectors
from lightdepth.parameters.recovery import DEFAULT, RecoveryParameters
from lightdepth.place.place import Place
from lightdepth.place.real_surfaces import FaceKind, RealSurfaces
from lightdepth.place.traced_surfaces import TracedSurfaces
from lightdepth.recovery.irradiance import estimate_irradiance
from lightdepth.recovery.irradiance_mesh import estimate_again, estimate_on_mesh
from lightdepth.recovery.mesh_components import connected, separate, wind_toward_capture, with_refined
from lightdepth.recovery.vertex_grids import lay_out
from lightdepth.scene.meshes.geometry import face_areas, face_normals


@dataclass(frozen=True)
class SeenPoints:
    """Points of real surfaces that the capture point sees, shapes (n, 3) or (n,).

    Attributes:
        points: world, metres.
        normals: unit, toward the capture point.
        face: which face they lie on.
        area: of the surface that each stands for, square metres.
        radiance: M there.
    """

    points: NDArray[np.float32]
    normals: NDArray[np.float32]
    face: NDArray[np.int64]
    area: NDArray[np.float64]
    radiance: NDArray[np.float32]


def recover_unseen(
    place: Place,
    surfaces: RealSurfaces,
    generator: np.random.Generator,
    samples: int,
    parameters: RecoveryParameters = DEFAULT,
) -> tuple[Place, RealSurfaces]:
    """Give unseen surfaces, occluded from the capture point, an albedo and a first irradiance.

    Support gets its final irradiance later, from the place with these values. Where next to nothing is unseen,
    everything stays as it is.

    Args:
        place: the place before insertion, traced with ``surfaces``.
        surfaces: the real surfaces as modelled, none of them deformed.
        generator: source of randomness; it is left as it was.
        samples: at most, of each technique at each point.
        parameters: how carefully.

    Returns:
        The place with its unseen parts, traced with meshes that carry their irradiance; and the real surfaces to go on
        with, in which unseen environment is refined and carries it, and support is as modelled.
    """
    generator = generator.spawn(1)[0]
    if not _much_unseen(place, surfaces, generator, parameters):
        return place, surfaces
    modelled = replace(surfaces, faces=wind_toward_capture(place, surfaces))
    chosen, seen = _look(place, modelled, generator, parameters)
    if not chosen.any() or not len(seen.points):
        return place, surfaces
    part = separate(modelled, chosen)
    few = min(samples, parameters.unseen_mesh_samples)
    mesh, irradiance = estimate_on_mesh(
        place, part, generator, few, parameters.unseen_tolerance, parameters, whole_levels=True
    )
    samples = min(
        samples // (2 * parameters.unseen_fewer) * 2,
        parameters.unseen_samples,
        max(parameters.unseen_fewest_samples, parameters.unseen_vertex_samples // len(mesh.points) // 2 * 2),
    )
    grids = lay_out(mesh, parameters)
    place = place.with_surfaces(TracedSurfaces(with_refined(modelled, chosen, part, grids, irradiance)))
    index, pieces = np.flatnonzero(chosen), connected(modelled.faces)
    likeness = _likeness(part, pieces[index], seen, pieces[seen.face], parameters)
    for _ in range(parameters.unseen_rounds):
        at_seen, _ = estimate_irradiance(place, seen.points, seen.normals, generator, samples, parameters)
        part = replace(
            part, unseen_albedo=_albedo(part, index, likeness, seen, at_seen, parameters, place.parameters.glowing)
        )
        place = _with_values(place, with_refined(modelled, chosen, part, grids, irradiance))
        irradiance = estimate_again(place, mesh, generator, samples, parameters)
    place = _with_values(place, with_refined(modelled, chosen, part, grids, irradiance))

    albedo = modelled.unseen_albedo.copy()
    albedo[chosen] = part.unseen_albedo
    modelled = replace(modelled, unseen_albedo=albedo)
    environment = ~modelled.scattering
    grids = grids.of_faces(~part.scattering[grids.mesh.parent])
    return place, with_refined(modelled, chosen & environment, part, grids, irradiance)


def _much_unseen(
    place: Place, surfaces: RealSurfaces, generator: np.random.Generator, parameters: RecoveryParameters
) -> bool:
    """Whether enough is unseen to recover it, estimated from a few points: scans have millions of faces."""
    areas = face_areas(surfaces.vertices, surfaces.faces)
    if not areas.any():
        return False
    points, normals, _ = _random_points(
        surfaces, generator.multinomial(parameters.unseen_points, areas / areas.sum()), generator
    )
    _, unseen, _ = place.photograph.sight(as_vectors(points), as_vectors(normals))
    return float(unseen.numpy().mean()) > parameters.unseen_share


def _look(
    place: Place, surfaces: RealSurfaces, generator: np.random.Generator, parameters: RecoveryParameters
) -> tuple[NDArray[np.bool_], SeenPoints]:
    """Which faces have unseen parts, shape (m,), and points of what is seen.

    Args:
        place: the place before insertion.
        surfaces: the real surfaces, wound toward the capture point.
        generator: source of randomness.
        parameters: how many points.
    """
    areas = face_areas(surfaces.vertices, surfaces.faces)
    counts = 1 + (parameters.unseen_points * areas / areas.sum()).astype(np.int64)
    points, normals, face = _random_points(surfaces, counts, generator)
    sees, occluded, radiance = place.photograph.sight(as_vectors(points), as_vectors(normals))
    unseen = occluded.numpy() & (surfaces.kind[face] != FaceKind.RELIT)
    chosen = np.bincount(face[unseen], minlength=len(areas)) > 0
    front = place.photograph.faced(points, normals)
    kept = np.flatnonzero(sees.numpy() & front)
    most = max(parameters.unseen_fewest_seen, parameters.unseen_pairs // max(int(chosen.sum()), 1))
    if len(kept) > most:
        kept = generator.choice(kept, most, replace=False)
    area = (areas / counts)[face[kept]]
    return chosen, SeenPoints(points[kept], normals[kept], face[kept], area, radiance.numpy().T[kept])


def _random_points(
    surfaces: RealSurfaces, counts: NDArray[np.int64], generator: np.random.Generator
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int64]]:
    """Random points on faces, ``counts`` of them on each: points and normals of shape (n, 3), and indices of the faces."""
    face = np.repeat(np.arange(len(counts)), counts)
    weights = generator.dirichlet((1.0, 1.0, 1.0), len(face)).astype(np.float32)
    points = np.einsum("nk,nkx->nx", weights, surfaces.vertices[surfaces.faces[face]])
    return points, face_normals(surfaces.vertices, surfaces.faces[face]), face


def _likeness(
    part: RealSurfaces,
    piece: NDArray[np.int_],
    seen: SeenPoints,
    seen_piece: NDArray[np.int_],
    parameters: RecoveryParameters,
) -> NDArray[np.float32]:
    """How much each seen point counts for the colour of each face, shape (m, n).

    Points in the same plane count most, above all those of the same mesh, then those that face up or down as much; near
    ones count most of all.

    Args:
        part: the faces with unseen parts.
        piece: which connected mesh each is of, shape (m,).
        seen: what the capture point sees.
        seen_piece: the same of these points, shape (n,).
        parameters: what counts as the same plane, and how much.
    """
    centre = part.vertices[part.faces].mean(axis=1, dtype=np.float64)
    normal = face_normals(part.vertices, part.faces).astype(np.float64)
    squared = np.square(centre).sum(axis=1)[:, None] + np.square(seen.points).sum(axis=1) - 2.0 * centre @ seen.points.T
    height = np.abs((centre * normal).sum(axis=1)[:, None] - normal @ seen.points.T)
    same_plane = (height < parameters.same_plane) & (normal @ seen.normals.T > parameters.parallel)
    near = 1.0 / np.square(squared + face_areas(part.vertices, part.faces)[:, None])
    alike = np.exp(-parameters.alike * np.square(normal[:, 2:] - seen.normals[:, 2]))
    in_plane = np.where(piece[:, None] == seen_piece, parameters.same_piece_weight, 1.0) * parameters.same_plane_weight
    return (near * np.where(same_plane, in_plane, alike) * seen.area).astype(np.float32)


def _albedo(
    part: RealSurfaces,
    index: NDArray[np.int64],
    likeness: NDArray[np.float32],
    seen: SeenPoints,
    irradiance: NDArray[np.float32],
    parameters: RecoveryParameters,
    glowing_ratio: float,
) -> NDArray[np.float32]:
    """Albedo of faces where they are unseen, shape (m, 3), eq. (1b); 0 where their own seen part glows.

    Args:
        part: the faces with unseen parts.
        index: of these among all, shape (m,).
        likeness: from :func:`_likeness`.
        seen: what the capture point sees.
        irradiance: at these points, shape (n, 3).
        parameters: bounds, and which share of a face glows.
        glowing_ratio: of ``pi M / E`` above which a point glows.
    """
    glows = (np.pi * seen.radiance > glowing_ratio * irradiance).any(axis=1)
    total = int(max(index.max(), seen.face.max())) + 1
    matte, glowing = (np.bincount(seen.face, seen.area * mask, total)[index] for mask in (~glows, glows))
    lamp = glowing > np.maximum(matte, parameters.glowing_share * face_areas(part.vertices, part.faces))
    sent, received = likeness[:, ~glows] @ seen.radiance[~glows], likeness[:, ~glows] @ irradiance[~glows]
    albedo = np.clip(np.pi * sent / np.maximum(received, 1e-30), parameters.smallest_albedo, parameters.largest_albedo)
    undecided = lamp | (received.max(axis=1) <= 0.0)
    return np.where(undecided[:, None], 0.0, albedo).astype(np.float32)


def _with_values(place: Place, surfaces: RealSurfaces) -> Place:
    """The place with other values on the same meshes."""
    return place.with_surfaces(place.surfaces.with_values(surfaces))
