import numpy as np
import pytest

from lightdepth.checks import Severity, find_problems, inspect_scene
from lightdepth.directions import euler_rotation, latlong_to_direction
from lightdepth.scene.model import Mesh

from .rooms import HIGH, LOW, RealSurface, Role, room, scene, side


def rectangle_share(a, b, distance):
    """Solid angle of a rectangle of half sides a and b, seen from a point over its middle, as a share of the sphere."""
    return np.arctan(a * b / (distance * np.sqrt(a * a + b * b + distance * distance))) / np.pi


def test_closed_room_is_covered():
    coverage = inspect_scene(scene()).coverage
    assert coverage.share == 1.0
    assert coverage.largest_hole is None
    assert coverage.by_surface["floor"] == pytest.approx(rectangle_share(2, 3, 1.25), rel=0.01)
    assert sum(coverage.by_surface.values()) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("missing", "share", "azimuth", "elevation"),
    [
        ("front", rectangle_share(2, 1.25, 3), 0.0, 0.0),
        ("right", rectangle_share(3, 1.25, 2), 90.0, 0.0),
        ("back", rectangle_share(2, 1.25, 3), 180.0, 0.0),  # Across the panorama's edge: one hole, not two.
        ("ceiling", rectangle_share(2, 3, 1.25), None, 90.0),
    ],
)
def test_hole_has_its_size_and_direction(missing, share, azimuth, elevation):
    hole = inspect_scene(scene(room(without=[missing]))).coverage.largest_hole
    assert hole.share == pytest.approx(share, rel=0.02)
    assert hole.elevation == pytest.approx(elevation, abs=1.0)
    if azimuth is not None:
        assert np.cos(np.radians(hole.azimuth - azimuth)) > np.cos(np.radians(1.0))


def test_direction_pixel_and_angles_agree_for_a_turned_panorama():
    rotation = euler_rotation([4.0, -7.0, 130.0])
    hole = inspect_scene(scene(room(without=["right"]), rotation=rotation)).coverage.largest_hole
    np.testing.assert_allclose(hole.direction, [1.0, 0.0, 0.0], atol=0.03)
    seen = rotation @ latlong_to_direction((hole.column + 0.5) / 64, (hole.row + 0.5) / 32)
    assert seen @ hole.direction > np.cos(np.radians(6.0))
    u, v = hole.azimuth / 360 + 0.5, 0.5 - hole.elevation / 180
    np.testing.assert_allclose(rotation @ latlong_to_direction(u, v), hole.direction, atol=1e-9)


def test_largest_of_two_holes_is_reported():
    inspection = inspect_scene(scene(room(without=["left", "right"]), position=[-0.5, 0.0, 1.25]))
    left, right = rectangle_share(3, 1.25, 1.5), rectangle_share(3, 1.25, 2.5)
    assert inspection.coverage.largest_hole.azimuth == pytest.approx(-90.0, abs=1.0)
    assert inspection.coverage.largest_hole.share == pytest.approx(left, rel=0.02)
    assert inspection.coverage.share == pytest.approx(1 - left - right, abs=0.003)
    (problem,) = inspection.problems
    assert problem.severity is Severity.ERROR
    assert f"{100 * (1 - inspection.coverage.share):.2g} % of all directions hit no real surface" in problem.message
    assert f"the largest hole ({100 * left:.2g} %) is around azimuth -90" in problem.message


def test_no_geometry_is_an_error():
    (problem,) = find_problems(scene([]))
    assert problem.severity is Severity.ERROR
    assert "no real geometry" in problem.message


def test_depth_alone_is_geometry():
    depth = np.full((16, 32), 2.0, np.float32)
    depth[:8] = np.inf
    inspection = inspect_scene(scene([], depth=depth))
    assert inspection.coverage.share == pytest.approx(0.5)
    assert inspection.coverage.sky == pytest.approx(0.5)
    assert inspection.problems == ()


def test_what_is_declared_sky_is_no_hole():
    ground = side("floor")
    far = RealSurface("ground", type(ground)(ground.vertices * 1000, ground.faces), Role.SUPPORT)
    inspection = inspect_scene(scene([far], sky=True))
    assert inspection.coverage.share == pytest.approx(0.5, abs=0.01)
    assert inspection.coverage.sky == pytest.approx(1 - inspection.coverage.share)
    assert inspection.problems == ()
    (problem,) = inspect_scene(scene([far])).problems
    assert problem.severity is Severity.ERROR
    assert "`sky = true`" in problem.message


def ceiling_with(count, size):
    """The ceiling as a sheet with square openings of a size in metres, in a row."""
    x, y = np.unique([LOW[0], HIGH[0], -size / 2, size / 2]), [LOW[1], HIGH[1]]
    for middle in np.linspace(-0.5, 0.5, count):
        y = [*y, middle - size / 2, middle + size / 2]
    x, y = np.sort(x), np.sort(y)
    vertices = np.stack([*np.meshgrid(x, y, indexing="ij"), np.full((len(x), len(y)), HIGH[2])], axis=-1)
    i, j = np.meshgrid(np.arange(len(x) - 1), np.arange(len(y) - 1), indexing="ij")
    solid = (i != 1) | (j % 2 == 0)
    a = (i * len(y) + j)[solid]
    faces = np.concatenate([np.stack([a, a + 1, a + len(y)], 1), np.stack([a + 1, a + len(y) + 1, a + len(y)], 1)])
    return RealSurface(
        "ceiling", Mesh(vertices.reshape(-1, 3).astype(np.float32), faces.astype(np.int32)), "environment"
    )


@pytest.mark.parametrize(
    ("count", "size", "severity"), [(1, 0.01, None), (1, 0.1, Severity.ERROR), (8, 0.03, Severity.WARNING)]
)
def test_seams_are_no_holes(count, size, severity):
    """A slit of a centimetre, a missing lamp, and so many small gaps that they are worth a word."""
    problems = inspect_scene(scene([*room(without=["ceiling"]), ceiling_with(count, size)])).problems
    assert [problem.severity for problem in problems] == ([] if severity is None else [severity])
