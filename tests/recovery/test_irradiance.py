"""Irradiance against the closed form, and how its recovery behaves."""

import numpy as np
import pytest
from scipy.ndimage import maximum_filter, minimum_filter

from lightdepth.kernel.start import start

start("cpu")

from lightdepth.directions import latlong_to_direction  # noqa: E402
from lightdepth.place.place import Place  # noqa: E402
from lightdepth.place.real_surfaces import merge_real_surfaces  # noqa: E402
from lightdepth.place.traced_surfaces import TracedSurfaces  # noqa: E402
from lightdepth.recovery.irradiance import estimate_irradiance  # noqa: E402
from lightdepth.recovery.irradiance_mesh import estimate_on_mesh  # noqa: E402
from lightdepth.recovery.mesh_components import separate  # noqa: E402
from lightdepth.recovery.support_irradiance import recover_irradiance  # noqa: E402
from tests.chance import Seen, check_seen  # noqa: E402
from tests.transport.places import CAPTURE, HIGH, LOW, box_depth, lamp_image, room  # noqa: E402

LAMP_LOW, LAMP_HIGH, RADIANCE = np.array([-0.5, 0.2]), np.array([0.9, 1.1]), 20.0


def corner_factor(a, b, height):
    """Form factor of a rectangle with a corner straight above a parallel element: Hottel's closed form."""
    x, y = a / height, b / height
    return (
        x / np.sqrt(1 + x**2) * np.arctan(y / np.sqrt(1 + x**2))
        + y / np.sqrt(1 + y**2) * np.arctan(x / np.sqrt(1 + y**2))
    ) / (2 * np.pi)


def closed_form(point):
    """Irradiance on the floor under the lamp."""
    low, high, height = LAMP_LOW - point[:2], LAMP_HIGH - point[:2], HIGH[2] - point[2]

    def to(x, y):
        return np.sign(x) * np.sign(y) * corner_factor(abs(x), abs(y), height)

    factor = to(high[0], high[1]) - to(low[0], high[1]) - to(high[0], low[1]) + to(low[0], low[1])
    return np.pi * RADIANCE * factor


def lamp_panorama(width=1024, oversampling=8):
    """A black room whose ceiling holds a rectangular lamp, each pixel the mean over its solid angle."""
    height = width // 2

    def on(v, u):
        directions = latlong_to_direction(u / width, v / height)
        at = CAPTURE + directions * box_depth(directions)[..., None]
        return (np.abs(at[..., 2] - HIGH[2]) < 1e-6) & ((at[..., :2] > LAMP_LOW) & (at[..., :2] < LAMP_HIGH)).all(
            axis=-1
        )

    share = on(*np.mgrid[:height, :width] + 0.5).astype(float)
    # The pixels that its edge may cross are those whose neighbours differ.
    edge = maximum_filter(share, 5, mode="wrap") != minimum_filter(share, 5, mode="wrap")
    row, column = np.nonzero(edge)
    fine = (np.arange(oversampling) + 0.5) / oversampling
    v, u = row[:, None, None] + fine[:, None], column[:, None, None] + fine
    share[edge] = on(*np.broadcast_arrays(v, u)).mean(axis=(1, 2))
    return np.repeat((RADIANCE * share)[..., None], 3, axis=2).astype(np.float32)


def test_irradiance_under_a_rectangular_lamp_is_the_closed_form():
    scene = room(lamp_panorama(), rotation=(0.0, 0.0, 0.0))
    place = Place(scene.panorama, TracedSurfaces(merge_real_surfaces(scene.real)))
    points = np.array([[0.2, 0.6, 0.0], [1.5, -1.0, 0.0], [-1.6, 2.4, 0.0], [2.2, 2.7, 0.0], [-1.5, -2.0, 0.0]])
    normals = np.tile(np.float32([0.0, 0.0, 1.0]), (len(points), 1))
    found, _ = estimate_irradiance(place, points.astype(np.float32), normals, np.random.default_rng(1), 1 << 19)
    check_seen(
        found[:, 1] / [closed_form(point) for point in points] - 1.0,
        Seen(11, -8.79e-05, 0.000206, 0.000211),
        -0.005,
        0.005,
    )


