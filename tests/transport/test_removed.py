"""What is removed leaves the picture, with its shadow and its light: in a place whose radiance is known in closed form."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

import lightdepth
from lightdepth.cameras import Equirectangular
from lightdepth.directions import pixel_directions
from lightdepth.errors import InputError
from lightdepth.kernel.raycasting import RayCaster
from lightdepth.kernel.start import start
from lightdepth.scene.model import CameraView, Mesh, Panorama, RealSurface, RenderSettings, Role, Scene, SunLight

start("cpu")

from lightdepth.preparation import METHODS  # noqa: E402

ALBEDO = 0.5
LOW, HIGH = np.array([1.40, -0.8, 0.02]), np.array([1.46, 0.8, 1.0])
"""Of a panel that shows its front: what nobody sees of it, nobody can take away."""
CAPTURE = np.array([0.2, -0.3, 1.4])
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


def scene(glow):
    """A sky that sends 1, a grey floor under it, and a panel that sends ``glow``; and the surface in each pixel."""
    corners = np.array([[-4, -4, 0], [4, -4, 0], [4, 4, 0], [-4, 4, 0]], np.float32)
    floor = RealSurface("floor", Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32)), Role.SUPPORT)
    standing = RealSurface("panel", panel(), Role.ENVIRONMENT, removed=True)
    directions = pixel_directions(WIDTH // 2, WIDTH).reshape(-1, 3)
    hits = RayCaster([floor.mesh, standing.mesh]).cast(CAPTURE, directions)
    met = np.where(np.isfinite(hits.distance), hits.mesh, 2)
    shown = np.select([met == 1, met == 2], [glow, 1.0], 0.0)
    factor = form_factor(CAPTURE + hits.distance[met == 0, None] * directions[met == 0])
    shown[met == 0] = ALBEDO * (1.0 + factor * (glow - 1.0))
    radiance = np.repeat(shown.reshape(WIDTH // 2, WIDTH, 1), 3, axis=2).astype(np.float32)
    panorama = Panorama(radiance, CAPTURE, np.eye(3), sky=True)
    camera = CameraView(Equirectangular(type="equirectangular", width=WIDTH), CAPTURE, np.eye(3))
    settings = RenderSettings(irradiance_samples=128)
    return Scene(panorama, (floor, standing), (), {"pano": camera}, settings), met.reshape(WIDTH // 2, WIDTH)


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
    with pytest.raises(InputError, match="removed = true|removes nothing"):
        lightdepth.render(scene(1.0)[0], "pano", samples=1, method=method)


def test_a_declared_sun_refuses_it():
    sun = SunLight("sun", np.array([0.0, 0.0, 1.0]), 0.5, np.ones(3))
    with pytest.raises(InputError, match='"panel": removed = true and .*sun'):
        METHODS["difference"](replace(scene(1.0)[0], lights=(sun,)))
