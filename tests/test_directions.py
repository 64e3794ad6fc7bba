"""The conventions of light space, which every other file relies on."""

import numpy as np
import pytest

from lightdepth.directions import (
    direction_to_latlong,
    euler_rotation,
    latlong_to_direction,
    look_at_rotation,
    pixel_directions,
    pixel_solid_angles,
    rotation_to_euler,
)
from lightdepth.errors import InputError


def test_centre_looks_along_y_and_columns_grow_toward_x():
    np.testing.assert_allclose(latlong_to_direction(0.5, 0.5), [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(latlong_to_direction(0.75, 0.5), [1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(latlong_to_direction(0.3, 0.0), [0, 0, 1], atol=1e-15)


def test_directions_and_coordinates_are_inverse():
    directions = pixel_directions(16, 32)
    u, v = direction_to_latlong(directions)
    np.testing.assert_allclose(u, np.broadcast_to((np.arange(32) + 0.5) / 32, (16, 32)), atol=1e-14)
    np.testing.assert_allclose(v, np.broadcast_to(((np.arange(16) + 0.5) / 16)[:, None], (16, 32)), atol=1e-14)


def test_solid_angles_cover_the_sphere():
    assert pixel_solid_angles(64, 128).sum() * 128 == pytest.approx(4 * np.pi, rel=1e-14)


def test_euler_angles_turn_about_x_first_then_y_then_z():
    np.testing.assert_allclose(euler_rotation([90, 0, 0]) @ [0, 1, 0], [0, 0, 1], atol=1e-15)
    np.testing.assert_allclose(euler_rotation([90, 0, 90]) @ [1, 0, 0], [0, 1, 0], atol=1e-15)
    np.testing.assert_allclose(euler_rotation([90, 0, 90]) @ [0, 1, 0], [0, 0, 1], atol=1e-15)


@pytest.mark.parametrize("angles", [[10, -20, 30], [170, 80, -170], [0, 90, 25], [0, -90, 25]])
def test_euler_angles_are_recovered(angles):
    rotation = euler_rotation(angles)
    np.testing.assert_allclose(euler_rotation(rotation_to_euler(rotation)), rotation, atol=1e-12)


def test_look_at_keeps_the_horizon():
    rotation = look_at_rotation([1, 1, 1], [4, 5, 1])
    np.testing.assert_allclose(rotation @ [0, 1, 0], [0.6, 0.8, 0], atol=1e-15)
    np.testing.assert_allclose(rotation @ [0, 0, 1], [0, 0, 1], atol=1e-15)
    with pytest.raises(InputError, match="position itself"):
        look_at_rotation([1, 1, 1], [1, 1, 1])
