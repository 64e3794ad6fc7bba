"""Sky that a wall hides from the capture point and not from others."""

from dataclasses import replace

import numpy as np
import pytest

from lightdepth.directions import euler_rotation, pixel_directions
from lightdepth.lighting.explained import ExplainedLight
from lightdepth.parameters.place import DEFAULT, PlaceParameters
from lightdepth.place.unseen_sky import sky_map
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


def test_hidden_sky_is_like_the_sky_at_its_elevation(photograph):
    panorama, hidden, directions = photograph
    found = sky_map(panorama.radiance, ~hidden, directions)
    axes = pixel_directions(DEFAULT.sky_map_rows, 2 * DEFAULT.sky_map_rows)
    above = axes[..., 2] > np.sin(np.radians(4.0))
    cell = 3.0 * 0.5 * np.pi / DEFAULT.sky_map_rows  # Half of one, of the steepest channel.
    np.testing.assert_allclose(found[above], gradient(axes)[above], rtol=0.0, atol=cell)


def test_hidden_sky_is_like_the_sky_beside_it():
    """A sky that is ten times as bright in the west; of it and of the east, all is seen but what lies behind a wall."""
    directions = pixel_directions(HEIGHT, 2 * HEIGHT)
    x, _, z = np.moveaxis(directions, -1, 0)
    radiance = np.where(x < 0.0, 10.0, 1.0)[..., None] * np.ones(3, np.float32)
    seen = (z > 0.0) & (np.abs(np.abs(x) - 0.6) < 0.2)
    found = sky_map(radiance.astype(np.float32), seen, directions)
    axes = pixel_directions(DEFAULT.sky_map_rows, 2 * DEFAULT.sky_map_rows)
    for side, wanted in ((-1.0, 10.0), (1.0, 1.0)):
        hidden = (side * axes[..., 0] > 0.85) & (axes[..., 2] > 0.1)
        np.testing.assert_allclose(found[hidden], wanted, rtol=0.1)


def test_a_sun_does_not_spread(photograph):
    panorama, hidden, directions = photograph
    bright = panorama.radiance.copy()
    bright[20, 5] = 1e5  # Nearly 3 degrees wide.
    one, other = (sky_map(each, ~hidden, directions) for each in (panorama.radiance, bright))
    changed = np.abs(other / one - 1.0).max(axis=2)
    assert changed.max() < 3.0
    assert (changed > 0.05).sum() < 30  # Of 4050 cells: its own, and those about it.


def test_the_map_is_as_fine_as_the_parameters_say(photograph):
    panorama, hidden, directions = photograph
    assert sky_map(panorama.radiance, ~hidden, directions, PlaceParameters(sky_map_rows=12)).shape == (12, 24, 3)


def test_without_sky_there_is_none():
    nothing = np.zeros((8, 16), bool)
    assert sky_map(np.ones((8, 16, 3), np.float32), nothing, pixel_directions(8, 16)) is None


def test_a_place_beyond_the_sheet_gets_the_sky_that_the_sheet_hides(photograph):
    """A point that looks past the sheet is lit by the whole sky, of which the photograph shows only a part."""
    panorama, _, _ = photograph
    real = (RealSurface("sheet", screen(), Role.ENVIRONMENT),)
    point, normal = np.array([[0.0, 3.0, 0.5]]), np.array([[0.0, 1.0, 0.0]])
    found = ExplainedLight(panorama, real).irradiance(point, normal, 4096)[0]
    whole = replace(panorama, radiance=gradient(pixel_directions(HEIGHT, 2 * HEIGHT) @ panorama.rotation.T))
    wanted = ExplainedLight(whole, ()).irradiance(point, normal, 4096)[0]
    np.testing.assert_allclose(found, wanted, rtol=0.01)
