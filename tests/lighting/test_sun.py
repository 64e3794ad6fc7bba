"""A sun recovered from its patches, against the path-traced room's own sun."""

from dataclasses import replace

import numpy as np
import pytest

from lightdepth.errors import InputError
from lightdepth.kernel.start import start
from lightdepth.lighting.panorama_view import PanoramaView
from lightdepth.lighting.sun import recover_sun
from lightdepth.lighting.sun_mask import recover_mask, with_masks
from lightdepth.lighting.sunlight import Sunlight
from lightdepth.scene.lights.frame import sun_axes, sun_direction
from lightdepth.scene.model import SunLight

start("cpu")
import mitsuba as mi  # noqa: E402 - needs a variant

from lightdepth.preparation.place import prepare_place  # noqa: E402


@pytest.fixture(scope="module")
def true_direction(barred):
    direction = np.array(barred.sun().direction)
    return direction / np.linalg.norm(direction)


@pytest.fixture(scope="module")
def found(barred_scene):
    return recover_sun(barred_scene)


def degrees_between(first, second):
    return np.degrees(np.arccos(np.clip(first @ second, -1.0, 1.0)))


def pixels_of(scene, points):
    """Clicks on world points, as a user writes them."""
    view = PanoramaView(scene)
    return " ".join(f"{x:.2f},{y:.2f}" for x, y in view.pixels(np.array(points, dtype=float)))


def test_direction_and_irradiance_are_the_room_s(found, barred, true_direction):
    assert degrees_between(found.direction, true_direction) < 0.5
    np.testing.assert_allclose(found.irradiance.value, barred.sun().irradiance, rtol=0.05)
    assert found.confidence == "good"
    assert {"floor", "left wall"} <= set(found.by_surface)


def test_the_stated_uncertainty_holds(found, barred, true_direction):
    assert degrees_between(found.direction, true_direction) < 5.0 * found.direction_uncertainty
    assert np.all(np.abs(found.irradiance.value - barred.sun().irradiance) < 5.0 * found.irradiance.uncertainty)


def test_a_known_direction_leaves_the_irradiance_to_be_found(barred_scene, barred, true_direction):
    given = recover_sun(barred_scene, direction=3.0 * true_direction)
    np.testing.assert_allclose(given.direction, true_direction, rtol=1e-12)
    np.testing.assert_allclose(given.irradiance.value, barred.sun().irradiance, rtol=0.05)


def test_a_clicked_outline_and_a_place_in_the_sun_agree_with_the_search(barred_scene, found, true_direction):
    # The right window, projected onto the floor along the true direction; and a place in its lower left pane.
    corners = np.array([[0.35, 2.8, 0.8], [1.55, 2.8, 0.8], [1.55, 2.8, 2.28], [0.35, 2.8, 2.28]])
    floor = corners - true_direction * (corners[:, 2:] / true_direction[2])
    place = np.array([0.63, 2.8, 1.15]) - true_direction * (1.15 / true_direction[2])
    clicked = recover_sun(barred_scene, [pixels_of(barred_scene, floor), pixels_of(barred_scene, [place])])
    assert degrees_between(clicked.direction, found.direction) < 0.1


def test_bars_that_are_not_modelled_are_in_the_mask(without_bars, barred, true_direction):
    sun = recover_sun(without_bars)
    np.testing.assert_allclose(sun.irradiance.value, barred.sun().irradiance, rtol=0.05)
    # Too weak a sun of another colour is one whose lit places are too bright: all of the patch says so.
    weak = replace(sun.light(), irradiance=np.array([0.5, 0.6, 0.7]) * sun.irradiance.value)
    mask = recover_mask(without_bars, weak)
    np.testing.assert_allclose(mask.irradiance, barred.sun().irradiance, rtol=0.05)
    left, bottom, right, top = mask.extent
    axes = np.stack(sun_axes(sun.direction))

    def around(*point, reach):
        u, v = axes @ np.array(point)
        rows, columns, _ = mask.transmittance.shape
        row, column = int((top - v) / (top - bottom) * rows), int((u - left) / (right - left) * columns)
        return mask.transmittance[row - reach : row + reach + 1, column - reach : column + reach + 1]

    # In the window plane y = 2.8: the middles of two panes, and of a bar, which is about a pixel wide.
    assert np.median(around(0.63, 2.8, 1.93, reach=1)) > 0.85
    assert np.median(around(-1.67, 2.8, 1.15, reach=1)) > 0.85
    assert around(0.95, 2.8, 1.0, reach=1).min() < 0.6

    # A scene that asks for the mask is prepared with the same one.
    light = replace(sun.light(), recover_mask=True)
    settings = replace(without_bars.render, draft=True, irradiance_samples=16)
    (prepared,) = prepare_place(replace(without_bars, lights=(light,), render=settings)).place.declared
    bar = [[x, 2.8, 1.0] for x in np.linspace(0.89, 1.01, 9)]
    points = np.array([[0.63, 2.8, 1.93], [3.0, 2.8, 1.0], *bar], np.float32)
    pane, beside, *across = prepared.transmittance(mi.Point3f(points.T)).numpy()[0]
    assert pane > 0.85
    assert beside == 0.0
    assert min(across) < 0.6


