"""The irradiance of the place before insertion on a mesh that is refined until it interpolates well.

As the paper stores its scale factor (section 5.4), the irradiance is stored at vertices; the mesh is made as fine as its
shadows and highlights need, and finest where synthetic objects are near.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lightdepth.place.object_bounds import Sphere
from lightdepth.place.place import Place
from lightdepth.place.real_surfaces import RealSurfaces
from lightdepth.recovery.irradiance import estimate_irradiance
from lightdepth.recovery.mesh_refinement import RefinedMesh, close_marks, find_edges

INTERPOLATION_TOLERANCE = 0.01
"""Relative deviation at an edge's middle above which the edge is halved, where objects are near."""
NEAR, FAR_TOLERANCE = 0.05, 4.0
"""Below this share of the view that objects fill, the tolerance grows, up to this many times: less depends on it."""
LEVELS = 6
MOST_VERTICES = 40_000
VERTICES_A_SAMPLE = 240
"""Vertices at most for each sample of a point: a quick look is not worth a fine mesh."""
SHORTEST_EDGE = 0.01
"""Metres; shorter edges are not halved."""
COARSEST_EDGE = 1 / 10
"""Longest edge that is accepted unseen, as a share of the support's diagonal."""
DARK = 1e-3
"""Vertices below this share of the median irradiance lie inside something; they take their neighbours' value."""


def estimate_on_mesh(
    place: Place,
    support: RealSurfaces,
    spheres: Sequence[Sphere],
    generator: np.random.Generator,
    samples: int,
) -> tuple[RefinedMesh, NDArray[np.float32]]:
    """Estimate the irradiance of support at vertices as dense as this needs.

    Args:
        place: the place before insertion.
        support: faces wound toward the capture point; corners share a vertex only where their normals agree.
        spheres: what encloses the synthetic objects.
        generator: source of randomness.
        samples: of each technique at each point, an even number; fewer also refine less, since noise hides deviations.

    Returns:
        The refined mesh and the irradiance at its vertices, shape (n, 3), float32, smoothed as far as it is noise.
    """

    def estimate(points: NDArray[np.float32], normals: NDArray[np.float32]) -> tuple[NDArray[np.float32], float]:
        return estimate_irradiance(place, points, normals, generator, samples)

    mesh = _subdivide_to_length(RefinedMesh.unrefined(support.rest, support.vertices, support.faces))
    irradiance, noise = estimate(mesh.inside(), mesh.vertex_normals())
    fresh = np.ones(len(mesh.faces), bool)
    most = min(MOST_VERTICES, VERTICES_A_SAMPLE * samples)
    for _ in range(LEVELS):
        edges = find_edges(mesh.faces)
        lengths = mesh.lengths(edges)
        candidate = np.zeros(len(edges.ends), bool)
        candidate[edges.of_face[fresh].reshape(-1)] = True
        candidate &= lengths > 2.0 * SHORTEST_EDGE
        if not candidate.any() or len(mesh.points) + np.count_nonzero(candidate) > most:
            break
        normals = mesh.vertex_normals()[edges.ends[:, 0]]
        middles = mesh.middles(edges)
        marked = close_marks(edges, lengths, candidate)
        at_middle = np.zeros((len(edges.ends), 3), np.float32)
        at_middle[candidate], error = estimate(middles[candidate], normals[candidate])
        rough = np.zeros(len(edges.ends), bool)
        rough[candidate] = _deviates(
            at_middle[candidate], irradiance, edges.ends[candidate], middles[candidate], error, spheres
        )
        # Every middle that was estimated becomes a vertex; only where one was off, the halves are looked at in turn.
        unknown = marked & ~candidate
        if unknown.any():
            at_middle[unknown], _ = estimate(middles[unknown], normals[unknown])
        goes_on = np.asarray(rough[edges.of_face].any(axis=1))
        mesh = mesh.halved(edges, lengths, marked)
        irradiance = np.concatenate([irradiance, at_middle[marked]])
        fresh = goes_on[mesh.piece_of]
    return mesh, _smooth(_fill_dark(irradiance, mesh.faces), mesh.faces, noise)


def estimate_again(
    place: Place, mesh: RefinedMesh, generator: np.random.Generator, samples: int
) -> NDArray[np.float32]:
    """The same at the vertices of a mesh that is fine enough, shape (n, 3)."""
    irradiance, noise = estimate_irradiance(place, mesh.inside(), mesh.vertex_normals(), generator, samples)
    return _smooth(_fill_dark(irradiance, mesh.faces), mesh.faces, noise)


def _deviates(
    found: NDArray[np.float32],
    irradiance: NDArray[np.float32],
    ends: NDArray[np.int64],
    middles: NDArray[np.float32],
    error: float,
    spheres: Sequence[Sphere],
) -> NDArray[np.bool_]:
    """Where the irradiance in the middle of edges is not what interpolation between their ends gives, shape (e,).

    Args:
        found: irradiance at the middles, shape (e, 3).
        irradiance: at all vertices, shape (n, 3).
        ends: the edges' vertices, shape (e, 2).
        middles: shape (e, 3), world, metres.
        error: relative standard error of ``found``.
        spheres: what encloses the synthetic objects.
    """
    expected = irradiance[ends].mean(axis=1)
    scale = np.maximum(found.mean(axis=1), DARK * np.median(irradiance))
    deviation = np.abs(found - expected).max(axis=1) / scale
    far = np.clip(np.sqrt(NEAR / share_of_view(middles, spheres)), 1.0, FAR_TOLERANCE)
    return np.asarray(deviation > np.maximum(INTERPOLATION_TOLERANCE * far, 2.5 * error))


def _subdivide_to_length(mesh: RefinedMesh) -> RefinedMesh:
    """Halve edges that are longer than a share of the whole until none is left."""
    longest_allowed = COARSEST_EDGE * float(np.linalg.norm(np.ptp(mesh.points, axis=0)))
    while True:
        edges = find_edges(mesh.faces)
        lengths = mesh.lengths(edges)
        marked = lengths > longest_allowed
        if not marked.any() or len(mesh.points) > MOST_VERTICES // 2:
            return mesh
        mesh = mesh.halved(edges, lengths, close_marks(edges, lengths, marked))


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


def share_of_view(points: NDArray, spheres: Sequence[Sphere]) -> NDArray[np.float64]:
    """About the share of the hemisphere that spheres fill, seen from points of shape (n, 3); shape (n,), above 0."""
    share = np.full(len(points), 1e-6)
    for centre, radius in spheres:
        squared = np.sum(np.square(points - centre), axis=1)
        share += np.minimum(1.0, radius**2 / np.maximum(squared, 1e-12))
    return share
