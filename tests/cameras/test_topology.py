"""Which pixel lies beyond an edge: the one whose ray continues the picture there."""

import numpy as np
import pytest

from lightdepth.kernel.start import start

start("cpu")

import mitsuba as mi  # noqa: E402

from lightdepth.cameras import Equirectangular, Fisheye, Perspective  # noqa: E402
from lightdepth.cameras.topology import Rectangle  # noqa: E402
from lightdepth.directions import pixel_directions  # noqa: E402


def directions_of(camera):
    """Of the rays through all pixel centres, camera space, shape (height, width, 3)."""
    width, height = camera.resolution
    x, y = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    film = mi.Point2f(x.ravel().astype(np.float32), y.ravel().astype(np.float32))
    _, direction, _ = camera.camera_rays(film, mi.Point2f(0.5))
    return direction.numpy().T.reshape(height, width, 3)


def test_a_panorama_goes_on_around_its_seam_and_over_its_poles():
    camera = Equirectangular(type="equirectangular", width=24)
    (chart,) = camera.topology.charts
    window = camera.topology.window(chart, chart, 5)
    found = window.cut(directions_of(camera))
    # The formulas of the projection, taken beyond the film.
    theta = np.pi * (np.arange(-5, 17) + 0.5)[:, None] / 12
    phi = 2 * np.pi * ((np.arange(-5, 29) + 0.5)[None, :] / 24 - 0.5)
    expected = np.stack(
        np.broadcast_arrays(np.sin(theta) * np.sin(phi), np.sin(theta) * np.cos(phi), np.cos(theta)), -1
    )
    np.testing.assert_allclose(found, expected, atol=1e-5)
    np.testing.assert_array_equal(found[window.inner], directions_of(camera))


@pytest.mark.parametrize(
    "camera", [Fisheye(type="fisheye", width=24), Perspective(type="perspective", width=30, height=20)]
)
def test_a_picture_with_edges_ends_there(camera):
    topology = camera.topology
    (chart,) = topology.charts
    image = directions_of(camera)
    np.testing.assert_array_equal(topology.window(chart, chart, 4).cut(image), image)
    window = topology.window(chart, Rectangle(3, 16, 0, 10), 4)
    np.testing.assert_array_equal(window.cut(image), image[:20, :14])
    np.testing.assert_array_equal(window.cut(image)[window.inner], image[3:16, :10])


def test_pixels_of_a_panorama_lie_where_the_photographs_do():
    camera = Equirectangular(type="equirectangular", width=24)
    np.testing.assert_allclose(directions_of(camera), pixel_directions(12, 24), atol=1e-6)
