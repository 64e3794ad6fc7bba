"""Meshes from depth images: whole where a surface goes on, open where it does not."""

import numpy as np
import pytest
import trimesh

from lightdepth.directions import pixel_directions
from lightdepth.kernel.raycasting import RayCaster
from lightdepth.lightmap.building import build_light_depth_map
from lightdepth.lightmap.depth_mesh import mesh_from_depth
from lightdepth.parameters import PlaceParameters
from tests.lightmap.rooms import POSITION, ROTATION, box, box_depth, scene, to_mesh


def boundary_edges(mesh):
    edges = np.sort(mesh.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    assert counts.max() == 2
    return int((counts == 1).sum())


def depth_of(meshes, height):
    return build_light_depth_map(scene(meshes, height)).depth


@pytest.mark.parametrize("height", [16, 64, 150])
def test_a_closed_room_gives_a_closed_mesh_that_looks_the_same(height):
    depth = box_depth(pixel_directions(height, 2 * height) @ ROTATION.T).astype(np.float32)
    mesh = mesh_from_depth(depth, POSITION, ROTATION)
    assert boundary_edges(mesh) == 0
    assert len(mesh.faces) == 2 * 2 * height * height
    assert trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).volume < 0  # Faces the capture point.
    directions = pixel_directions(height, 2 * height).reshape(-1, 3) @ ROTATION.T
    check_distances(RayCaster([mesh]).cast(POSITION, directions).distance, depth.ravel(), np.pi / height)


def check_distances(found, exact, pixel):
    """Planes are exact but for the curvature within a tenth of a pixel; creases are off by at most a pixel's angle."""
    error = np.abs(found / exact - 1)
    assert np.median(error) < 0.1 * pixel**2
    assert error.max() < pixel


def test_a_long_corridor_is_not_cut_where_it_is_grazed():
    low, high = np.array([-1.0, -30.0, 0.0]), np.array([1.0, 40.0, 2.5])
    position = np.array([0.2, 0.0, 1.5])
    depth = box_depth(pixel_directions(256, 512) @ ROTATION.T, position, low, high).astype(np.float32)
    mesh = mesh_from_depth(depth, position, ROTATION)
    assert boundary_edges(mesh) <= 0.002 * 512 * 256


def test_an_object_before_a_wall_is_cut_free():
    cube = box([1.5, 0.5, 1.0], [2.0, 1.2, 1.5])
    depth = depth_of([box(), cube], 128)
    mesh = mesh_from_depth(depth, POSITION, ROTATION)
    corners = mesh.vertices[mesh.faces]
    on_cube = ((corners > [1.49, 0.49, 0.99]) & (corners < [2.01, 1.21, 1.51])).all(axis=2)
    assert on_cube.all(axis=1).sum() > 100
    joined = on_cube.any(axis=1) & ~on_cube.all(axis=1)
    assert joined.sum() == 0
    pieces = trimesh.graph.connected_components(
        trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).face_adjacency, min_len=20
    )
    assert len(pieces) == 2


def test_a_table_on_the_floor_stays_joined_to_it_at_its_foot():
    block = box([1.0, 0.2, 0.0], [2.0, 1.0, 0.5])
    depth = depth_of([box(), block], 128)
    mesh = mesh_from_depth(depth, POSITION, ROTATION)
    from_above = RayCaster([mesh]).cast(np.array([[1.5, 0.6, 2.0]]), np.array([[0.0, 0.0, -1.0]]))
    assert from_above.distance[0] == pytest.approx(1.5, abs=0.01)
    behind = RayCaster([mesh]).cast(np.array([[2.15, 0.9, 0.3]]), np.array([[0.0, 0.0, -1.0]]))
    assert np.isinf(behind.distance[0])  # The capture point cannot see there.


def test_noise_of_a_measured_depth_does_not_tear_it():
    depth = box_depth(pixel_directions(128, 256) @ ROTATION.T)
    noisy = (depth * np.random.default_rng(10).normal(1.0, 0.01, depth.shape)).astype(np.float32)
    mesh = mesh_from_depth(noisy, POSITION, ROTATION)
    assert len(mesh.faces) > 0.99 * 4 * 128 * 128


def test_sky_stays_open_and_the_seam_and_the_poles_are_closed():
    depth = np.full((32, 64), 5.0, np.float32)
    depth[:16] = np.inf
    mesh = mesh_from_depth(depth, POSITION, ROTATION)
    assert boundary_edges(mesh) == 64
    assert len(mesh.vertices) == 16 * 64 + 1
    np.testing.assert_allclose(np.linalg.norm(mesh.vertices - POSITION, axis=1), 5.0, rtol=1e-6)
    nothing = mesh_from_depth(np.full((8, 16), np.inf, np.float32), POSITION, ROTATION)
    assert (nothing.vertices.shape, nothing.faces.shape) == ((0, 3), (0, 3))


def test_a_large_image_is_thinned_out():
    depth = box_depth(pixel_directions(300, 600) @ ROTATION.T).astype(np.float32)
    mesh = mesh_from_depth(depth, POSITION, ROTATION, max_width=256)
    assert len(mesh.vertices) == 200 * 100 + 2
    as_tuned = mesh_from_depth(depth, POSITION, ROTATION, tuned=PlaceParameters(depth_width=256))
    np.testing.assert_array_equal(as_tuned.vertices, mesh.vertices)
    offsets = mesh.vertices[1:-1] - POSITION
    distances = np.linalg.norm(offsets, axis=1)
    check_distances(distances, box_depth(offsets / distances[:, None]), np.pi / 100)


def test_a_real_sized_room_with_furniture_has_few_false_holes():
    """Seen from the capture point the mesh must cover what the depth covers, but for a pixel beside each jump."""
    furniture = [
        box([1.5, 0.5, 0.0], [2.5, 1.2, 0.8]),
        to_mesh(trimesh.creation.icosphere(4, 0.5).apply_translation([-1, 1, 1])),
    ]
    depth = depth_of([box(), *furniture], 256)
    mesh = mesh_from_depth(depth, POSITION, ROTATION)
    directions = pixel_directions(256, 512).reshape(-1, 3) @ ROTATION.T
    found = RayCaster([mesh]).cast(POSITION, directions).distance.reshape(depth.shape)
    assert np.isfinite(found).mean() > 0.985
    covered = np.isfinite(found)
    assert np.median(np.abs(found[covered] / depth[covered] - 1)) < 1e-5