def test_a_mask_of_a_patch_that_the_photograph_does_not_show_is_refused(barred_scene):
    elsewhere = SunLight("west sun", sun_direction(270.0, 30.0), 0.53, np.ones(3), recover_mask=True)
    with pytest.raises(
        InputError, match=r"\[\[light\]\] 'west sun', mask = \"recover\": .* shows 2 pixels of the patch"
    ):
        with_masks(replace(barred_scene, lights=(elsewhere,)))


def test_a_closed_room_has_no_sun(barred_scene):
    closed = replace(barred_scene, real=tuple(replace(s, opening=False) for s in barred_scene.real))
    with pytest.raises(InputError, match="closed.*opening = true"):
        recover_sun(closed)


def test_a_scene_without_surfaces_is_refused(barred_scene):
    with pytest.raises(InputError, match=r"no \[\[real\]\] surfaces"):
        recover_sun(replace(barred_scene, real=()))


def test_a_sun_below_the_horizon_is_refused(barred_scene):
    with pytest.raises(InputError, match=r"20\.0 degrees below the horizon"):
        recover_sun(barred_scene, direction=np.array([0.0, np.cos(np.radians(20)), -np.sin(np.radians(20))]))


def test_a_sun_that_the_capture_point_sees_is_refused(barred_scene, barred):
    pane = np.array([0.63, 2.8, 1.15 + 0.78])
    with pytest.raises(InputError, match="the capture point itself sees the sun, at pixel"):
        recover_sun(barred_scene, direction=pane - np.array(barred.position))


def test_clicks_that_no_sun_explains_contradict(barred_scene):
    # Two places on opposite walls: what lights the one from the window cannot light the other.
    clicks = [pixels_of(barred_scene, [[-2.6, 1.0, 1.0]]), pixels_of(barred_scene, [[2.2, 1.0, 1.0]])]
    with pytest.raises(InputError, match="the clicks contradict each other or the model"):
        recover_sun(barred_scene, clicks)


def test_outlines_of_which_one_stays_in_the_shade_contradict(barred_scene, true_direction):
    windows = np.array([[-1.95, 2.8, 0.8], [1.55, 2.8, 0.8], [1.55, 2.8, 2.28], [-1.95, 2.8, 2.28]])
    patch = windows - true_direction * (windows[:, 2:] / true_direction[2])
    patch[:, 0] = np.maximum(patch[:, 0], -2.55)
    elsewhere = [[1.2, -1.6, 0.0], [1.9, -1.6, 0.0], [1.9, -1.1, 0.0], [1.2, -1.1, 0.0]]
    with pytest.raises(InputError, match="contradict each other.*of patch 2"):
        recover_sun(barred_scene, [pixels_of(barred_scene, patch), pixels_of(barred_scene, elsewhere)])


def test_a_click_on_a_window_is_refused(barred_scene):
    with pytest.raises(InputError, match="point 1 of patch 1 lies on no real surface that the sun can light"):
        recover_sun(barred_scene, [pixels_of(barred_scene, [[0.63, 2.8, 1.15]])])


def test_surfaces_cut_along_the_patch_s_edges_cannot_be_compared(barred_scene, true_direction):
    """Where every lit face is a surface of its own, nothing has both sides on one material."""
    view, sunlight = PanoramaView(barred_scene), Sunlight(barred_scene)
    pieces = []
    for surface in barred_scene.real:
        if surface.name in ("floor", "left wall", "rug"):
            split = [cells(surface, lit) for lit in divided(surface, sunlight, true_direction)]
            pieces += [replace(piece, name=f"{piece.name} {i}") for i, piece in enumerate(split)]
        else:
            pieces.append(surface)
    with pytest.raises(InputError, match="cannot be determined"):
        recover_sun(replace(barred_scene, real=tuple(pieces)), direction=true_direction)
    assert view.names


def divided(surface, sunlight, direction):
    """Fine cells of a surface, those in the sun and those in the shade."""
    mesh = surface.mesh
    vertices, faces = mesh.vertices.astype(float), mesh.faces
    for _ in range(6):
        a, b, c = (vertices[faces[:, i]] for i in range(3))
        count = len(faces)
        vertices = np.concatenate([a, b, c, (a + b) / 2, (b + c) / 2, (c + a) / 2])
        i = np.arange(count)
        a, b, c, ab, bc, ca = (i + k * count for k in range(6))
        corners = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        faces = np.concatenate([np.stack(corner, 1) for corner in corners])
    middle = vertices[faces].mean(axis=1)
    first = vertices[faces[0]]
    normal = np.cross(first[1] - first[0], first[2] - first[0])
    normal = np.broadcast_to(normal / np.linalg.norm(normal), middle.shape)
    lit = sunlight.lit(middle, normal, direction)
    return [(vertices, faces[lit]), (vertices, faces[~lit])]


def cells(surface, part):
    vertices, faces = part
    mesh = replace(
        surface.mesh, vertices=vertices.astype(np.float32), faces=faces.astype(np.int32), texture_coordinates=None
    )
    return replace(surface, mesh=mesh)
