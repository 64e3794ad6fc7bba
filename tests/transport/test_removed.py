"""What is removed leaves the picture, with its shadow and its light: in a place whose radiance is known in closed form."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy import ndimage

import lightdepth
from lightdepth.cameras import Equirectangular
from lightdepth.directions import pixel_directions
from lightdepth.errors import InputError
from lightdepth.kernel.raycasting import RayCaster
from lightdepth.kernel.start import start
from lightdepth.scene.model import CameraView, Mesh, Panorama, RealSurface, RenderSettings, Role, Scene, SunLight

start("cpu")

ALBEDO = 0.5
LOW, HIGH = np.array([1.40, -0.8, 0.02]), np.array([1.46, 0.8, 1.0])
"""Of a panel that shows its front: what nobody sees of it, nobody can take away."""
CAPTURE = np.array([0.2, -0.3, 1.4])
SUN = np.array([np.cos(np.radians(15.0)), 0.0, np.sin(np.radians(15.0))])
"""Toward a low sun, in whose way the panel stands."""
WIDTH = 192


def panel() -> Mesh:
    box = trimesh.creation.box(bounds=[LOW, HIGH])
    return Mesh(np.asarray(box.vertices, np.float32), np.asarray(box.faces, np.int32))


def form_factor(points):
    """Share of the irradiance of points of the floor that comes from where the panel is: Lambert's formula."""
    mesh, total = panel(), np.zeros(len(points))
    for face in mesh.faces:
        corners = mesh.vertices[face].astype(float) - points[:, None]
        away = np.einsum(
            "ij,ij->i", corners[:, 0], np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        )
        unit = corners / np.linalg.norm(corners, axis=2, keepdims=True)
        one = np.zeros(len(points))
        for i in range(3):
            first, second = unit[:, i], unit[:, (i + 1) % 3]
            across = np.cross(first, second)
            sine = np.linalg.norm(across, axis=1)
            angle = np.arctan2(sine, np.einsum("ij,ij->i", first, second))
            one += angle * across[:, 2] / sine / (2.0 * np.pi)
        total += np.where(away < 0.0, -one, 0.0)  # Those that face the point.
    return total


def floor(name, left, right, rest=False):
    """A strip of the floor between two places along x; with rest positions, it takes its colour from the far end."""
    corners = np.array([[left, -4, 0], [right, -4, 0], [right, 4, 0], [left, 4, 0]], np.float32)
    mesh = Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), rest=corners - (left + 4, 0, 0) if rest else None)
    return RealSurface(name, mesh, Role.SUPPORT)


