"""Values of refined meshes on grids of larger triangles: nothing is lost, and rays find them."""

from dataclasses import replace

import numpy as np
import pytest

from lightdepth.kernel.start import start

start("cpu")

import drjit as dr  # noqa: E402
import mitsuba as mi  # noqa: E402

from lightdepth.kernel.arrays import aligned_columns  # noqa: E402
from lightdepth.place.real_surfaces import merge_real_surfaces  # noqa: E402
from lightdepth.place.traced_surfaces import TracedSurfaces  # noqa: E402
from lightdepth.recovery.mesh_components import with_refined  # noqa: E402
from lightdepth.recovery.mesh_refinement import RefinedMesh, close_marks, find_edges  # noqa: E402
from lightdepth.recovery.vertex_grids import lay_out  # noqa: E402
from lightdepth.scene.model import Mesh, RealSurface, Role  # noqa: E402

FLOOR = np.float32([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [3.0, 2.0, 0.0], [0.0, 2.0, 0.0]])
HALVES = np.int32([[0, 1, 2], [0, 2, 3]])
SHARP = np.array([1.1, 0.7])
"""Where the floor is refined most."""


def refined(passes):
    """The floor, finer from pass to pass around one place."""
    mesh = RefinedMesh.unrefined(FLOOR, FLOOR, HALVES)
    for number in range(passes):
        edges = find_edges(mesh.faces)
        lengths = mesh.lengths(edges)
        near = np.linalg.norm(mesh.middles(edges, 0.01)[:, :2] - SHARP, axis=1) < 2.0 * 0.6**number
        mesh = mesh.halved(edges, lengths, close_marks(edges, lengths, near | (lengths > 0.9)))
    return mesh


def traced(mesh, values):
    """The floor with values as its irradiance, and the grids."""
    floor = merge_real_surfaces([RealSurface("floor", Mesh(FLOOR, HALVES), Role.SUPPORT)])
    grids = lay_out(mesh)
    everything = np.ones(len(HALVES), bool)
    return TracedSurfaces(with_refined(floor, everything, floor, grids, values)), grids


def looked_up(surfaces, points):
    """What rays from above find at points of shape (n, 3)."""
    x, y, z = aligned_columns(np.float32(points))
    ray = mi.Ray3f(mi.Point3f(mi.Float(x), mi.Float(y), mi.Float(z) + 1.0), mi.Vector3f(0.0, 0.0, -1.0))
    hit = surfaces.first_real(ray, mi.Bool(True))
    assert dr.all(hit.valid)
    return surfaces.irradiance(hit, hit.valid).numpy().T


def inside_faces(mesh, generator):
    """A random point of each face: weights of its corners, shape (m, 3), and the point, shape (m, 3)."""
    weights = generator.dirichlet((2.0, 2.0, 2.0), len(mesh.faces))
    return weights, np.einsum("nk,nkx->nx", weights, mesh.points[mesh.faces].astype(np.float64))


@pytest.mark.parametrize("passes", [0, 1, 3, 6, 9])
def test_what_is_linear_is_found_exactly(passes):
    mesh = refined(passes)
    values = mesh.points @ np.float32([[1.0, 0.2, -0.5], [0.3, 2.0, 0.1], [0.0, 0.0, 0.0]]) + np.float32(1.5)
    surfaces, grids = traced(mesh, values)
    _, points = inside_faces(grids.mesh, np.random.default_rng(passes))
    spread = np.random.default_rng(1).uniform((0.001, 0.001, 0.0), (2.999, 1.999, 0.0), (5000, 3))
    at = np.concatenate([points, spread])
    expected = at @ np.array([[1.0, 0.2, -0.5], [0.3, 2.0, 0.1], [0.0, 0.0, 0.0]]) + 1.5
    np.testing.assert_allclose(looked_up(surfaces, at), expected, rtol=0, atol=1e-5)


@pytest.mark.parametrize("passes", [1, 3, 6, 9])
def test_any_values_are_found_at_the_vertices(passes):
    mesh = refined(passes)
    values = np.random.default_rng(passes).random((len(mesh.points), 3), dtype=np.float32)
    surfaces, _ = traced(mesh, values)
    # A step into a face, so that rays do not run past the floor; it is small against the shortest edge.
    corner = mesh.points[mesh.faces].astype(np.float64)
    toward = corner.mean(axis=1)[:, None]
    shortest = mesh.lengths(find_edges(mesh.faces)).min()
    step = 1e-3 * shortest * (toward - corner) / np.linalg.norm(toward - corner, axis=-1, keepdims=True)
    found = looked_up(surfaces, (corner + step).reshape(-1, 3))
    np.testing.assert_allclose(found, values[mesh.faces].reshape(-1, 3), rtol=0, atol=5e-3)


def test_values_between_vertices_stay_between_theirs():
    mesh = refined(9)
    values = np.random.default_rng(0).random((len(mesh.points), 3), dtype=np.float32)
    surfaces, grids = traced(mesh, values)
    at = np.random.default_rng(1).uniform((0.0, 0.0, 0.0), (3.0, 2.0, 0.0), (20000, 3))
    found = looked_up(surfaces, np.clip(at, 1e-3, [2.999, 1.999, 0.0]))
    assert found.min() > values.min() - 1e-5
    assert found.max() < values.max() + 1e-5
    np.testing.assert_allclose(np.asarray(grids.interpolation.sum(axis=1)).ravel(), 1.0, rtol=1e-6)


def test_triangles_that_rays_meet_are_fewer_and_cover_the_same():
    mesh = refined(9)
    grids = lay_out(mesh)
    assert len(grids.mesh.faces) < 0.5 * len(mesh.faces)
    assert len(grids.first_node) == len(grids.divisions) == len(grids.mesh.faces)

    def area(each):
        corners = each.points[each.faces].astype(np.float64)
        return (
            0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
        )

    assert area(grids.mesh) == pytest.approx(area(mesh), rel=1e-6)


def test_some_faces_alone_keep_their_values():
    mesh = refined(6)
    values = np.random.default_rng(0).random((len(mesh.points), 3), dtype=np.float32)
    surfaces, grids = traced(mesh, values)
    chosen = np.arange(len(grids.mesh.faces)) % 3 == 0
    floor = merge_real_surfaces([RealSurface("floor", Mesh(FLOOR, HALVES), Role.SUPPORT)])
    nothing = replace(floor, faces=floor.faces[:0], kind=floor.kind[:0], gloss=floor.gloss[:0])
    nothing = replace(nothing, divisions=floor.divisions[:0], first_node=floor.first_node[:0])
    nothing = replace(nothing, unseen_albedo=floor.unseen_albedo[:0])
    some = grids.of_faces(chosen)
    part = TracedSurfaces(with_refined(nothing, np.zeros(0, bool), floor, some, values))
    _, points = inside_faces(some.mesh, np.random.default_rng(1))
    np.testing.assert_allclose(looked_up(part, points), looked_up(surfaces, points), rtol=0, atol=1e-5)
