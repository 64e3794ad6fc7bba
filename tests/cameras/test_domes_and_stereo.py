"""Domes and stereo pairs: which way round they are, the published rays, and the disparity that these must give."""

import numpy as np
import pytest

from lightdepth.kernel.start import start

start("cpu")

import mitsuba as mi  # noqa: E402
from pydantic import ValidationError  # noqa: E402

from lightdepth.cameras import (  # noqa: E402
    VR180,
    DomeMaster,
    DomeStereo,
    OmnidirectionalStereo,
    StereoPerspective,
)

BASE = 0.3
"""Metres between the eyes, so far that a mistake shows."""
MIDDLES = np.array([1.0, 3.0, 5.0, 7.0]) / 8.0


def rays(camera, x, y):
    """Origins, unit directions and inside at positions on the film, of shape (..., 3) and (...)."""
    x, y = np.broadcast_arrays(x, y)
    film = mi.Point2f(x.ravel().astype(np.float32), y.ravel().astype(np.float32))
    origin, direction, inside = camera.camera_rays(film, mi.Point2f(0.5))
    every = np.zeros((x.size, 3))
    origin, direction = ((part.numpy().T + every).reshape(*x.shape, 3) for part in (origin, direction))
    return origin, direction, (inside.numpy() & np.ones(x.size, bool)).reshape(x.shape)


def eyes(camera, x, y):
    """Rays of the left and the right eye through positions on its picture."""
    width, height = camera.resolution
    return [
        rays(camera, (chart.left + x * chart.width) / width, (chart.top + y * chart.height) / height)
        for chart in camera.topology.charts
    ]


def seen_at(camera, centre, radius=0.05, size=900, window=((0.0, 1.0), (0.0, 1.0))):
    """Where each eye shows a ball, from the rays that meet it: the middle on the eye's picture."""
    (x0, x1), (y0, y1) = window
    fractions = (np.arange(size) + 0.5) / size
    x, y = np.meshgrid(x0 + (x1 - x0) * fractions, y0 + (y1 - y0) * fractions)
    found = []
    for origin, direction, inside in eyes(camera, x, y):
        to_centre = np.array(centre) - origin
        along = np.sum(to_centre * direction, axis=-1)
        met = inside & (along > 0) & (np.sum(to_centre**2, axis=-1) - along**2 < radius**2)
        assert met.sum() > 100
        found.append([x[met].mean(), y[met].mean()])
    return np.array(found)


def test_a_dome_master_has_the_front_at_the_bottom_and_is_not_mirrored():
    camera = DomeMaster(type="dome_master", width=64)
    assert camera.resolution == (64, 64)
    near = 0.5 - 1e-6
    _, direction, inside = rays(
        camera, 0.5 + near * np.array([0, 0, 1, -1, 0]), 0.5 + near * np.array([0, 1, 0, 0, -1])
    )
    zenith, front, right, left, back = (0, 0, 1), (0, 1, 0), (1, 0, 0), (-1, 0, 0), (0, -1, 0)
    np.testing.assert_allclose(direction, [zenith, front, right, left, back], atol=1e-5)
    assert inside.all()
    assert not rays(camera, np.array([0.02]), np.array([0.02]))[2].any()


@pytest.mark.parametrize("fov", [160.0, 180.0, 220.0])
@pytest.mark.parametrize("tilt", [0.0, 15.0])
def test_a_dome_master_is_equidistant_around_a_tilted_zenith(fov, tilt):
    camera = DomeMaster(type="dome_master", width=64, fov=fov, tilt=tilt)
    x, y = np.meshgrid((np.arange(64) + 0.5) / 64, (np.arange(64) + 0.5) / 64)
    _, direction, inside = rays(camera, x, y)
    right, front = 2 * x - 1, 2 * y - 1
    radius, azimuth = np.hypot(right, front), np.arctan2(right, front)
    np.testing.assert_array_equal(inside, radius <= 1)
    theta = radius * np.radians(fov) / 2
    level = np.stack([np.sin(theta) * np.sin(azimuth), np.sin(theta) * np.cos(azimuth), np.cos(theta)], axis=-1)
    # The front of the spring line sinks, the zenith of the dome comes forward.
    a = np.radians(tilt)
    turn = np.array([[1, 0, 0], [0, np.cos(a), np.sin(a)], [0, -np.sin(a), np.cos(a)]])
    np.testing.assert_allclose(direction[inside], (level @ turn.T)[inside], atol=2e-6)
    lowest = rays(camera, np.array([0.5]), np.array([1.0 - 1e-6]))[1][0]
    assert np.degrees(np.arcsin(lowest[2])) == pytest.approx(90.0 - fov / 2 - tilt, abs=1e-3)


