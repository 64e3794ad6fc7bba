"""Layouts from clicks: what was clicked comes back, in metres."""

import numpy as np
import pytest
import trimesh

from lightdepth.directions import euler_rotation
from lightdepth.errors import InputError
from lightdepth.reconstruction.coverage import measure_coverage
from lightdepth.reconstruction.layout import Clicked, surfaces_from_layout
from lightdepth.reconstruction.pose import Pose
from lightdepth.reconstruction.posed_panorama import PosedPanorama
from lightdepth.scene.model import Role

SIZE = (500, 1000)
PLAN = np.array([[-2.0, -1.5], [4.0, -1.5], [4.0, 1.0], [1.5, 1.0], [1.5, 3.0], [-2.0, 3.0]])
POSE = Pose(np.array([0.3, -0.2, 1.9]), euler_rotation([3.0, -4.0, 130.0]))
SOURCE = PosedPanorama(POSE, (3.0, -4.0, 130.0), np.ones((*SIZE, 3), np.float32))
FLOOR = 0.4  # 1.5 m below the camera


def click(points):
    """Pixels of world points, as a person would write them."""
    u, v = POSE.to_panorama(np.atleast_2d(points))
    return " ".join(f"{x:.4f},{y:.4f}" for x, y in zip(u * SIZE[1], v * SIZE[0], strict=True))


def level(corners, height):
    return np.column_stack([corners, np.full(len(corners), height)])


def made(floor=PLAN, **settings):
    clicked = Clicked(click(level(floor, FLOOR)), **settings)
    return {s.name: s for s in surfaces_from_layout(clicked, SOURCE, camera_height=1.5, ceiling=2.4)}


@pytest.mark.parametrize("order", [PLAN, PLAN[::-1], np.roll(PLAN, 2, axis=0)])
def test_an_l_shaped_room_comes_back_closed(order):
    surfaces = made(order)
    corners = surfaces["floor"].mesh.vertices
    assert np.abs(corners[:, None] - level(PLAN, FLOOR)).max(axis=2).min(axis=1).max() < 1e-3
    assert [surfaces[name].role for name in ("floor", "walls", "ceiling")] == [Role.SUPPORT, *[Role.ENVIRONMENT] * 2]
    whole = trimesh.util.concatenate([trimesh.Trimesh(s.mesh.vertices, s.mesh.faces) for s in surfaces.values()])
    whole.merge_vertices(digits_vertex=4)
    assert whole.is_watertight
    assert whole.volume == pytest.approx(-2.4 * 22.0, rel=1e-3)  # Negative: faces look inward.
    assert measure_coverage(list(surfaces.values()), POSE).hit == pytest.approx(1.0, abs=1e-12)


def test_the_ceiling_is_as_high_as_its_clicked_corner():
    corner = click([[4.0, -1.5, FLOOR + 2.73]])
    clicked = Clicked(click(level(PLAN, FLOOR)), ceiling_corner=corner)
    surfaces = surfaces_from_layout(clicked, SOURCE, camera_height=1.5)
    assert surfaces[2].name == "ceiling"
    np.testing.assert_allclose(surfaces[2].mesh.vertices[:, 2], FLOOR + 2.73, atol=1e-3)


