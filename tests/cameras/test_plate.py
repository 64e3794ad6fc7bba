"""The photograph as other cameras see it: where things appear, and how it is filtered."""

import numpy as np
import pytest

from lightdepth.kernel.start import start

start("cpu")

from lightdepth.cameras import Equirectangular, Fisheye, Perspective  # noqa: E402
from lightdepth.directions import (  # noqa: E402
    direction_to_latlong,
    euler_rotation,
    look_at_rotation,
    pixel_directions,
)
from lightdepth.film.plate import render_plate  # noqa: E402
from lightdepth.place.place import Place  # noqa: E402
from lightdepth.place.real_surfaces import merge_real_surfaces  # noqa: E402
from lightdepth.place.traced_surfaces import TracedSurfaces  # noqa: E402
from lightdepth.scene.model import CameraView  # noqa: E402
from tests.transport.places import CAPTURE, HIGH, room  # noqa: E402

LEVEL = np.zeros(3)


def plate_of(image, camera, position=CAPTURE, rotation=LEVEL, panorama_rotation=LEVEL):
    scene = room(np.asarray(image, np.float32), rotation=panorama_rotation)
    place = Place(scene.panorama, TracedSurfaces(merge_real_surfaces(scene.real)))
    turn = rotation if np.ndim(rotation) == 2 else euler_rotation(rotation)
    return render_plate(CameraView(camera, np.asarray(position), turn), [scene.panorama], place)


def centroid(plate):
    """Centre of what is brighter than the rest, in pixels from the corner of the image: (x, y)."""
    weight = plate.sum(axis=2) - np.median(plate.sum(axis=2))
    y, x = np.mgrid[: weight.shape[0], : weight.shape[1]] + 0.5
    return np.array([(weight * x).sum(), (weight * y).sum()]) / weight.sum()


def marked(target, height=256, sharpness=4000.0, rotation=LEVEL):
    """A panorama with a small bright spot in the direction of a point of the room."""
    toward = euler_rotation(rotation).T @ (np.asarray(target) - CAPTURE)
    toward /= np.linalg.norm(toward)
    spot = np.exp(sharpness * (pixel_directions(height, 2 * height) @ toward - 1))
    return 0.1 + 10 * spot[..., None] * np.ones(3)


@pytest.mark.parametrize("offset", [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (-0.5, -0.8, 0.33)])
def test_a_camera_that_moved_sees_parallax(offset):
    """A mark on the far wall is where a pinhole camera in a room has it: at f x / y from the image's middle."""
    target = np.array([0.6, HIGH[1], 1.2])
    position = CAPTURE + offset
    camera = Perspective(type="perspective", width=160, height=120, fov=70)
    plate, _ = plate_of(marked(target, rotation=(5, -3, 40)), camera, position, panorama_rotation=(5, -3, 40))
    x, y, z = target - position
    focal = 80 / np.tan(np.radians(35))
    np.testing.assert_allclose(centroid(plate), [80 + focal * x / y, 60 - focal * z / y], atol=0.35)


def test_a_moved_panorama_camera_sees_parallax():
    target = np.array([0.6, HIGH[1], 1.2])
    position = CAPTURE + [0.7, -0.6, 0.2]
    plate, _ = plate_of(marked(target), Equirectangular(type="equirectangular", width=256), position)
    u, v = direction_to_latlong(target - position)
    np.testing.assert_allclose(centroid(plate), [256 * u, 128 * v], atol=0.35)


def test_a_tilted_dome_sees_the_zenith_in_its_middle():
    target = np.array([CAPTURE[0], CAPTURE[1], HIGH[2]])
    plate, alpha = plate_of(marked(target), Fisheye(type="fisheye", width=96, fov=180), rotation=(90, 0, 0))
    np.testing.assert_allclose(centroid(plate * (alpha[..., None] == 1)), [48, 48], atol=0.3)
    # And black, with alpha 0, outside the circle; in between at its rim.
    y, x = np.mgrid[:96, :96] + 0.5
    radius = np.hypot(x - 48, y - 48)
    assert (alpha[radius > 49] == 0).all()
    assert (plate[radius > 49] == 0).all()
    assert (alpha[radius < 47] == 1).all()
    assert 0 < alpha[np.abs(radius - 48) < 0.5].mean() < 1


def test_look_at_shows_the_target_in_the_middle():
    target = np.array([1.5, HIGH[1], 2.0])
    position = CAPTURE + [-0.5, -1.0, -0.4]
    camera = Perspective(type="perspective", width=120, height=80, fov=50)
    plate, _ = plate_of(marked(target), camera, position, look_at_rotation(position, target))
    np.testing.assert_allclose(centroid(plate), [60, 40], atol=0.3)