def test_eyes_in_a_dome_are_beside_each_other_across_each_azimuth():
    """Bourke's: from the dome's axis the eyes are apart at right angles to the azimuth, and look in one direction."""
    settings = {"interocular_distance": BASE, "zenith_merge": (90, 90)}
    camera = DomeStereo(type="dome_stereo", width=64, **settings)
    assert camera.resolution == (64, 128)
    x, y = np.meshgrid(MIDDLES, MIDDLES)
    _, middle, _ = rays(DomeMaster(type="dome_master", width=64), x, y)
    (left, seen_left, _), (right, seen_right, _) = eyes(camera, x, y)
    np.testing.assert_allclose(seen_left, middle, atol=1e-6)
    np.testing.assert_allclose(seen_right, middle, atol=1e-6)
    horizontal = middle[..., :2] / np.linalg.norm(middle[..., :2], axis=-1, keepdims=True)
    to_the_right = np.stack([horizontal[..., 1], -horizontal[..., 0], 0 * horizontal[..., 0]], axis=-1)
    np.testing.assert_allclose(right, 0.5 * BASE * to_the_right, atol=1e-6)
    np.testing.assert_allclose(left, -0.5 * BASE * to_the_right, atol=1e-6)


def test_eyes_in_a_dome_merge_toward_the_zenith_and_turn_with_its_tilt():
    straight, tilted = (DomeStereo(type="dome_stereo", width=64, tilt=tilt) for tilt in (0, 20))
    x, y = np.meshgrid(MIDDLES, MIDDLES)
    a = np.radians(20)
    turn = np.array([[1, 0, 0], [0, np.cos(a), np.sin(a)], [0, -np.sin(a), np.cos(a)]])
    for (origin, direction, _), (turned, looking, _) in zip(eyes(straight, x, y), eyes(tilted, x, y), strict=True):
        np.testing.assert_allclose(turned, origin @ turn.T, atol=1e-6)
        np.testing.assert_allclose(looking, direction @ turn.T, atol=1e-6)
        elevation = np.degrees(np.arcsin(direction[..., 2]))
        share = np.cos(np.clip((elevation - 60) / 15, 0, 1) * np.pi / 2)
        np.testing.assert_allclose(np.linalg.norm(origin, axis=-1), 0.032 * share, atol=1e-5)


@pytest.mark.parametrize(("azimuth", "elevation"), [(0.0, 0.0), (70.0, 40.0), (200.0, 20.0)])
def test_disparity_of_a_ball_in_a_dome(azimuth, elevation):
    """In azimuth, 2 asin(r / h) at the distance h from the dome's axis."""
    distance = 1.5
    camera = DomeStereo(
        type="dome_stereo", width=64, fov=200, interocular_distance=BASE, zenith_merge=(90, 90), layout="top-bottom"
    )
    phi, e = np.radians([azimuth, elevation])
    beside = distance * np.cos(e)
    centre = [beside * np.sin(phi), beside * np.cos(phi), distance * np.sin(e)]
    left, right = 2 * seen_at(camera, centre, radius=0.04) - 1
    angles = [np.arctan2(*place) for place in (left, right)]
    middle = np.angle(np.exp(1j * (np.mean(np.unwrap(angles)) - phi)))
    assert middle == pytest.approx(0.0, abs=2e-3)
    assert np.diff(np.unwrap(angles))[0] == pytest.approx(-2 * np.arcsin(BASE / 2 / beside), abs=4e-3)


def test_vr180_is_the_middle_half_of_a_panorama_for_each_eye():
    camera = VR180(type="vr180", width=128, interocular_distance=BASE)
    assert camera.resolution == (128, 64)
    x, y = np.meshgrid(MIDDLES, MIDDLES)
    azimuth, elevation = np.pi * (x - 0.5), np.pi * (0.5 - y)
    expected = np.stack(
        [np.sin(azimuth) * np.cos(elevation), np.cos(azimuth) * np.cos(elevation), np.sin(elevation)], axis=-1
    )
    for side, (origin, direction, inside) in zip((-1, 1), eyes(camera, x, y), strict=True):
        np.testing.assert_allclose(direction, expected, atol=1e-6)
        np.testing.assert_allclose(origin, np.broadcast_to([side * BASE / 2, 0, 0], origin.shape), atol=1e-7)
        assert inside.all()


