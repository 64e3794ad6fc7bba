"""A camera and its pose together."""

import copy

import numpy as np
import pytest

from lightdepth.kernel.start import start

start("cpu")

import mitsuba as mi  # noqa: E402

from lightdepth.cameras import Equirectangular, Perspective, Viewpoint  # noqa: E402
from lightdepth.directions import euler_rotation, pixel_directions  # noqa: E402

POSITION, TURN = np.array([0.4, -1.2, 1.7]), euler_rotation([11.0, -6.0, 75.0])


def test_rays_start_at_the_position_and_turn_with_the_rotation():
    view = Viewpoint(Equirectangular(type="equirectangular", width=32), POSITION, TURN)
    pixel = np.arange(32 * 16)
    column, row = (mi.Float(part.astype(np.float32)) for part in (pixel % 32, pixel // 32))
    seen = view.pixel_rays(column, row, mi.Point2f(0.5), mi.Point2f(0.5))
    np.testing.assert_allclose(seen.ray.o.numpy().ravel(), POSITION, atol=1e-6)
    np.testing.assert_allclose(seen.ray.d.numpy().T, pixel_directions(16, 32).reshape(-1, 3) @ TURN.T, atol=1e-6)
    assert seen.solid_angle.numpy().sum() == pytest.approx(4 * np.pi, rel=0.005)


def test_projection_inverts_rays():
    camera = Perspective(type="perspective", width=40, height=30, fov=60, aperture=0.2, focus_distance=1.5)
    view = Viewpoint(camera, POSITION, TURN)
    generator = np.random.default_rng(4)
    x, y, *lens = generator.uniform(0.02, 0.98, (4, 300)).astype(np.float32)
    seen = view.rays(mi.Point2f(x, y), mi.Point2f(*lens))
    shown = view.project(seen.ray(mi.Float(generator.uniform(0.5, 6.0, 300).astype(np.float32))), mi.Point2f(*lens))
    np.testing.assert_allclose(shown.film.numpy(), [x, y], atol=3e-5)
    np.testing.assert_allclose(shown.origin.numpy(), seen.ray.o.numpy(), atol=1e-6)
    np.testing.assert_allclose(shown.solid_angle.numpy(), seen.solid_angle.numpy(), rtol=1e-3)
    assert shown.inside.numpy().all()


def test_pixels_are_the_same_only_with_camera_and_pose():
    camera = Equirectangular(type="equirectangular", width=32)
    view = Viewpoint(camera, POSITION, TURN)
    posed = camera.model_copy(update={"position": tuple(POSITION)})
    assert view.same_pixels(Viewpoint(posed, POSITION.copy(), TURN.copy()))
    assert not view.same_pixels(Viewpoint(camera, POSITION + 1e-3, TURN))
    assert not view.same_pixels(Viewpoint(camera, POSITION, np.eye(3)))
    assert not view.same_pixels(Viewpoint(Equirectangular(type="equirectangular", width=64), POSITION, TURN))


def test_copies_see_the_same():
    view = Viewpoint(Perspective(type="perspective", width=40, height=30), POSITION, TURN)
    film, lens = mi.Point2f(0.3, 0.6), mi.Point2f(0.5)
    expected = view.rays(film, lens).ray.d.numpy()  # Variables of the device are there now.
    np.testing.assert_array_equal(copy.deepcopy(view).rays(film, lens).ray.d.numpy(), expected)