def test_minified_detail_becomes_its_mean_without_aliasing():
    """Stripes finer than a pixel: the mean, not a moire of them."""
    stripes = np.tile(np.where(np.arange(1024) % 4 < 2, 1.0, 0.0), (512, 1))[..., None] * np.ones(3)
    camera = Equirectangular(type="equirectangular", width=128)
    plate, _ = plate_of(stripes, camera, rotation=(0, 0, 1.7))
    level = plate[16:48, :, 0]
    assert level.mean() == pytest.approx(0.5, abs=0.01)
    assert level.std() < 0.03


def test_magnified_detail_is_smooth_and_exact_at_its_samples():
    """A smooth image of few pixels is interpolated closely: no blocks, no steps beyond the image's own."""
    coarse = pixel_directions(32, 64)
    image = 1 + 0.5 * np.sin(2 * coarse[..., :1] + 1) * np.ones(3)
    camera = Perspective(type="perspective", width=320, height=160, fov=40)
    plate, _ = plate_of(image, camera)
    x = np.tan(np.radians(20)) * (2 * (np.arange(320) + 0.5) / 320 - 1)
    z = np.tan(np.radians(20)) * 0.5 * (1 - 2 * (np.arange(160) + 0.5) / 160)
    direction = np.stack(np.broadcast_arrays(x[None, :], 1.0, z[:, None]), axis=-1)
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    expected = 1 + 0.5 * np.sin(2 * direction[..., 0] + 1)
    assert np.abs(plate[..., 0] - expected).max() < 0.01
    assert np.abs(np.diff(plate[..., 0], axis=1)).max() < 1.5 * np.abs(np.diff(expected, axis=1)).max() + 1e-3


def test_interpolation_never_leaves_the_range_of_its_neighbours():
    image = np.zeros((32, 64, 3))
    image[12:16, 30:34] = 1000.0
    plate, _ = plate_of(image, Perspective(type="perspective", width=100, height=80, fov=60))
    assert plate.min() >= 0.0
    assert plate.max() <= 1000.0


def test_a_turned_panorama_is_seen_turned_and_exactly_by_its_own_camera():
    image = 0.5 + 0.4 * pixel_directions(64, 128)
    turn = (12.0, -7.0, 63.0)
    camera = Equirectangular(type="equirectangular", width=64)
    plate, _ = plate_of(image, camera, panorama_rotation=turn)
    light = pixel_directions(32, 64) @ euler_rotation(turn)
    np.testing.assert_allclose(plate, 0.5 + 0.4 * light, atol=0.005)
    exact, _ = plate_of(
        image, Equirectangular(type="equirectangular", width=128), rotation=turn, panorama_rotation=turn
    )
    np.testing.assert_array_equal(exact, image.astype(np.float32))


@pytest.mark.parametrize(("aperture", "focus"), [(0.03, 1.0), (0.12, 1.2)])
def test_a_lens_blurs_the_photograph_as_a_thin_lens_does(aperture, focus):
    """A mark is spread evenly over a disk, whose mean squared radius is half that of its edge, and loses no light."""
    target = np.array([0.1, HIGH[1], 1.5])
    distance = target[1] - CAPTURE[1]
    settings = {"type": "perspective", "width": 160, "height": 120, "fov": 60}
    sharp, blurred = (
        plate_of(marked(target), Perspective(**settings, **lens))[0]
        for lens in ({}, {"aperture": aperture, "focus_distance": focus})
    )
    edge = aperture * abs(1.0 / distance - 1.0 / focus) * 80 / np.tan(np.radians(30))
    assert edge > 2.0
    assert (blurred - 0.1).sum() == pytest.approx((sharp - 0.1).sum(), rel=0.01)
    spread = []
    for plate in (sharp, blurred):
        x, y = centroid(plate)
        weight = plate.sum(axis=2) - np.median(plate.sum(axis=2))
        rows, columns = np.mgrid[:120, :160] + 0.5
        spread.append((weight * ((columns - x) ** 2 + (rows - y) ** 2)).sum() / weight.sum())
    assert spread[1] - spread[0] == pytest.approx(0.5 * edge**2, rel=0.05)


def test_what_a_lens_focuses_stays_sharp():
    target = np.array([0.1, HIGH[1], 1.5])
    settings = {"type": "perspective", "width": 160, "height": 120, "fov": 60}
    focused = Perspective(**settings, aperture=0.1, focus_distance=HIGH[1] - CAPTURE[1])
    sharp, seen = plate_of(marked(target), Perspective(**settings))[0], plate_of(marked(target), focused)[0]
    np.testing.assert_allclose(seen[40:80, 60:110], sharp[40:80, 60:110], rtol=0.02, atol=0.02)
