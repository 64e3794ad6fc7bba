"""Sky that a wall hides from the capture point and not from others."""

from dataclasses import replace

import numpy as np
import pytest

from lightdepth.directions import euler_rotation, pixel_directions
from lightdepth.lighting.explained import ExplainedLight
from lightdepth.place.unseen_sky import BANDS, sky_by_elevation
from lightdepth.scene.model import Mesh, Panorama, RealSurface, Role

HEIGHT = 64


def gradient(directions):
    """A sky that brightens toward the zenith; radiance of directions, world."""
    level = np.clip(directions[..., 2:], 0.0, 1.0)
    return (1.0 + level * np.array([1.0, 2.0, 3.0])).astype(np.float32)


def screen():
    """An upright sheet north of the capture point, from the horizon to 45 degrees and 120 degrees wide."""
    corners = np.array([[-2.0, 1.0, 0.0], [2.0, 1.0, 0.0], [2.0, 1.0, 1.0], [-2.0, 1.0, 1.0]], np.float32)
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32))


@pytest.fixture(scope="module")
def photograph():
    """Of a sky with a black sheet before it, by a camera that was turned."""
    rotation = euler_rotation((0.0, 0.0, 40.0))
    directions = pixel_directions(HEIGHT, 2 * HEIGHT) @ rotation.T
    radiance = gradient(directions)
    x, y, z = np.moveaxis(directions, -1, 0)
    ahead = y > 1e-6
    hidden = ahead & (np.abs(x) <= 2.0 * y) & (z >= 0.0) & (z <= y)
    radiance[hidden] = 0.0
    return Panorama(radiance, np.zeros(3), rotation, sky=True), hidden, directions


def test_hidden_sky_has_the_radiance_of_what_is_seen_at_its_elevation(photograph):
    panorama, hidden, directions = photograph
    table = sky_by_elevation(panorama.radiance, ~hidden, directions[..., 2])
    elevation = np.radians(np.linspace(-90.0, 90.0, BANDS))
    above = elevation > np.radians(3.0)
    wanted = gradient(np.stack([0 * elevation, np.cos(elevation), np.sin(elevation)], axis=-1))
    half_a_row = 3.0 * 0.5 * np.pi / HEIGHT  # Of the steepest channel.
    np.testing.assert_allclose(table[above], wanted[above], rtol=0.0, atol=half_a_row)


def test_a_sun_does_not_spread_along_its_elevation(photograph):
    panorama, hidden, directions = photograph
    bright = panorama.radiance.copy()
    bright[20, 5] = 1e5  # Nearly 3 degrees wide.
    one, other = (sky_by_elevation(each, ~hidden, directions[..., 2]) for each in (panorama.radiance, bright))
    np.testing.assert_allclose(one, other, rtol=0.05)


def test_without_sky_there_is_none():
    nothing = np.zeros((8, 16), bool)
    assert sky_by_elevation(np.ones((8, 16, 3), np.float32), nothing, np.zeros((8, 16))) is None


def test_a_place_beyond_the_sheet_gets_the_sky_that_the_sheet_hides(photograph):
    """A point that looks past the sheet is lit by the whole sky, of which the photograph shows only a part."""
    panorama, _, _ = photograph
    real = (RealSurface("sheet", screen(), Role.ENVIRONMENT),)
    point, normal = np.array([[0.0, 3.0, 0.5]]), np.array([[0.0, 1.0, 0.0]])
    found = ExplainedLight(panorama, real).irradiance(point, normal, 4096)[0]
    whole = replace(panorama, radiance=gradient(pixel_directions(HEIGHT, 2 * HEIGHT) @ panorama.rotation.T))
    wanted = ExplainedLight(whole, ()).irradiance(point, normal, 4096)[0]
    np.testing.assert_allclose(found, wanted, rtol=0.01)
