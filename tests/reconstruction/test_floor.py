"""The floor in points and meshes."""

import numpy as np
import pytest
import trimesh

from lightdepth.errors import InputError
from lightdepth.parameters.reconstruction import FloorParameters
from lightdepth.reconstruction.floor import find_floor, split_floor
from lightdepth.scene.model import Mesh


def plane(count, low, high, height, slope=0.0, seed=0):
    random = np.random.default_rng(seed)
    x, y = random.uniform(low, high, (count, 2)).T
    return np.column_stack([x, y, height + slope * x + random.normal(0, 0.01, count)])


def test_the_floor_is_found_below_a_large_table():
    table = plane(9_000, [-2, -2], [2, 2], 0.75, seed=1)
    floor = plane(3_000, [-3, -3], [3, 3], 0.02, slope=0.03, seed=2)
    ceiling = plane(12_000, [-3, -3], [3, 3], 2.5, seed=3)
    walls = np.random.default_rng(4).uniform([-3, -3, 0], [-2.9, 3, 2.5], (9_000, 3))
    found = find_floor(np.concatenate([table, floor, ceiling, walls]), np.array([0.0, 0.0, 1.6]))
    assert found.tilt == pytest.approx(np.degrees(np.arctan(0.03)), abs=0.1)
    np.testing.assert_allclose(found.heights(np.array([[2.0, 0.0, 0.08], [-1.0, 1.0, -0.01]])), 0.0, atol=2e-3)


def test_without_a_floor_the_reason_is_reported():
    wall = np.random.default_rng(5).uniform([-3, 2, 0], [3, 2.01, 2.5], (5_000, 3))
    with pytest.raises(InputError, match=r"no floor found.*axis is up"):
        find_floor(wall, np.array([0.0, 0.0, 1.6]), tuned=FloorParameters(largest_tilt=5.0))


def test_the_floor_is_laid_flat_and_still_meets_the_rest():
    box = trimesh.creation.box(bounds=[[-2, -2, 0], [2, 2, 2]]).subdivide_to_size(0.2)
    vertices = box.vertices + np.random.default_rng(6).normal(0, 0.004, box.vertices.shape)
    found = find_floor(trimesh.sample.sample_surface(box, 20_000, seed=1)[0], np.array([0.0, 0.0, 1.5]))
    floor, rest = split_floor(Mesh(vertices.astype(np.float32), box.faces.astype(np.int32)), found)
    assert np.abs(floor.vertices[:, 2] - found.offset).max() < 2e-3
    assert trimesh.Trimesh(floor.vertices, floor.faces).area == pytest.approx(16.0, rel=0.02)
    both = trimesh.util.concatenate([trimesh.Trimesh(m.vertices, m.faces) for m in (floor, rest)])
    both.merge_vertices()
    assert both.is_watertight
