"""Light-depth maps of rooms against their closed forms."""

import numpy as np
import pytest
import trimesh

from lightdepth.directions import pixel_directions
from lightdepth.lightmap.building import build_light_depth_map
from tests.lightmap.rooms import POSITION, ROTATION, box, box_depth, scene, to_mesh


def test_depth_of_a_box():
    made = build_light_depth_map(scene([box()], 64))
    np.testing.assert_allclose(made.depth, box_depth(pixel_directions(64, 128) @ ROTATION.T), rtol=2e-6)


def test_depth_of_a_sphere_around_an_off_centre_point():
    centre, radius = POSITION + np.array([0.7, 0.2, -0.4]), 3.0
    sphere = to_mesh(trimesh.creation.icosphere(subdivisions=6, radius=radius).apply_translation(centre))
    made = build_light_depth_map(scene([sphere], 32))
    offset = POSITION - centre
    along = pixel_directions(32, 64) @ ROTATION.T @ offset
    exact = -along + np.sqrt(along**2 - offset @ offset + radius**2)
    # The chords of the tessellation lie inside the sphere by up to edge^2 / (8 r), about 1e-4 r here.
    np.testing.assert_allclose(made.depth, exact, rtol=2e-4)
    assert (made.depth <= exact * (1 + 1e-6)).all()


def test_what_no_surface_covers_is_sky():
    floor = to_mesh(trimesh.creation.box(bounds=[[-50, -50, -1], [50, 50, 0]]))
    made = build_light_depth_map(scene([floor], 32))
    down = (pixel_directions(32, 64) @ ROTATION.T)[..., 2]
    assert np.isinf(made.depth[down > 0]).all()
    steep = down < -0.1
    np.testing.assert_allclose(made.depth[steep], -POSITION[2] / down[steep], rtol=1e-5)
    assert np.isinf(build_light_depth_map(scene([], 8)).depth).all()


def test_given_depth_is_kept_in_its_own_size():
    depth = box_depth(pixel_directions(32, 64)).astype(np.float32)
    depth[:3] = np.inf
    np.testing.assert_array_equal(build_light_depth_map(scene([box()], 32, depth)).depth, depth, strict=True)


@pytest.mark.parametrize("size", [32, 100, 512])
def test_given_depth_is_resampled(size):
    depth = box_depth(pixel_directions(128, 256)).astype(np.float32)
    exact = box_depth(pixel_directions(size, 2 * size))
    made = build_light_depth_map(scene([], size, depth)).depth
    error = np.abs(made / exact - 1)
    assert np.median(error) < 2e-4
    assert error.max() < 0.03


def test_given_depth_is_not_mixed_across_jumps_and_sky():
    depth = np.full((16, 32), 4.0, np.float32)
    depth[5:9, 3:9], depth[12:, 20:], depth[0, 5] = 1.5, np.inf, 2.0
    made = build_light_depth_map(scene([], 64, depth)).depth
    values, counts = np.unique(made, return_counts=True)
    assert values.tolist() == [1.5, 2.0, 4.0, np.inf]
    np.testing.assert_array_equal(counts, 16 * np.array([24, 1, 512 - 24 - 1 - 48, 48]))


def test_progress_reaches_the_end():
    reported = []
    build_light_depth_map(scene([box()], 64), reported.append)
    assert reported[-1] == 1.0
