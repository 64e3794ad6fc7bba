"""Regions of a panorama that reach over its edges."""

import numpy as np
import pytest

from lightdepth.directions import pixel_directions
from lightdepth.regions import connected_regions


@pytest.mark.parametrize("rows", [slice(10, 20), slice(0, 5), slice(28, 32)])
def test_a_disk_is_one_region_wherever_it_lies(rows):
    marked = np.zeros((32, 64), bool)
    marked[rows, :4] = marked[rows, -6:] = True
    regions, count = connected_regions(marked)
    assert count == 1
    np.testing.assert_array_equal(regions > 0, marked)


def test_pixels_meet_at_a_pole():
    marked = np.zeros((32, 64), bool)
    marked[:3, 10:12] = marked[:2, 40:44] = True
    marked[-1, 3] = marked[5:8, 10:12] = marked[20, 20] = True
    regions, count = connected_regions(marked)
    assert count == 4
    assert regions[0, 10] == regions[1, 43] != regions[6, 11]
    assert np.unique(regions).tolist() == [0, 1, 2, 3, 4]


def test_caps_in_every_direction_are_whole():
    directions = pixel_directions(64, 128)
    for toward in np.random.default_rng(1).normal(size=(20, 3)):
        assert connected_regions(directions @ toward > 0.8 * np.linalg.norm(toward))[1] == 1


def test_nothing_marked_is_no_region():
    regions, count = connected_regions(np.zeros((8, 16), bool))
    assert count == 0
    assert not regions.any()
