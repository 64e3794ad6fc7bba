"""Recovering what the support surfaces reflect: irradiance at their vertices, refined until it interpolates well.

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

from lightdepth.kernel.real_surfaces import FaceKind, RealSurfaces, face_normals
from lightdepth.transport.bounds import Sphere
from lightdepth.transport.irradiance import estimate_irradiance, estimate_mirrored
from lightdepth.transport.place import Place
from lightdepth.transport.refinement import close_marks, find_edges, split_edges
from lightdepth.transport.support import SpecularLobes

INTERPOLATION_TOLERANCE = 0.01
"""Relative deviation at an edge's middle above which the edge is halved, where objects are near."""
NEAR, FAR_TOLERANCE = 0.05, 4.0
"""Below this share of the view that objects fill, the tolerance grows, up to this many times: less depends on it."""
LEVELS = 6
MOST_VERTICES = 20_000
SHORTEST_EDGE = 0.01
"""Metres; shorter edges are not halved."""
COARSEST_EDGE = 1 / 10
"""Longest edge that is accepted unseen, as a share of the support's diagonal."""
DARK = 1e-3
"""Vertices below this share of the median irradiance lie inside something; they take their neighbours' value."""
CHECK_POINTS = 256
GLOWING = 1.5
"""Ratio ``pi M / E`` above which a support surface is taken to shine by itself."""


