"""What a polished floor mirrors, in the plate of a camera that stands elsewhere."""

from dataclasses import replace

import numpy as np
import pytest

from lightdepth.cameras import Perspective
from lightdepth.directions import look_at_rotation, pixel_directions
from lightdepth.kernel.start import start

start("cpu")

import lightdepth  # noqa: E402
from lightdepth.film.plate import render_plate  # noqa: E402
from lightdepth.parameters import Parameters, RecoveryParameters  # noqa: E402
from lightdepth.place.support_scattering import index_of_refraction  # noqa: E402
from lightdepth.preparation.place import prepare_place  # noqa: E402
from lightdepth.scene.materials import MitsubaBsdf  # noqa: E402
from lightdepth.scene.model import (  # noqa: E402
    AnalyticShape,
    CameraView,
    Gloss,
    Panorama,
    RenderSettings,
    Scene,
    SyntheticObject,
    SyntheticPart,
)
from tests.transport.places import CAPTURE, HIGH, box_depth, room  # noqa: E402
from tests.transport.places import with_floor_alone_as_support as with_floor  # noqa: E402

WINDOW = np.array([[-0.6, 1.0], [0.7, 1.9]])
"""Along x and z, in the wall at the largest y."""
BRIGHT, WALL, DIFFUSE = 10.0, 0.5, 0.2
GLOSS = Gloss(0.04, 1.0)
FEW = Parameters(recovery=RecoveryParameters(gloss_points=512, mirrored_samples=16))


def shown(points, eye):
    """What the room sends from places on it to an eye, and the reflectance of its floor toward the eye."""
    x, y, z = np.moveaxis(points, -1, 0)
    window = (y > HIGH[1] - 1e-4) & (x > WINDOW[0, 0]) & (x < WINDOW[0, 1]) & (z > WINDOW[1, 0]) & (z < WINDOW[1, 1])
    return np.where(window, BRIGHT, WALL)


def mirrored(points, eye):
    """What a mirror in place of the floor would send to an eye, times Fresnel's reflectance."""
    direction = points - eye
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    reflected = direction * [1.0, 1.0, -1.0]
    met = points + reflected * box_depth(reflected, points + [0.0, 0.0, 1e-6])[..., None]
    cosine, index = -direction[..., 2], index_of_refraction(GLOSS.specular)
    inside = np.sqrt(index**2 - 1.0 + cosine**2)
    across, along = (cosine - inside) / (cosine + inside), (index**2 * cosine - inside) / (index**2 * cosine + inside)
    return shown(met, eye) * 0.5 * (across**2 + along**2)


def seen(directions, eye):
    """The picture of the room with its polished floor, and the places that it shows."""
    points = eye + directions * box_depth(directions, eye)[..., None]
    floor = points[..., 2] < 1e-4
    radiance = shown(points, eye)
    radiance[floor] = DIFFUSE + mirrored(points[floor], eye)
    return radiance, floor


@pytest.fixture(scope="module")
def scene():
    radiance, _ = seen(pixel_directions(128, 256), CAPTURE)
    image = np.repeat(radiance[..., None], 3, axis=2).astype(np.float32)
    empty = with_floor(room(image, rotation=(0, 0, 0), gloss=GLOSS, irradiance_samples=64))
    return Scene(
        Panorama(image, CAPTURE, np.eye(3)), empty.real, render=RenderSettings(irradiance_samples=64, parameters=FEW)
    )


def camera_at(position, target, fov):
    """A camera, and the unit directions of its pixels."""
    camera = Perspective(type="perspective", width=48, height=36, fov=fov)
    view = CameraView(camera, position, look_at_rotation(position, target))
    y, x = np.mgrid[:36, :48] + 0.5
    across = np.tan(np.radians(0.5 * fov))
    local = np.stack([(x / 24 - 1) * across, np.ones_like(x), (1 - y / 18) * across * 0.75], axis=-1)
    directions = local @ view.rotation.T
    return view, directions / np.linalg.norm(directions, axis=-1, keepdims=True)


def plate(scene, position, target):
    view, directions = camera_at(position, target, 80.0)
    result, _ = render_plate(view, scene.panoramas, prepare_place(scene).place)
    return result.mean(axis=2), directions


def test_a_camera_elsewhere_sees_the_window_where_the_floor_mirrors_it_to_it(scene):
    position = CAPTURE + [1.0, -0.3, -0.2]
    result, directions = plate(scene, position, np.array([0.4, 1.6, 0.0]))
    expected, floor = seen(directions, position)
    matte, _ = plate(
        replace(scene, real=tuple(replace(each, gloss=None) for each in scene.real)),
        position,
        np.array([0.4, 1.6, 0.0]),
    )
    error, without = (np.abs(each - expected)[floor].mean() / expected[floor].mean() for each in (result, matte))
    assert without > 0.2
    assert error < 0.25 * without


def test_from_the_capture_point_the_plate_is_the_photograph(scene):
    result, _ = plate(scene, CAPTURE, np.array([0.4, 1.6, 0.0]))
    matte, _ = plate(
        replace(scene, real=tuple(replace(each, gloss=None) for each in scene.real)), CAPTURE, np.array([0.4, 1.6, 0.0])
    )
    np.testing.assert_array_equal(result, matte)


def test_a_mirror_shows_the_floor_as_it_is_seen_from_there(scene):
    """A hand mirror, too small to change the floor: behind it, the camera has an eye that sees the floor from elsewhere."""
    position, middle, half = np.array([0.4, 1.2, 0.7]), np.array([0.4, 0.1, 0.5]), 0.1
    to_world = np.eye(4)
    normal = np.array([0.0, 0.984, -0.179]) / np.hypot(0.984, 0.179)
    to_world[:3, :3] = half * np.stack([[1.0, 0.0, 0.0], np.cross(normal, [1.0, 0.0, 0.0]), normal], axis=1)
    to_world[:3, 3] = middle
    silver = MitsubaBsdf(type="mitsuba", mitsuba={"type": "conductor", "material": "none"})
    mirror = SyntheticObject("mirror", (SyntheticPart(AnalyticShape("rectangle", to_world), silver),))
    view, directions = camera_at(position, middle, 12.0)
    eye = position - 2.0 * ((position - middle) @ normal) * normal
    expected, floor = seen(directions - 2.0 * (directions @ normal)[..., None] * normal, eye)

    def error(real):
        frame = lightdepth.render(
            replace(scene, real=real, synthetic=(mirror,), cameras={"view": view}), "view", samples=64
        )
        shown = floor & (frame.coverage == 1.0)
        assert shown.sum() > 300
        return np.abs(frame.synthetic.mean(axis=2) - expected)[shown].mean() / expected[shown].mean()

    without = error(tuple(replace(each, gloss=None) for each in scene.real))
    assert without > 0.2
    assert error(scene.real) < 0.25 * without
