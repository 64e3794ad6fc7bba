"""Sloped ceilings and hanging lamps by clicks: what was clicked comes back, in metres."""

import numpy as np
import pytest
import trimesh

from lightdepth.errors import InputError
from lightdepth.kernel.raycasting import RayCaster
from lightdepth.reconstruction.coverage import measure_coverage
from lightdepth.reconstruction.layout import Clicked, surfaces_from_layout
from tests.reconstruction.test_layout import FLOOR, PLAN, POSE, SOURCE, click, level

HALL = np.array([[-2.0, -1.5], [4.0, -1.5], [4.0, 3.0], [-2.0, 3.0]])


def made(plan, ceiling=None, **settings):
    clicked = Clicked(click(level(plan, FLOOR)), **settings)
    return {s.name: s for s in surfaces_from_layout(clicked, SOURCE, camera_height=1.5, ceiling=ceiling)}


def whole(surfaces):
    mesh = trimesh.util.concatenate([trimesh.Trimesh(s.mesh.vertices, s.mesh.faces) for s in surfaces.values()])
    mesh.merge_vertices(digits_vertex=2)
    return mesh


def test_a_gable_roof_comes_back_closed():
    """Two slopes, each by the ends of its eaves and one end of the ridge."""
    eaves, top = FLOOR + 2.2, FLOOR + 3.2
    slopes = [
        click([[-2.0, y, eaves], [4.0, y, eaves], [4.0, 0.75, top]]) for y in (-1.5, 3.0)
    ]  # fmt: skip
    surfaces = made(HALL, slopes=slopes)
    mesh = whole(surfaces)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(-6.0 * 4.5 * 2.7, rel=1e-3)  # Negative: faces look inward.
    caster = RayCaster([surfaces["ceiling"].mesh])
    points = np.array([[x, y, FLOOR + 0.1] for x in (-1.7, 1.0, 3.6) for y in (-1.2, 0.5, 1.1, 2.8)])
    up = np.array([caster.cast(p, np.array([[0.0, 0.0, 1.0]])).distance[0] for p in points])
    expected = 3.2 - np.abs(points[:, 1] - 0.75) / 2.25 - 0.1
    np.testing.assert_allclose(up, expected, atol=3e-3)
    assert measure_coverage(list(surfaces.values()), POSE).hit == pytest.approx(1.0, abs=1e-9)


def test_a_slope_below_a_level_ceiling_in_an_l_shaped_room():
    """An attic: along the wall at x = -2 the roof comes down to 1.2 m, and meets the ceiling of 2.4 m at x = -0.8."""
    low = [[-2.0, -1.5, FLOOR + 1.2], [-2.0, 3.0, FLOOR + 1.2]]
    slope = click([*low, [-1.0, -1.5, FLOOR + 2.2], [-1.2, 3.0, FLOOR + 2.0]])
    surfaces = made(PLAN, ceiling=2.4, slopes=[slope])
    volume = 22.0 * 2.4 - 0.5 * 1.2 * 1.2 * 4.5
    mesh = whole(surfaces)
    assert mesh.volume == pytest.approx(-volume, rel=1e-3)
    assert measure_coverage(list(surfaces.values()), POSE).open < 1e-5
    assert surfaces["ceiling"].mesh.vertices[:, 2].min() == pytest.approx(FLOOR + 1.2, abs=2e-3)
    assert surfaces["ceiling"].mesh.vertices[:, 2].max() == pytest.approx(FLOOR + 2.4, abs=2e-3)


def test_a_lamp_hangs_below_where_it_hangs_from():
    middle = np.array([2.0, 0.4, FLOOR + 1.9])
    away = middle - POSE.position
    side = np.cross(away, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side)
    # The rim, as seen, is where the line of sight touches the sphere.
    distance, radius = np.linalg.norm(away), 0.2
    sine = radius / distance
    rim = POSE.position + away / distance * np.sqrt(1.0 - sine**2) + side * sine
    mount, at, edge = (click([point]) for point in ([2.0, 0.4, FLOOR + 2.4], middle, rim))
    surfaces = made(
        HALL, ceiling=2.4, lamps=[f"globe: at={at} from={mount} rim={edge}", f"at={at} height=1.9 size=0.3,0.5,0.2"]
    )
    globe, box = (surfaces[name].mesh for name in ("globe", "lamp-2"))
    np.testing.assert_allclose(globe.vertices.mean(axis=0), middle, atol=3e-3)
    assert trimesh.Trimesh(globe.vertices, globe.faces).volume == pytest.approx(4.0 / 3.0 * np.pi * radius**3, rel=0.02)
    np.testing.assert_allclose(box.vertices.max(axis=0), middle + [0.15, 0.25, 0.1], atol=3e-3)
    np.testing.assert_allclose(box.vertices.min(axis=0), middle - [0.15, 0.25, 0.1], atol=3e-3)
    # Under a slope it hangs from the slope.
    slope = click([[-2.0, -1.5, FLOOR + 2.6], [-2.0, 3.0, FLOOR + 2.6], [4.0, 3.0, FLOOR + 2.2]])
    mount = click([[2.0, 0.4, FLOOR + 2.6 - 0.4 * 4.0 / 6.0]])
    surfaces = made(HALL, slopes=[slope], lamps=[f"globe: at={at} from={mount} radius=0.2"])
    np.testing.assert_allclose(surfaces["globe"].mesh.vertices.mean(axis=0), middle, atol=5e-3)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"slopes": ["1,200 300,200"]}, "2 clicks found; at least 3"),
        ({"slopes": ["100,200 101,200 102,200"]}, "nearly in one line"),
        ({"slopes": ["100,400 300,100 700,100 900,400"]}, "below the floor|must be higher|degrees steep"),
        ({"lamps": ["globe: at=1,2 rim=3,4"]}, "write it as 'NAME: at=X,Y from=X,Y rim=X,Y'"),
        ({"lamps": ["globe: at=100,200 from=500,100 radius=0.1"]}, "it hangs plumb"),
        ({"lamps": ["globe: at=100,200 height=1.2 radius=0.1"]}, "its middle is seen (above|below) the horizon"),
        ({"lamps": ["globe: at=100,150 height=2.0 radius=-1"]}, "not 1 positive number"),
        ({"lamps": ["globe: at=100,150 height=2.0 size=1,2"]}, "not 3 positive numbers"),
        ({"lamps": ["globe: at=100,150 height=2.0 radius=9"]}, "would reach to the capture point"),
    ],
)
def test_wrong_slopes_and_lamps_are_explained(settings, message):
    with pytest.raises(InputError, match=message):
        made(HALL, ceiling=2.4, **settings)
