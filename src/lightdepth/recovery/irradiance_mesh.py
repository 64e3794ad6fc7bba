"""The irradiance of the place before insertion on a mesh that is refined until it interpolates well.

As the paper stores its scale factor (section 5.4), the irradiance is stored at vertices; the mesh is made as fine as the
shadows and highlights of the place need, wherever new objects may stand: it does not depend on them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lightdepth.parameters.recovery import DEFAULT, RecoveryParameters
from lightdepth.place.place import Place
from lightdepth.place.real_surfaces import RealSurfaces
from lightdepth.recovery.irradiance import estimate_irradiance
from lightdepth.recovery.mesh_refinement import Edges, RefinedMesh, close_marks, find_edges


def estimate_on_mesh(
    place: Place,
    support: RealSurfaces,
    generator: np.random.Generator,
    samples: int,
    tolerance: float,
    parameters: RecoveryParameters = DEFAULT,
    whole_levels: bool = False,
) -> tuple[RefinedMesh, NDArray[np.float32]]:
    """Estimate the irradiance of support at vertices as dense as this needs.

    Args:
        place: the place before insertion.
        support: faces wound toward the capture point; corners share a vertex only where their normals agree.
        generator: source of randomness.
        samples: of each technique at each point, an even number; fewer also refine less, since noise hides deviations.
        tolerance: relative deviation at an edge's middle above which the edge is halved.
        parameters: where refinement ends.
        whole_levels: end before the first level of which not all can be afforded; else its worst faces are refined.

    Returns:
        The refined mesh and the irradiance at its vertices, shape (n, 3), float32, smoothed as far as it is noise.
    """

    def estimate(points: NDArray[np.float32], normals: NDArray[np.float32]) -> tuple[NDArray[np.float32], float]:
        return estimate_irradiance(place, points, normals, generator, samples, parameters)

    mesh = _subdivide_to_length(RefinedMesh.unrefined(support.rest, support.vertices, support.faces), parameters)
    irradiance, noise = estimate(mesh.inside(parameters.inward), mesh.vertex_normals())
    error = np.full(len(mesh.faces), np.inf)
    most = min(parameters.most_vertices, parameters.vertices_a_sample * samples)
    for _ in range(parameters.levels):
        edges = find_edges(mesh.faces)
        lengths = mesh.lengths(edges)
        afforded = len(edges.ends) if whole_levels else most - len(mesh.points)
        candidate = _candidates(edges, error, lengths > 2.0 * parameters.shortest_edge, afforded)
        if not candidate.any() or (whole_levels and np.count_nonzero(candidate) > most - len(mesh.points)):
            break
        normals = mesh.vertex_normals()[edges.ends[:, 0]]
        middles = mesh.middles(edges, parameters.inward)
        marked = close_marks(edges, lengths, candidate)
        at_middle = np.zeros((len(edges.ends), 3), np.float32)
        at_middle[candidate], standard_error = estimate(middles[candidate], normals[candidate])
        deviation = np.zeros(len(edges.ends))
        deviation[candidate] = _deviation(at_middle[candidate], irradiance, edges.ends[candidate], parameters.dark)
        deviation[deviation <= max(tolerance, parameters.noise_tolerance * standard_error)] = 0.0
        # Every middle that was estimated becomes a vertex; only where one was off, the halves are tested in turn.
        missing = marked & ~candidate
        if missing.any():
            at_middle[missing], _ = estimate(middles[missing], normals[missing])
        error = deviation[edges.of_face].max(axis=1)
        mesh = mesh.halved(edges, lengths, marked)
        irradiance = np.concatenate([irradiance, at_middle[marked]])
        error = error[mesh.piece_of]
    return mesh, _smooth(_fill_dark(irradiance, mesh.faces, parameters.dark), mesh.faces, noise)


def estimate_again(
    place: Place,
    mesh: RefinedMesh,
    generator: np.random.Generator,
    samples: int,
    parameters: RecoveryParameters = DEFAULT,
) -> NDArray[np.float32]:
    """The same at the vertices of a mesh that is fine enough, shape (n, 3)."""
    irradiance, noise = estimate_irradiance(
        place, mesh.inside(parameters.inward), mesh.vertex_normals(), generator, samples, parameters
    )
    return _smooth(_fill_dark(irradiance, mesh.faces, parameters.dark), mesh.faces, noise)


def _candidates(
    edges: Edges, error: NDArray[np.float64], long_enough: NDArray[np.bool_], most: int
) -> NDArray[np.bool_]:
    """Which edges to test: those of faces that interpolate badly, the worst first where not all can be afforded.

    Args:
        edges: of the mesh.
        error: of each face, 0 where it interpolates well, shape (m,).
        long_enough: which edges may be halved at all, shape (e,).
        most: how many edges, at most.
    """
    of_edge = np.zeros(len(edges.ends))
    np.maximum.at(of_edge, edges.of_face.reshape(-1), np.repeat(error, 3))
    of_edge[~long_enough] = 0.0
    candidate = of_edge > 0.0
    if np.count_nonzero(candidate) > max(most, 0):
        candidate[:] = False
        candidate[np.argsort(-of_edge, kind="stable")[: max(most, 0)]] = True
    return np.asarray(candidate & (of_edge > 0.0))


def _deviation(
    found: NDArray[np.float32], irradiance: NDArray[np.float32], ends: NDArray[np.int64], dark: float
) -> NDArray[np.float64]:
    """Relative deviation of the irradiance in the middle of edges from interpolation between their ends, shape (e,).

    Args:
        found: irradiance at the middles, shape (e, 3).
        irradiance: at all vertices, shape (n, 3).
        ends: the edges' vertices, shape (e, 2).
        dark: share of the median irradiance that it is relative to at least.
    """
    expected = irradiance[ends].mean(axis=1)
    scale = np.maximum(found.mean(axis=1), dark * np.median(irradiance))
    difference = np.abs(found - expected).max(axis=1)
    # Where all is black, there is nothing to refine; what is lit beside it is above any bound.
    beyond = np.where(difference > 0.0, np.inf, 0.0).astype(difference.dtype)
    return np.divide(difference, scale, out=beyond, where=scale > 0.0).astype(np.float64)


def _subdivide_to_length(mesh: RefinedMesh, parameters: RecoveryParameters) -> RefinedMesh:
    """Halve edges that are longer than a share of the whole until none is left."""
    longest_allowed = parameters.coarsest_edge * float(np.linalg.norm(np.ptp(mesh.points, axis=0)))
    while True:
        edges = find_edges(mesh.faces)
        lengths = mesh.lengths(edges)
        marked = lengths > longest_allowed
        if not marked.any() or len(mesh.points) > parameters.most_vertices // 2:
            return mesh
        mesh = mesh.halved(edges, lengths, close_marks(edges, lengths, marked))


def _fill_dark(irradiance: NDArray[np.float32], faces: NDArray[np.int32], dark: float) -> NDArray[np.float32]:
    """Give vertices that receive nothing (inside furniture, say) the mean of their lit neighbours."""
    luminance = irradiance.mean(axis=1)
    lit = luminance > dark * np.median(luminance[luminance > 0]) if (luminance > 0).any() else luminance > 0
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