def test_without_depth_it_is_far_off():
    scene = room(lamp_panorama(256, 4), rotation=(0.0, 0.0, 0.0))
    place = Place(scene.panorama, TracedSurfaces(merge_real_surfaces(scene.real)), infinite=True)
    point = np.array([[-1.6, 2.4, 0.0]], np.float32)
    found, _ = estimate_irradiance(place, point, np.float32([[0, 0, 1]]), np.random.default_rng(1), 1 << 14)
    check_seen(abs(found[0, 1] / closed_form(point[0]) - 1), Seen(11, 5.1, 5.1, 0.00168), low=0.2)


def test_coarse_support_is_refined_until_the_irradiance_fits():
    scene = room(lamp_image(128))
    surfaces = merge_real_surfaces(scene.real)
    place = Place(scene.panorama, TracedSurfaces(surfaces))
    refined, errors = recover_irradiance(place, surfaces, np.random.default_rng(2), 1024)
    report = errors.report([(np.array([0.3, 1.2, 0.4]), 0.4)])
    assert len(surfaces.faces) == 12
    check_seen(report.vertices, Seen(11, 42700.0, 42700.0, 194.0), low=200)
    check_seen(report.mean_error, Seen(11, 0.00195, 0.00195, 0.000148), high=0.015)
    # The same surface still: nothing moved out of the box's planes, and the area is the same.
    at = refined.vertices[refined.faces].reshape(-1, 3)
    assert (np.isclose(at, LOW, atol=1e-5) | np.isclose(at, HIGH, atol=1e-5)).any(axis=1).all()
    size = HIGH - LOW
    area = 2 * (size[0] * size[1] + size[1] * size[2] + size[0] * size[2])
    corners = refined.vertices[refined.faces].astype(float)
    found = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
    assert found == pytest.approx(area, rel=1e-5)


def test_support_is_wound_to_face_the_capture_point():
    scene = room(lamp_image(64))
    surfaces = merge_real_surfaces(scene.real)
    inside_out = surfaces.__class__(**{**surfaces.__dict__, "faces": surfaces.faces[:, ::-1].copy()})
    place = Place(scene.panorama, TracedSurfaces(inside_out))
    refined, _ = recover_irradiance(place, inside_out, np.random.default_rng(2), 16)
    corners = refined.vertices[refined.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    assert ((normals * (CAPTURE - corners.mean(axis=1))).sum(axis=1) > 0).all()


def test_irradiance_along_walls_is_that_beside_them():
    """Vertices in the very plane of a wall receive what points two millimetres away from it do, and not half of it."""
    scene = room(lamp_image(128))
    surfaces = merge_real_surfaces(scene.real)
    place = Place(scene.panorama, TracedSurfaces(surfaces))
    support = separate(surfaces, surfaces.receiving)
    mesh, irradiance = estimate_on_mesh(place, support, np.random.default_rng(4), 256, 0.05)
    on_floor = (mesh.points[:, 2] == 0.0) & ((mesh.points == np.float32(LOW)) | (mesh.points == HIGH))[:, :2].any(
        axis=1
    )
    assert on_floor.sum() > 20
    points = mesh.points[on_floor]
    away = np.float32([*(0.5 * (LOW + HIGH))[:2], 0.0]) - points
    points = points + 0.004 * away / np.linalg.norm(away, axis=1, keepdims=True)
    normals = np.tile(np.float32([0.0, 0.0, 1.0]), (len(points), 1))
    beside, _ = estimate_irradiance(place, points, normals, np.random.default_rng(5), 2048)
    ratio = irradiance[on_floor].mean(axis=1) / beside.mean(axis=1)
    check_seen(
        np.quantile(np.abs(ratio - 1.0), 0.9), Seen(11, 0.0946, 0.0946, 0.00504), high=0.18
    )  # Noise, and corners that are darker.
    check_seen(np.median(ratio), Seen(11, 1.0, 1.0, 0.00152), 0.98, 1.02)