def scene(glow, capture=CAPTURE, sunlight=0.0, floors=None, albedo=lambda points: ALBEDO):
    """A sky that sends 1, a grey floor under it, and a panel that sends ``glow``; and the surface in each pixel.

    Args:
        glow: radiance of the panel.
        capture: capture point.
        sunlight: irradiance of the floor by ``SUN``, in whose way the panel stands.
        floors: the floor as modelled, in one piece by default.
        albedo: of points of the floor.
    """
    floors = floors or (floor("floor", -4.0, 4.0),)
    standing = RealSurface("panel", panel(), Role.ENVIRONMENT, removed=True)
    directions = pixel_directions(WIDTH // 2, WIDTH).reshape(-1, 3)
    whole = floor("floor", -4.0, 4.0).mesh
    hits = RayCaster([whole, standing.mesh]).cast(capture, directions)
    met = np.where(np.isfinite(hits.distance), hits.mesh, 2)
    shown = np.select([met == 1, met == 2], [glow, 1.0], 0.0)
    points = capture + hits.distance[met == 0, None] * directions[met == 0]
    toward = np.broadcast_to(SUN, points.shape)
    shaded = np.isfinite(RayCaster([standing.mesh]).cast(points + 1e-4 * SUN, toward).distance)
    light = 1.0 + form_factor(points) * (glow - 1.0) + sunlight / np.pi * ~shaded
    shown[met == 0] = albedo(points) * light
    radiance = np.repeat(shown.reshape(WIDTH // 2, WIDTH, 1), 3, axis=2).astype(np.float32)
    panorama = Panorama(radiance, capture, np.eye(3), sky=True)
    camera = CameraView(Equirectangular(type="equirectangular", width=WIDTH), capture, np.eye(3))
    lights = (SunLight("sun", SUN, 0.2, np.full(3, sunlight / SUN[2])),) if sunlight else ()
    place = Scene(panorama, (*floors, standing), (), {"pano": camera}, RenderSettings(irradiance_samples=128))
    return replace(place, lights=lights), met.reshape(WIDTH // 2, WIDTH)


@pytest.mark.parametrize("glow", [0.02, 6.0])
def test_shadow_light_and_panel_are_gone(glow):
    place, surface = scene(glow)
    frame = lightdepth.render(place, "pano", samples=16)
    before = place.panorama.radiance[..., 0]
    changed = (surface == 0) & (frame.coverage == 0.0) & (np.abs(before - ALBEDO) > 0.02)
    assert changed.sum() > 80
    assert np.abs(before[changed] - ALBEDO).mean() > 0.03
    assert frame.beauty[changed].mean() == pytest.approx(ALBEDO, rel=0.01)
    assert np.abs(frame.beauty[changed].mean(axis=1) - ALBEDO).mean() < 0.4 * np.abs(before[changed] - ALBEDO).mean()
    hidden = surface == 1
    assert (frame.coverage[hidden] == 1.0).all()
    # Nobody knows what the panel hid; the floor goes on as it is beside it.
    floor = hidden & (frame.normal[..., 2] > 0.9)
    assert floor.sum() > 10
    assert frame.beauty[floor].mean() == pytest.approx(ALBEDO, rel=0.1)
    sky = (surface == 2) & (frame.coverage == 0.0)
    sky[WIDTH // 4 - 3 :] = False  # The horizon is the floor's edge.
    np.testing.assert_array_equal(frame.beauty[sky], np.float32(1.0))


@pytest.mark.parametrize("method", ["envpath", "directional"])
def test_other_methods_refuse_it(method):
    with pytest.raises(InputError, match=f"method '{method}' cannot remove"):
        lightdepth.render(scene(1.0)[0], "pano", samples=1, method=method)


def test_the_sun_shines_where_it_stood_and_rest_positions_say_what_was_behind():
    def halves(points):
        return np.where(points[..., 1] < 0.0, 0.3, 0.7)

    capture = np.array([0.2, -0.3, 0.6])  # in its shadow
    pieces = floor("floor", -4.0, HIGH[0] + 0.005), floor("behind", HIGH[0] + 0.005, 4.0, rest=True)
    place, surface = scene(0.5, capture, sunlight=2.0, floors=pieces, albedo=halves)
    frame = lightdepth.render(place, "pano", samples=8)
    directions = pixel_directions(WIDTH // 2, WIDTH)
    points = capture - capture[2] / np.minimum(directions[..., 2:], -1e-3) * directions
    lit = halves(points) * (1.0 + 2.0 / np.pi)
    before, after = place.panorama.radiance[..., 0] / lit, frame.beauty.mean(axis=-1) / lit
    # Not at the edges of the pattern and of the floor, which pixels of the panorama mix with what is beside them.
    known = (np.abs(points[..., 1]) > 0.3) & (np.abs(points[..., 0]) < 3.5)
    shadow = (surface == 0) & (frame.coverage == 0.0) & (before < 0.8)
    beside = (surface == 0) & (frame.coverage == 0.0) & (points[..., 0] < HIGH[0])
    beside &= ~ndimage.binary_dilation(shadow | (surface == 1), iterations=2)  # The shadow has no smooth edge.
    behind = (surface == 1) & (np.abs(points[..., 0] - 2.7) < 0.5)
    for region, tolerance in (
        (shadow, 0.01),
        (beside, 0.005),
        (behind & (lit < 0.8), 0.03),
        (behind & (lit > 0.8), 0.03),
    ):
        assert (region & known).sum() > 20
        assert after[region & known].mean() == pytest.approx(1.0, abs=tolerance)
