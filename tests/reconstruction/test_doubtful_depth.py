"""Depth images that are not what they should be: another size, one distance, sky without a mark."""

import cv2
import numpy as np
import pytest

from lightdepth.directions import pixel_directions
from lightdepth.errors import InputError, InputWarning
from lightdepth.reconstruction.coverage import measure_coverage
from lightdepth.reconstruction.depth_image import read_depth_image
from lightdepth.reconstruction.floor import Plane, warn_of_height
from lightdepth.reconstruction.from_estimate import surfaces_from_estimate
from lightdepth.reconstruction.pose import Pose
from lightdepth.reconstruction.posed_panorama import PosedPanorama, check_same_size
from tests.reconstruction.test_from_estimate import FILE

LEVEL = Pose(np.array([0.0, 0.0, 1.6]), np.eye(3))


def test_a_size_that_is_no_multiple_is_doubted(pose):
    panorama = PosedPanorama(pose, (0.0, 0.0, 0.0), np.ones((128, 256, 3), np.float32))
    for rows in (32, 64, 128, 512):
        check_same_size(FILE, (rows, 2 * rows), panorama)
    with pytest.warns(InputWarning, match=r"is 200 x 100 pixels, and the panorama 256 x 128"):
        check_same_size(FILE, (100, 200), panorama)


@pytest.mark.parametrize("rows", [(96, 128), (128, 96)])
def test_a_depth_that_is_no_panorama_is_refused(tmp_path, rows):
    cv2.imwrite(str(tmp_path / "depth.png"), np.full(rows, 900, np.uint16))
    with pytest.raises(InputError, match="it must be twice as wide as high"):
        read_depth_image(tmp_path / "depth.png", 0.001)


def test_one_distance_everywhere_is_no_place(tmp_path):
    depth = np.full((16, 32), 2.5)
    depth[:4] = np.inf
    np.save(tmp_path / "depth.npy", depth)
    with pytest.raises(InputError, match=r"all its distances are 2.5 m"):
        read_depth_image(tmp_path / "depth.npy")


def test_much_that_was_not_measured_and_a_mark_for_sky_are_named(tmp_path):
    depth = np.linspace(1.0, 3.0, 16 * 32).reshape(16, 32).astype(np.float32)
    depth[:6] = -1.0
    np.save(tmp_path / "depth.npy", depth)
    with pytest.warns(InputWarning, match=r"31 % of all directions were not measured.*give --sky"):
        read_depth_image(tmp_path / "depth.npy")
    read_depth_image(tmp_path / "depth.npy", sky=True)
    depth[:6] = 1e6  # Millimetres.
    np.save(tmp_path / "depth.npy", depth)
    with pytest.warns(InputWarning, match=r"192 pixels have the same distance, 1000.*--sky-beyond"):
        read_depth_image(tmp_path / "depth.npy", scale=0.001)


@pytest.mark.parametrize(("units", "name"), [(3.281, "feet"), (100.0, "centimetres"), (1000.0, "millimetres")])
def test_a_floor_in_other_units_is_named(units, name):
    floor = Plane(np.array([0.0, 0.0, 1.0]), 1.6 - 1.6 * units, 0.3)
    with pytest.warns(InputWarning, match=rf"1.6 m above the origin; if the file is in {name}, --scale 0.\d+"):
        warn_of_height(FILE, floor, LEVEL)
    for offset in (0.0, -1.0, 0.7):
        warn_of_height(FILE, Plane(floor.normal, offset, 0.3), LEVEL)


def test_sky_in_an_estimate_is_closed_with_a_warning_or_declared():
    """Disparity of open ground with a wall; the sky is 0, as networks give it."""
    directions = pixel_directions(64, 128)
    ground = np.maximum(-directions[..., 2] / 1.6, 0.0)
    wall = np.where(directions[..., 2] < 0.35 * directions[..., 1], directions[..., 1] / 8.0, 0.0)
    disparity = 3.0 * np.maximum(ground, wall)
    with pytest.warns(InputWarning, match=r"means nothing or infinity.*give --sky"):
        surfaces_from_estimate(disparity, LEVEL, 1.6, FILE)
    for sky, beyond in ((True, None), (False, 100.0)):
        unmarked = np.where(disparity > 0.0, disparity, 0.0 if sky else 0.01)
        found = surfaces_from_estimate(unmarked, LEVEL, 1.6, FILE, sky=sky, sky_beyond=beyond).measured
        np.testing.assert_array_equal(found.sky, disparity <= (0.0 if beyond is None else 3.0 / beyond))
        coverage = measure_coverage(found.surfaces, LEVEL, found.sky)
        assert coverage.sky == pytest.approx(1.0 - coverage.hit, abs=2e-3)
        assert 0.3 < coverage.sky < 0.5
        assert np.abs(found.surfaces[0].mesh.vertices[:, 2]).max() < 1e-4
