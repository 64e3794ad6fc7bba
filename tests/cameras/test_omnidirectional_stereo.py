"""Omnidirectional stereo against the published formulas, and the disparity that they must give."""

import numpy as np
import pytest

from lightdepth.kernel.start import start

start("cpu")

import mitsuba as mi  # noqa: E402

import lightdepth  # noqa: E402
from lightdepth.cameras import OmnidirectionalStereo, Viewpoint  # noqa: E402
from lightdepth.scene.materials import Diffuse  # noqa: E402
from lightdepth.scene.model import Role  # noqa: E402
from tests.transport.places import CAPTURE, ball, room  # noqa: E402

WIDTH = 96


def eyes(**settings):
    """Origins and unit directions of the left and the right eye at all pixel centres, each (height, width, 3)."""
    camera = OmnidirectionalStereo(type="ods", width=WIDTH, **settings)
    width, height = camera.resolution
    x, y = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    origin, direction, _ = camera.camera_rays(
        mi.Point2f(x.ravel().astype(np.float32), y.ravel().astype(np.float32)), mi.Point2f(0.5)
    )
    rays = [part.numpy().T.reshape(height, width, 3) for part in (origin, direction)]
    return [[part[chart.slices] for part in rays] for chart in camera.topology.charts]


def angles(width):
    """Google's theta and phi: azimuth from the middle and elevation of the pixel centres of one view, radians."""
    azimuth = 2 * np.pi * ((np.arange(width) + 0.5) / width - 0.5)
    elevation = np.pi * (0.5 - (np.arange(width // 2) + 0.5) / (width // 2))
    return np.meshgrid(azimuth, elevation)


@pytest.mark.parametrize(("layout", "width"), [("top-bottom", WIDTH), ("side-by-side", WIDTH // 2)])
def test_rays_are_those_of_googles_formulas(layout, width):
    theta, phi = angles(width)
    for side, (origin, direction) in zip(
        (-1, 1), eyes(layout=layout, zenith_merge=(90, 90), nadir_merge=(90, 90)), strict=True
    ):
        scale = side * 0.064 / 2
        # In Google's frame x is to the right, y up and -z forward.
        expected_origin = np.stack([np.cos(theta) * scale, 0 * theta, np.sin(theta) * scale], axis=-1)
        expected = np.stack([np.sin(theta) * np.cos(phi), np.sin(phi), -np.cos(theta) * np.cos(phi)], axis=-1)
        for found, wanted in ((origin, expected_origin), (direction, expected)):
            np.testing.assert_allclose(found, wanted[..., [0, 2, 1]] * [1, -1, 1], atol=1e-6)


def test_eyes_merge_toward_zenith_and_nadir_as_in_cycles():
    _, elevation = angles(WIDTH)
    degrees = np.degrees(elevation)
    for origin, _ in eyes(zenith_merge=(40, 70), nadir_merge=(10, 80)):
        share = np.linalg.norm(origin, axis=-1) / 0.032
        above = np.cos(np.clip((degrees - 40) / 30, 0, 1) * np.pi / 2)
        below = np.cos(np.clip((-degrees - 10) / 70, 0, 1) * np.pi / 2)
        np.testing.assert_allclose(share, np.where(degrees > 0, above, below), atol=1e-5)


def test_what_is_at_the_convergence_distance_has_no_disparity():
    (left, seen_left), (right, seen_right) = eyes(convergence_distance=1.95)
    # From the middle of the circle the two rays of a pixel cross at this distance, whatever the eyes' distance.
    for origin, direction in ((left, seen_left), (right, seen_right)):
        along = -np.sum(origin * direction, axis=-1) + np.sqrt(
            np.sum(origin * direction, axis=-1) ** 2 + 1.95**2 - np.sum(origin**2, axis=-1)
        )
        crossing = origin + along[..., None] * direction
        theta, phi = angles(WIDTH)
        expected = np.stack([np.sin(theta) * np.cos(phi), np.cos(theta) * np.cos(phi), np.sin(phi)], axis=-1) * 1.95
        np.testing.assert_allclose(crossing, expected, atol=2e-5)


@pytest.mark.parametrize("convergence", [None, 1.0])
def test_disparity_of_a_ball(convergence):
    """The middle of its coverage in both views: 2 asin(r / d) apart, and nothing at the convergence distance."""
    distance, apart = 1.0, 0.3
    thing = ball(Diffuse(type="diffuse", color=(0.2, 0.2, 0.2)), CAPTURE + [0, distance, 0], 0.05)
    scene = room(1.0, [thing], role=Role.ENVIRONMENT)
    camera = OmnidirectionalStereo(type="ods", width=256, interocular_distance=apart, convergence_distance=convergence)
    scene.cameras["stereo"] = Viewpoint(camera, CAPTURE, np.eye(3))
    coverage = lightdepth.render(scene, "stereo", samples=16).coverage
    middles = []
    for chart in camera.topology.charts:
        seen = coverage[chart.slices]
        assert seen.sum() == pytest.approx(13, abs=1)
        middles.append((seen.sum(axis=0) @ (np.arange(256) + 0.5)) / seen.sum())
    left, right = middles
    expected = 2 * np.arcsin(apart / 2 / distance) / (2 * np.pi) * 256 if convergence is None else 0.0
    assert left - right == pytest.approx(expected, abs=0.1)
    assert (left + right) / 2 == pytest.approx(128, abs=0.1)