@pytest.mark.parametrize("distance", [0.8, 2.0])
def test_disparity_of_a_ball_in_vr180(distance):
    """In azimuth, 2 atan(r / d) straight ahead."""
    camera = VR180(type="vr180", width=64, interocular_distance=BASE, layout="top-bottom")
    left, right = seen_at(camera, [0, distance, 0], window=((0.2, 0.8), (0.4, 0.6)))
    assert (left[0] - right[0]) * np.pi == pytest.approx(2 * np.arctan(BASE / 2 / distance), abs=1e-3)
    assert (left[0] + right[0]) / 2 == pytest.approx(0.5, abs=5e-4)
    np.testing.assert_allclose([left[1], right[1]], 0.5, atol=5e-4)


@pytest.mark.parametrize("convergence", [None, 2.0])
@pytest.mark.parametrize("distance", [1.0, 2.0, 5.0])
def test_disparity_of_a_ball_on_a_screen(convergence, distance):
    """b (1/d - 1/c) / (2 tan(fov / 2)) of the width, to either side of the middle; nothing vertical."""
    camera = StereoPerspective(
        type="stereo_perspective",
        width=64,
        height=32,
        fov=70,
        interocular_distance=BASE,
        convergence_distance=convergence,
    )
    left, right = seen_at(camera, [0, distance, 0.2], radius=0.03, window=((0.2, 0.8), (0.1, 0.6)))
    nearness = 1 / distance - (0 if convergence is None else 1 / convergence)
    expected = BASE * nearness / (2 * np.tan(np.radians(35)))
    # A ball beside the axis is seen as an ellipse whose middle is a little farther out.
    assert left[0] - right[0] == pytest.approx(expected, abs=6e-4)
    assert left[1] == pytest.approx(right[1], abs=3e-4)
    assert (left[0] + right[0]) / 2 == pytest.approx(0.5, abs=5e-4)


def test_a_stereo_pair_is_two_shifted_cameras():
    """The origins are apart along x, and the rays through one place of both pictures meet at the convergence distance."""
    settings = {"interocular_distance": BASE, "convergence_distance": 1.7, "shift": (0.1, 0.05)}
    camera = StereoPerspective(type="stereo_perspective", width=64, height=32, **settings)
    x, y = np.meshgrid(MIDDLES, MIDDLES)
    meeting = []
    for side, (origin, direction, _) in zip((-1, 1), eyes(camera, x, y), strict=True):
        np.testing.assert_allclose(origin, np.broadcast_to([side * BASE / 2, 0, 0], origin.shape), atol=1e-6)
        meeting.append(origin + direction * ((1.7 - origin[..., 1]) / direction[..., 1])[..., None])
    np.testing.assert_allclose(*meeting, atol=2e-6)


@pytest.mark.parametrize(
    ("camera", "settings"),
    [
        (OmnidirectionalStereo, {"type": "ods", "width": 64}),
        (DomeStereo, {"type": "dome_stereo", "width": 64}),
        (VR180, {"type": "vr180", "width": 64}),
        (StereoPerspective, {"type": "stereo_perspective", "width": 64, "height": 32}),
    ],
)
@pytest.mark.parametrize("distance", [0.0, -0.06, 6.4])
def test_eyes_that_are_not_apart_are_one_clear_error(camera, settings, distance):
    with pytest.raises(ValidationError) as caught:
        camera(**settings, interocular_distance=distance)
    (error,) = caught.value.errors()
    assert error["loc"] == ("interocular_distance",)
    assert "must be greater than 0 and at most 1 metre" in error["msg"]


@pytest.mark.parametrize(
    ("layout", "ods", "dome", "vr180", "view"),
    [
        ("top-bottom", (64, 64), (64, 128), (64, 128), (64, 32)),
        ("side-by-side", (64, 16), (64, 32), (64, 32), (64, 32)),
        ("separate", (64, 64), (64, 128), (64, 128), (64, 64)),
    ],
)
def test_width_and_height_are_those_of_a_file(layout, ods, dome, vr180, view):
    cameras = [
        (OmnidirectionalStereo(type="ods", width=64, layout=layout), ods),
        (DomeStereo(type="dome_stereo", width=64, layout=layout), dome),
        (VR180(type="vr180", width=64, layout=layout), vr180),
        (StereoPerspective(type="stereo_perspective", width=64, height=32, layout=layout), view),
    ]
    for camera, size in cameras:
        assert camera.resolution == size
        left, right = camera.topology.charts
        assert left.width == right.width
        assert camera.topology.parts == (("left", "right") if layout == "separate" else ())