def test_furniture_stands_where_it_was_clicked():
    foot = np.array([[2.5, -1.2], [3.5, -1.2], [3.5, 0.3]])
    bench = foot + np.array([0.0, 0.5])
    desk = np.array([[-1.6, 1.0], [-0.9, 1.0], [-0.9, 2.4], [-1.6, 2.4]])
    surfaces = made(
        boxes=[f"cupboard: {click(level(foot, FLOOR))} height=1.8", f"{click(level(bench, FLOOR + 0.3))} "
               "height=0.3 top=support clicked=top"],
        tables=[f"desk: {click(level(desk, FLOOR + 0.74))} height=0.74"],
        panels=[f"screen: {click(level(np.array([[0.0, 2.0], [1.0, 2.0]]), FLOOR))} height=1.6"],
    )  # fmt: skip
    cupboard = surfaces["cupboard"].mesh
    np.testing.assert_allclose(cupboard.vertices.min(axis=0), [2.5, -1.2, FLOOR], atol=2e-3)
    np.testing.assert_allclose(cupboard.vertices.max(axis=0), [3.5, 0.3, FLOOR + 1.8], atol=2e-3)
    assert surfaces["cupboard"].role is Role.ENVIRONMENT
    assert (surfaces["box-2-top"].role, surfaces["box-2"].role) == (Role.SUPPORT, Role.ENVIRONMENT)
    np.testing.assert_allclose(surfaces["box-2-top"].mesh.vertices.max(axis=0), [3.5, 0.8, FLOOR + 0.3], atol=2e-3)
    assert surfaces["desk"].role is Role.SUPPORT
    np.testing.assert_allclose(surfaces["desk"].mesh.vertices[:, 2], FLOOR + 0.74, atol=1e-5)
    assert trimesh.Trimesh(surfaces["desk"].mesh.vertices, surfaces["desk"].mesh.faces).area == pytest.approx(
        0.98, 1e-3
    )
    screen = trimesh.Trimesh(surfaces["screen"].mesh.vertices, surfaces["screen"].mesh.faces)
    assert screen.area == pytest.approx(1.6, rel=1e-3)
    np.testing.assert_allclose(screen.face_normals, [[0, -1, 0]] * 2, atol=1e-2)  # Toward the camera.


def test_outdoors_the_ground_is_a_disk_and_the_rest_sky():
    (ground,) = surfaces_from_layout(Clicked(), SOURCE, camera_height=1.5, ground_radius=30.0)
    assert ground.role is Role.SUPPORT
    assert trimesh.Trimesh(ground.mesh.vertices, ground.mesh.faces).area == pytest.approx(np.pi * 30**2, rel=2e-3)
    coverage = measure_coverage([ground], POSE, True)
    below_its_edge = 0.5 * (1.0 - 1.5 / np.hypot(1.5, 30.0))
    assert coverage.hit == pytest.approx(below_its_edge, abs=1e-3)
    assert (coverage.sky, coverage.open) == (pytest.approx(1.0 - coverage.hit), 0.0)


@pytest.mark.parametrize(
    ("clicked", "settings", "message"),
    [
        (Clicked("10,400 20,400"), {"ceiling": 2.4}, "2 corners found; at least 3"),
        (Clicked("10,400 20;400 30,30"), {"ceiling": 2.4}, "'20' is not a point"),
        (Clicked("10,400 20,400 30,501"), {"ceiling": 2.4}, "point 3 is 30,501; allowed are x from -1000"),
        (Clicked("10,400 500,400 700,100"), {"ceiling": 2.4}, "click 3 looks .* degrees from the horizon"),
        (Clicked("10,400 500,400 250,400 750,400"), {"ceiling": 2.4}, "corner 1 crosses the side from corner 3"),
        (Clicked("10,400 60,400 30,390"), {"ceiling": 2.4}, "capture point does not stand on the floor"),
        (Clicked("10,400 350,400 700,400"), {"ceiling": 1.2}, "must be higher"),
        (Clicked("10,400 350,400 700,400", "100,100"), {}, "degrees of azimuth away"),
        (Clicked("10,400 350,400 700,400", tables=["9,390 8,380 20,380"]), {"ceiling": 2.4}, "height=METRES"),
        (Clicked("10,400 350,400 700,400", tables=["9,390 8,380 height=1"]), {"ceiling": 2.4}, "2 clicks found"),
        (Clicked("10,400 350,400 700,400", boxes=["walls: 9,390 8,380 9,380 height=1"]), {"ceiling": 2.4}, "'walls'"),
        (Clicked("10,400 350,400 700,400", boxes=["../x: 9,390 8,380 20,380 height=1"]), {"ceiling": 2.4}, "write it"),
    ],
)  # fmt: skip
def test_wrong_clicks_are_explained(clicked, settings, message):
    with pytest.raises(InputError, match=message):
        surfaces_from_layout(clicked, SOURCE, camera_height=1.5, **settings)
