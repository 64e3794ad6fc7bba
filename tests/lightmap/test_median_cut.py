"""Median cut: a partition of the sphere into lights of equal energy."""

import numpy as np
import pytest

from lightdepth.directions import latlong_to_direction, pixel_directions, pixel_solid_angles
from lightdepth.errors import InputError
from lightdepth.images.tonemapping import LUMINANCE
from lightdepth.lightmap.median_cut import median_cut
from lightdepth.lightmap.median_cut_picture import draw_median_cut


def smooth_map(height):
    x, y, z = np.moveaxis(pixel_directions(height, 2 * height), -1, 0)
    radiance = np.stack([1.5 + x, 1.2 + 0.5 * y * z, 1.1 + 0.8 * z], axis=-1).astype(np.float32)
    return radiance, (2.0 + 0.5 * np.cos(3 * x)).astype(np.float32)


@pytest.mark.parametrize("count", [1, 2, 16, 37, 256])
def test_the_rectangles_part_the_map(count):
    radiance, depth = smooth_map(64)
    lights = median_cut(radiance, depth, count)
    assert len(lights.power) == count
    covered = np.zeros((64, 128), int)
    for top, bottom, left, right in lights.rectangle:
        covered[top:bottom, left:right] += 1
    assert (covered == 1).all()
    total = (radiance * pixel_solid_angles(64, 128)[:, None, None]).sum(axis=(0, 1))
    np.testing.assert_allclose(lights.power.sum(axis=0), total, rtol=1e-5)
    assert lights.solid_angle.sum() == pytest.approx(4 * np.pi)
    np.testing.assert_allclose(np.linalg.norm(lights.direction, axis=1), 1.0)


def test_powers_of_two_give_nearly_equal_lights():
    radiance, depth = smooth_map(256)
    energy = median_cut(radiance, depth, 64).power @ LUMINANCE
    assert energy.std() < 0.1 * energy.mean()


def test_lights_lie_on_the_surface_seen_there():
    radiance, _ = smooth_map(64)
    directions = pixel_directions(64, 128)
    depth = np.where(directions[..., 2] > 0.3, np.inf, 1.5 / np.abs(directions).max(axis=-1)).astype(
        np.float32
    )  # A cube.
    lights = median_cut(radiance, depth, 32)
    sky = ~np.isfinite(lights.position).all(axis=1)
    assert 4 < sky.sum() < 20
    np.testing.assert_allclose(np.abs(lights.position[~sky]).max(axis=1), 1.5, rtol=0.06)
    rows = lights.as_rows(np.array([1.0, 2.0, 3.0]), np.eye(3))
    assert [row["position"] is None for row in rows] == sky.tolist()
    np.testing.assert_allclose(rows[int(np.argmin(sky))]["position"], [1, 2, 3] + lights.position[~sky][0], atol=1e-4)


def test_a_lamp_takes_the_lights_that_its_energy_deserves():
    radiance, depth = smooth_map(128)
    lamp = pixel_directions(128, 256) @ latlong_to_direction(0.3, 0.4) > np.cos(np.radians(4))
    radiance[lamp] = 500.0
    energy = radiance @ LUMINANCE * pixel_solid_angles(128, 256)[:, None]
    lights = median_cut(radiance, depth, 128)
    near = lights.direction @ latlong_to_direction(0.3, 0.4) > np.cos(np.radians(5))
    assert near.sum() / 128 == pytest.approx(energy[lamp].sum() / energy.sum(), abs=0.1)


def test_irradiance_of_the_lights_converges_to_that_of_the_map():
    radiance, depth = smooth_map(128)
    normals = np.random.default_rng(0).normal(size=(30, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    directions = pixel_directions(128, 256).reshape(-1, 3)
    power = (radiance * pixel_solid_angles(128, 256)[:, None, None]).reshape(-1, 3)
    exact = np.maximum(normals @ directions.T, 0) @ power
    errors = []
    for count in (16, 128, 1024):
        lights = median_cut(radiance, depth, count)
        errors.append(np.abs((np.maximum(normals @ lights.direction.T, 0) @ lights.power) / exact - 1).max())
    assert errors[0] > 3 * errors[1] > 9 * errors[2]
    assert errors[2] < 0.01


def test_darkness_and_single_pixels_are_not_cut():
    radiance = np.zeros((8, 16, 3), np.float32)
    depth = np.ones((8, 16), np.float32)
    assert len(median_cut(radiance, depth, 8).power) == 1
    radiance[3, 5] = 1.0
    lights = median_cut(radiance, depth, 64)
    assert np.count_nonzero(lights.power.sum(axis=1) > 0) == 1
    assert lights.solid_angle.sum() == pytest.approx(4 * np.pi)


def test_wrong_input_is_explained():
    with pytest.raises(InputError, match="number of lights is 0"):
        median_cut(np.zeros((8, 16, 3), np.float32), np.ones((8, 16), np.float32), 0)
    with pytest.raises(InputError, match=r"radiance has shape \(8, 16, 3\), depth \(4, 8\)"):
        median_cut(np.zeros((8, 16, 3), np.float32), np.ones((4, 8), np.float32), 4)


def test_the_picture_shows_lights_and_rectangles():
    radiance, depth = smooth_map(64)
    picture = draw_median_cut(radiance, median_cut(radiance, depth, 16))
    assert picture.shape == (512, 1024, 3)
    blue = (picture == (90, 170, 255)).all(axis=2)
    assert 0.005 < blue.mean() < 0.1