@dataclass(frozen=True)
class IrradianceReport:
    """How well the irradiance of the support surfaces is known.

    Attributes:
        vertices: how many vertices carry it.
        mean_error: mean relative error of the interpolated luminance at random points of the support, which lie the
            denser the more of the view the objects fill there.
        largest_error: 95th percentile of the same.
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
    points, faces, parent = support.rest, support.faces, np.arange(len(support.faces))
    vertices = support.vertices
    points, vertices, faces, parent = _subdivide_to_length(points, vertices, faces, parent)
    normal_of = _vertex_normals(points, faces)
    irradiance, noise = estimate_irradiance(place, _inside(points, faces), normal_of, generator, samples)
    fresh = np.ones(len(faces), bool)
    for _ in range(LEVELS):
        edges = find_edges(faces)
        lengths = np.linalg.norm(points[edges.ends[:, 0]] - points[edges.ends[:, 1]], axis=1).astype(np.float64)
        candidate = np.zeros(len(edges.ends), bool)
        candidate[edges.of_face[fresh].reshape(-1)] = True
        candidate &= lengths > 2.0 * SHORTEST_EDGE
        ends = edges.ends[candidate]
        if not len(ends) or len(points) + len(ends) > MOST_VERTICES:
            break
        middles = points[ends].mean(axis=1).astype(np.float32)
        value, error = estimate_irradiance(place, middles, normal_of[ends[:, 0]], generator, samples)
        expected = irradiance[ends].mean(axis=1)
        scale = np.maximum(value.mean(axis=1), DARK * np.median(irradiance))
        deviation = np.abs(value - expected).max(axis=1) / scale
        tolerance = INTERPOLATION_TOLERANCE * np.clip(
            np.sqrt(NEAR / _share_of_view(middles, spheres)), 1.0, FAR_TOLERANCE
        )
        rough = np.zeros(len(edges.ends), bool)
        rough[candidate] = deviation > np.maximum(tolerance, 2.5 * error)
        # Every middle that was estimated becomes a vertex; only where one was off, the halves are looked at in turn.
        goes_on = np.any(rough[edges.of_face], axis=1, keepdims=True)[:, 0]
        marked = close_marks(edges, lengths, candidate)
        known = np.zeros((len(edges.ends), 3), np.float32)
        known[candidate] = value
        unknown = np.flatnonzero(marked & ~candidate)
        if len(unknown):
            ends = edges.ends[unknown]
            known[unknown], _ = estimate_irradiance(
                place, points[ends].mean(axis=1).astype(np.float32), normal_of[ends[:, 0]], generator, samples
            )
        middle = np.full(len(edges.ends), -1, np.int64)
        middle[marked] = len(points) + np.arange(int(marked.sum()))
        split = edges.ends[marked]
        faces, piece_of = split_edges(faces, edges, lengths, middle)
        fresh = goes_on[piece_of]
        parent = parent[piece_of]
        points = np.concatenate([points, points[split].mean(axis=1).astype(np.float32)])
        vertices = np.concatenate([vertices, vertices[split].mean(axis=1).astype(np.float32)])
        normal_of = np.concatenate([normal_of, normal_of[split[:, 0]]])
        irradiance = np.concatenate([irradiance, known[marked]])
    irradiance = _smooth(_fill_dark(irradiance, faces), faces, noise)
    mirrored = np.zeros_like(irradiance)
    if surfaces.glosses:
        gloss = np.zeros(len(points), np.uint32)
        gloss[faces] = support.gloss[parent][:, None]
        shiny = np.flatnonzero(gloss)
        mirrored[shiny] = estimate_mirrored(
            place,
            _inside(points, faces)[shiny],
            normal_of[shiny],
            SpecularLobes(surfaces.glosses),
            gloss[shiny],
            generator,
            samples,
        )
    report = _check(place, points, faces, irradiance, spheres, generator, 4 * samples)
    return _merge(surfaces, receiving, support, vertices, points, faces, parent, irradiance, mirrored), report


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
    ray = mi.Ray3f(mi.Point3f(place.capture), mi.Vector3f((offset / distance[:, None]).T))
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


def _subdivide_to_length(
    points: NDArray[np.float32], vertices: NDArray[np.float32], faces: NDArray[np.int32], parent: NDArray[np.int64]
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int32], NDArray[np.int64]]:
    """Halve edges that are longer than a share of the whole until none is left."""
    longest_allowed = COARSEST_EDGE * float(np.linalg.norm(np.ptp(points, axis=0)))
    while True:
        edges = find_edges(faces)
        lengths = np.linalg.norm(points[edges.ends[:, 0]] - points[edges.ends[:, 1]], axis=1).astype(np.float64)
        marked = lengths > longest_allowed
        if not marked.any() or len(points) > MOST_VERTICES // 2:
            return points, vertices, faces, parent
        marked = close_marks(edges, lengths, marked)
        middle = np.full(len(edges.ends), -1, np.int64)
        middle[marked] = len(points) + np.arange(int(marked.sum()))
        faces, piece_of = split_edges(faces, edges, lengths, middle)
        parent = parent[piece_of]
        split = edges.ends[marked]
        points = np.concatenate([points, points[split].mean(axis=1).astype(np.float32)])
        vertices = np.concatenate([vertices, vertices[split].mean(axis=1).astype(np.float32)])


def _vertex_normals(points: NDArray[np.float32], faces: NDArray[np.int32]) -> NDArray[np.float32]:
    """Normal at each vertex: that of any of its faces, which agree by construction."""
    normals = np.zeros_like(points)
    for corner in range(3):
        normals[faces[:, corner]] = face_normals(points, faces)
    return normals


def _inside(points: NDArray[np.float32], faces: NDArray[np.int32]) -> NDArray[np.float32]:
    """Vertices moved a little into their faces, so that none lies exactly in the plane of a neighbouring wall."""
    total, count = np.zeros(points.shape), np.zeros(len(points))
    centre = points[faces].mean(axis=1)
    for corner in range(3):
        np.add.at(total, faces[:, corner], centre)
        np.add.at(count, faces[:, corner], 1.0)
    toward = np.where(count[:, None] > 0, total / np.maximum(count, 1)[:, None] - points, 0.0)
    return (points + 0.01 * toward).astype(np.float32)


def _fill_dark(irradiance: NDArray[np.float32], faces: NDArray[np.int32]) -> NDArray[np.float32]:
    """Give vertices that receive nothing (inside furniture, say) the mean of their lit neighbours."""
    luminance = irradiance.mean(axis=1)
    lit = luminance > DARK * np.median(luminance[luminance > 0]) if (luminance > 0).any() else luminance > 0
    filled = irradiance.astype(np.float64)
    ends = find_edges(faces).ends
    both = np.concatenate([ends, ends[:, ::-1]])
    while not lit.all():
        into_dark = both[~lit[both[:, 0]] & lit[both[:, 1]]]
        if not len(into_dark):
            break
        total, count = np.zeros_like(filled), np.zeros(len(filled))
        np.add.at(total, into_dark[:, 0], filled[into_dark[:, 1]])
        np.add.at(count, into_dark[:, 0], 1.0)
        reached = count > 0
        filled[reached] = total[reached] / count[reached, None]
        lit = lit | reached
    return filled.astype(np.float32)


def _smooth(irradiance: NDArray[np.float32], faces: NDArray[np.int32], noise: float) -> NDArray[np.float32]:
    """Average each vertex with its neighbours as far as the estimates' noise explains the difference between them.

    The mesh is so fine that the irradiance is all but linear from vertex to vertex; where it is not, at the edge of a
    shadow, the difference is many times the noise and nothing is averaged.
    """
    ends = find_edges(faces).ends
    first, second = irradiance[ends[:, 0]].astype(np.float64), irradiance[ends[:, 1]].astype(np.float64)
    difference = (first - second).mean(axis=1) / np.maximum((first + second).mean(axis=1), 1e-30)
    weight = np.exp(-0.5 * np.square(difference / max(2.0 * noise, 1e-6)))
    total, weights = irradiance.astype(np.float64), np.ones(len(irradiance))
    for here, there in ((0, 1), (1, 0)):
        np.add.at(total, ends[:, here], weight[:, None] * irradiance[ends[:, there]])
        np.add.at(weights, ends[:, here], weight)
    return (total / weights[:, None]).astype(np.float32)


def _check(
    place: Place,
    points: NDArray[np.float32],
    faces: NDArray[np.int32],
    irradiance: NDArray[np.float32],
    spheres: Sequence[Sphere],
    generator: np.random.Generator,
    samples: int,
) -> IrradianceReport:
    """Compare the interpolated irradiance with a careful estimate at random points, most of them near objects."""
    corners = points[faces].astype(np.float64)
    area = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    importance = area * _share_of_view(corners.mean(axis=1), spheres)
    face = generator.choice(len(faces), CHECK_POINTS, p=importance / importance.sum())
    weights = generator.dirichlet((1.0, 1.0, 1.0), CHECK_POINTS)
    at = np.einsum("nk,nkx->nx", weights, corners[face]).astype(np.float32)
    truth, noise = estimate_irradiance(place, at, face_normals(points, faces)[face], generator, samples)
    interpolated = np.einsum("nk,nkx->nx", weights, irradiance[faces[face]].astype(np.float64))
    bright = truth.mean(axis=1) > DARK * np.median(truth)
    relative = np.abs(interpolated.mean(axis=1) / np.maximum(truth.mean(axis=1), 1e-30) - 1.0)[bright]
    if not len(relative):
        return IrradianceReport(len(points), 0.0, 0.0)
    # The careful estimate's own noise is in the difference as well.
    relative = np.sqrt(np.maximum(relative**2 - noise**2, 0.0))
    return IrradianceReport(len(points), float(relative.mean()), float(np.quantile(relative, 0.95)))


def _share_of_view(points: NDArray, spheres: Sequence[Sphere]) -> NDArray[np.float64]:
    """About the share of the hemisphere that spheres fill, seen from points of shape (n, 3); shape (n,), above 0."""
    share = np.full(len(points), 1e-6)
    for centre, radius in spheres:
        squared = np.sum(np.square(points - centre), axis=1)
        share += np.minimum(1.0, radius**2 / np.maximum(squared, 1e-12))
    return share


def _merge(
    surfaces: RealSurfaces,
    receiving: NDArray[np.bool_],
    support: RealSurfaces,
    vertices: NDArray[np.float32],
    points: NDArray[np.float32],
    faces: NDArray[np.int32],
    parent: NDArray[np.int64],
    irradiance: NDArray[np.float32],
    mirrored: NDArray[np.float32],
) -> RealSurfaces:
    """The environment's faces as they were, followed by the refined support."""
    offset = len(surfaces.vertices)
    return replace(
        surfaces,
        vertices=np.concatenate([surfaces.vertices, vertices]),
        rest=np.concatenate([surfaces.rest, points]),
        irradiance=np.concatenate([surfaces.irradiance, irradiance]),
        mirrored=np.concatenate([surfaces.mirrored, mirrored]),
        faces=np.concatenate([surfaces.faces[~receiving], faces + offset]),
        kind=np.concatenate([surfaces.kind[~receiving], support.kind[parent]]),
        gloss=np.concatenate([surfaces.gloss[~receiving], support.gloss[parent]]),
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
