"""Polygons of the plane."""

import numpy as np
import pytest

from lightdepth.reconstruction.polygon import contains, crossing_sides, signed_area, triangulate

L_SHAPE = np.array([[0, 0], [5, 0], [5, 2], [2, 2], [2, 4], [0, 4]], dtype=float)


def star(corners, seed):
    random = np.random.default_rng(seed)
    angles = np.sort(random.uniform(0, 2 * np.pi, corners))
    return random.uniform(0.3, 2.0, corners)[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=-1)


@pytest.mark.parametrize("corners", [L_SHAPE, *(star(n, n) for n in (3, 7, 12, 40))])
def test_triangles_tile_the_polygon(corners):
    triangles = corners[triangulate(corners)]
    areas = np.array([signed_area(triangle) for triangle in triangles])
    assert len(triangles) == len(corners) - 2
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx(signed_area(corners), rel=1e-12)


def test_corners_on_one_line_are_no_obstacle():
    corners = np.array([[0, 0], [1, 0], [2, 0], [2, 1], [2, 2], [1, 2], [0, 2], [0, 1]], dtype=float)
    areas = [signed_area(corners[triangle]) for triangle in triangulate(corners)]
    assert min(areas) > 0
    assert sum(areas) == pytest.approx(4.0)


def test_inside_and_outside():
    assert contains(L_SHAPE, np.array([1.0, 3.0]))
    assert contains(L_SHAPE, np.array([4.0, 1.0]))
    assert not contains(L_SHAPE, np.array([4.0, 3.0]))
    assert contains(L_SHAPE[::-1], np.array([1.0, 3.0]))


def test_crossing_sides_are_found():
    assert crossing_sides(L_SHAPE) is None
    assert crossing_sides(L_SHAPE[[0, 2, 1, 3, 4, 5]]) is not None
