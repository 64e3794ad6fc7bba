"""Every camera's rays against the formulas of its projection, written down independently in NumPy."""

import cv2
import numpy as np
import pytest

from lightdepth.kernel.start import start

start("cpu")

import mitsuba as mi  # noqa: E402
from pydantic import ValidationError  # noqa: E402

from lightdepth.cameras import (  # noqa: E402
    VR180,
    Cubemap,
    DomeMaster,
    DomeStereo,
    EquiAngularCubemap,
    Equirectangular,
    Fisheye,
    OmnidirectionalStereo,
    Perspective,
    StereoPerspective,
)
from lightdepth.directions import look_at_rotation, pixel_directions  # noqa: E402


def rays(camera, x, y, lens=(0.5, 0.5)):
    """Origins (n, 3), directions (n, 3) and inside (n,) at film positions."""
    x, y = np.broadcast_arrays(np.atleast_1d(x), np.atleast_1d(y))
    film = mi.Point2f(x.astype(np.float32), y.astype(np.float32))
    lens = mi.Point2f(*(np.broadcast_to(part, x.shape).astype(np.float32) for part in lens))
    origin, direction, inside = camera.camera_rays(film, lens)
    every = np.zeros((x.size, 3), np.float32)
    return origin.numpy().T + every, direction.numpy().T + every, inside.numpy() & np.ones(x.size, bool)


def film_grid(width, height):
    x, y = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    return x.ravel(), y.ravel()


def test_equirectangular_has_the_panoramas_layout():
    camera = Equirectangular(type="equirectangular", width=64)
    assert camera.resolution == (64, 32)
    _, direction, inside = rays(camera, *film_grid(64, 32))
    np.testing.assert_allclose(direction, pixel_directions(32, 64).reshape(-1, 3), atol=1e-6)
    assert inside.all()


@pytest.mark.parametrize("mapping", ["equidistant", "equisolid"])
@pytest.mark.parametrize("fov", [90.0, 180.0, 220.0, 360.0])
def test_fisheye_radius_and_angle(mapping, fov):
    camera = Fisheye(type="fisheye", width=51, fov=fov, mapping=mapping)
    x, y = film_grid(51, 51)
    _, direction, inside = rays(camera, x, y)
    right, up = 2 * x - 1, 1 - 2 * y
    radius = np.hypot(right, up)
    np.testing.assert_array_equal(inside, radius <= 1)
    np.testing.assert_allclose(np.linalg.norm(direction, axis=1)[inside], 1, atol=1e-6)
    theta = np.arctan2(np.hypot(direction[inside, 0], direction[inside, 2]), direction[inside, 1])
    radius = radius[inside]
    if mapping == "equidistant":
        expected = radius * np.radians(fov) / 2
    else:
        # An image of a solid angle has an area in proportion to it: r^2 ~ 1 - cos(theta).
        expected = np.arccos(1 - radius**2 * (1 - np.cos(np.radians(fov) / 2)))
    np.testing.assert_allclose(theta, expected, atol=2e-3 if fov == 360.0 else 2e-4)
    # To the right is +x and upward +z, all around.
    off_axis = (radius > 0.05) & (radius < 0.95)
    azimuth = np.arctan2(direction[inside, 2], direction[inside, 0])
    expected_azimuth = np.arctan2(up[inside], right[inside])
    turned = np.angle(np.exp(1j * (azimuth - expected_azimuth)))
    assert np.abs(turned[off_axis]).max() < 1e-3


def test_perspective_fov_is_horizontal_whatever_the_height():
    for height in (20, 40, 80):
        camera = Perspective(type="perspective", width=40, height=height, fov=70)
        _, direction, _ = rays(camera, [0.0, 1.0, 0.5, 0.5], [0.5, 0.5, 0.0, 1.0])
        left, right, top, bottom = direction
        assert np.degrees(np.arctan2(right[0], right[1])) == pytest.approx(35, abs=1e-3)
        assert np.degrees(np.arctan2(left[0], left[1])) == pytest.approx(-35, abs=1e-3)
        half = np.tan(np.radians(35)) * height / 40
        assert top[2] / top[1] == pytest.approx(half, rel=1e-5)
        assert bottom[2] / bottom[1] == pytest.approx(-half, rel=1e-5)


def test_shift_moves_the_image_and_keeps_its_plane():
    plain = Perspective(type="perspective", width=40, height=30, fov=60)
    shifted = Perspective(type="perspective", width=40, height=30, fov=60, shift=(0.25, -0.1))
    x, y = film_grid(8, 6)
    _, expected, _ = rays(plain, x + 0.25, y + 0.1 * 40 / 30)
    _, direction, _ = rays(shifted, x, y)
    np.testing.assert_allclose(direction, expected, atol=1e-6)


@pytest.mark.parametrize("distortion", [(-0.2, 0.05), (0.15, 0.1), (-0.12, 0.0)])
def test_distortion_and_principal_point_are_those_of_opencv(distortion):
    """Film positions of points by another's implementation; the rays through them meet the points."""
    camera = Perspective(
        type="perspective", width=640, height=480, fov=72, principal_point=(0.47, 0.54), distortion=distortion
    )
    focal = 320 / np.tan(np.radians(36))
    generator = np.random.default_rng(5)
    points = generator.uniform((-0.55, 1.0, -0.38), (0.55, 1.0, 0.38), (300, 3)) * generator.uniform(0.5, 9.0, (300, 1))
    matrix = np.array([[focal, 0, 0.47 * 640], [0, focal, 0.54 * 480], [0, 0, 1]])
    seen, _ = cv2.projectPoints(
        points[:, [0, 2, 1]] * [1, -1, 1], np.zeros(3), np.zeros(3), matrix, np.array([*distortion, 0, 0])
    )
    film = seen[:, 0] / [640, 480]
    assert (film > 0).all()
    assert (film < 1).all()
    _, direction, _ = rays(camera, *film.T)
    np.testing.assert_allclose(direction, points / np.linalg.norm(points, axis=1)[:, None], atol=2e-6)
    np.testing.assert_allclose(camera.film_of(points)[0], film, atol=1e-9)
    np.testing.assert_allclose(camera.directions_of(film), points / points[:, 1:2], atol=1e-8)
    shown = camera.film_point(mi.Point3f(*points.T.astype(np.float32)), mi.Point2f(0.5))
    np.testing.assert_allclose(shown.film.numpy().T, film, atol=1e-6)


def test_distortion_does_not_fold_what_is_far_outside_into_the_picture():
    """Beyond the fold the polynomial comes back to the middle."""
    camera = Perspective(type="perspective", width=64, height=48, fov=60, distortion=(-0.25, 0.0))
    back = np.sqrt(1 / 0.25)  # Where it is zero again.
    points = np.array([[back, 1.0, 0.0], [0.9 * back, 1.0, 0.2], [0.1, 1.0, 0.0]])
    shown = camera.film_point(mi.Point3f(*points.T.astype(np.float32)), mi.Point2f(0.5))
    np.testing.assert_array_equal(shown.inside.numpy(), [False, False, True])
    np.testing.assert_array_equal(camera.film_of(points)[1], [False, False, True])


def test_look_at_puts_the_target_in_the_middle_and_keeps_the_horizon():
    position, target = np.array([1.0, -2.0, 1.5]), np.array([-0.5, 2.0, 0.3])
    rotation = look_at_rotation(position, target)
    forward = (target - position) / np.linalg.norm(target - position)
    np.testing.assert_allclose(rotation @ [0, 1, 0], forward, atol=1e-9)
    np.testing.assert_allclose(rotation.T @ rotation, np.eye(3), atol=1e-9)
    assert abs((rotation @ [1, 0, 0])[2]) < 1e-9
    assert (rotation @ [0, 0, 1])[2] > 0


def test_depth_of_field_is_sharp_at_focus_and_blurs_by_the_circle_of_confusion():
    aperture, focus = 0.05, 2.0
    camera = Perspective(type="perspective", width=400, height=300, fov=60, aperture=aperture, focus_distance=focus)
    generator = np.random.default_rng(1)
    lens = generator.random((2, 4000))
    x, y = 0.7, 0.4
    origin, direction, _ = rays(camera, np.full(4000, x), y, lens)
    sharp, _, _ = rays(camera, x, y, (0.5, 0.5))
    assert np.hypot(origin[:, 0], origin[:, 2]).max() == pytest.approx(aperture, rel=0.01)
    np.testing.assert_allclose(origin[:, 1], 0, atol=1e-7)
    # Uniform over the lens: the mean squared radius of a disk is half of its square.
    assert np.mean(origin[:, 0] ** 2 + origin[:, 2] ** 2) == pytest.approx(aperture**2 / 2, rel=0.05)
    for distance in (0.5, 1.0, 2.0, 4.0, 50.0):
        at = origin + direction * ((distance - origin[:, 1]) / direction[:, 1])[:, None]
        spread = np.linalg.norm(at - at.mean(axis=0), axis=1).max()
        circle = aperture * abs(distance - focus) / focus
        assert spread == pytest.approx(circle, rel=0.06, abs=5e-5)
    np.testing.assert_allclose(sharp, 0, atol=1e-6)


@pytest.mark.parametrize(
    ("camera", "settings"),
    [
        (Equirectangular, {"type": "equirectangular", "width": 33}),
        (Fisheye, {"type": "fisheye", "width": 32, "fov": 361}),
        (Fisheye, {"type": "fisheye", "width": 32, "mapping": "stereographic"}),
        (Perspective, {"type": "perspective", "width": 32, "height": 32, "fov": 180}),
        (Perspective, {"type": "perspective", "width": 32, "height": 32, "look_at": (0, 1, 0), "rotation": (0, 0, 0)}),
        (Perspective, {"type": "perspective", "width": 32, "height": 32, "aperture": 0.1}),
        (Perspective, {"type": "perspective", "width": 9, "height": 9, "shift": (1, 0), "principal_point": (0, 0)}),
        (Perspective, {"type": "perspective", "width": 32, "height": 32, "fov": 90, "distortion": (-0.3, 0.0)}),
        (Cubemap, {"type": "cubemap", "width": 64}),
        (Cubemap, {"type": "cubemap", "width": 63, "layout": "strip"}),
        (OmnidirectionalStereo, {"type": "ods", "width": 66}),
        (OmnidirectionalStereo, {"type": "ods", "width": 64, "zenith_merge": (70, 60)}),
        (OmnidirectionalStereo, {"type": "ods", "width": 64, "nadir_merge": (70, 95)}),
        (OmnidirectionalStereo, {"type": "ods", "width": 64, "convergence_distance": 0.05}),
        (DomeMaster, {"type": "dome_master", "width": 8193}),
        (DomeMaster, {"type": "dome_master", "width": 64, "fov": 221}),
        (DomeMaster, {"type": "dome_master", "width": 64, "tilt": -1}),
        (DomeStereo, {"type": "dome_stereo", "width": 8193}),
        (DomeStereo, {"type": "dome_stereo", "width": 64, "zenith_merge": (70, 60)}),
        (VR180, {"type": "vr180", "width": 65}),
        (EquiAngularCubemap, {"type": "eac", "width": 64}),
        (StereoPerspective, {"type": "stereo_perspective", "width": 65, "height": 32}),
        (StereoPerspective, {"type": "stereo_perspective", "width": 64, "height": 33, "layout": "top-bottom"}),
        (StereoPerspective, {"type": "stereo_perspective", "width": 64, "height": 32, "aperture": 0.1}),
    ],
)
def test_impossible_cameras_are_refused(camera, settings):
    with pytest.raises(ValidationError):
        camera(**settings)


CAMERAS = {
    "panorama": Equirectangular(type="equirectangular", width=64),
    "dome": Fisheye(type="fisheye", width=51, fov=220),
    "equisolid dome": Fisheye(type="fisheye", width=51, fov=180, mapping="equisolid"),
    "view": Perspective(type="perspective", width=40, height=30, fov=70, shift=(0.2, -0.1)),
    "distorted view": Perspective(
        type="perspective", width=40, height=30, fov=75, principal_point=(0.46, 0.55), distortion=(-0.22, 0.06)
    ),
    "distorted lens": Perspective(
        type="perspective", width=40, height=30, fov=50, aperture=0.1, focus_distance=2.0, distortion=(0.3, -0.1)
    ),
    "lens": Perspective(type="perspective", width=40, height=30, fov=50, aperture=0.3, focus_distance=2.0),
    "cubemap": Cubemap(type="cubemap", width=60),
    "strip": Cubemap(type="cubemap", width=60, layout="strip"),
    "stereo": OmnidirectionalStereo(type="ods", width=64),
    "side by side": OmnidirectionalStereo(
        type="ods",
        width=64,
        layout="side-by-side",
        zenith_merge=(20, 85),
        nadir_merge=(90, 90),
        interocular_distance=0.2,
    ),
    "convergent stereo": OmnidirectionalStereo(type="ods", width=64, convergence_distance=1.95, nadir_merge=(45, 90)),
    "faces": Cubemap(type="cubemap", width=20, layout="separate"),
    "equi-angular cubemap": EquiAngularCubemap(type="eac", width=60),
    "dome master": DomeMaster(type="dome_master", width=51, fov=200, tilt=25),
    "stereo dome": DomeStereo(
        type="dome_stereo", width=51, fov=170, tilt=15, convergence_distance=4.0, zenith_merge=(50, 85)
    ),
    "stereo dome side by side": DomeStereo(
        type="dome_stereo", width=102, fov=160, layout="side-by-side", zenith_merge=(90, 90)
    ),
    "vr180": VR180(type="vr180", width=80, interocular_distance=0.2),
    "stereo view": StereoPerspective(
        type="stereo_perspective",
        width=80,
        height=30,
        fov=70,
        shift=(0.1, -0.1),
        interocular_distance=0.2,
        convergence_distance=1.5,
        aperture=0.1,
        focus_distance=2.0,
    ),
}
ALL_AROUND = {
    "panorama",
    "cubemap",
    "strip",
    "faces",
    "equi-angular cubemap",
    "stereo",
    "side by side",
    "convergent stereo",
}


def of_right_eye(camera, x, y):
    """1 where the film shows the right eye's view, else 0, also for a camera without eyes."""
    if "left" not in camera.topology.views:
        return 0.0 * x
    return np.where((x if camera.layout == "side-by-side" else y) >= 0.5, 1.0, 0.0)


def off_seams(x):
    """Positions on the film moved off the edges of a cubemap's faces and of a stereo camera's views."""
    return np.where(np.abs(x * 6 - np.round(x * 6)) < 0.02, x + 0.01, x)


@pytest.mark.parametrize("name", CAMERAS)
def test_the_film_shows_a_point_where_its_ray_leaves(name):
    camera = CAMERAS[name]
    generator = np.random.default_rng(1)
    x, y, *lens = generator.uniform(0.02, 0.98, (4, 500)).astype(np.float32)
    origin, direction, inside = rays(camera, x, y, lens)
    if "left" in camera.topology.views:  # The eye that shows the point is picked by the first number.
        lens[0] = 0.5 * lens[0] + 0.5 * of_right_eye(camera, x, y)
    target = origin + direction * generator.uniform(0.3, 9.0, (500, 1))
    target[::100, 1] = -np.abs(target[::100, 1]) - 5.0  # Behind the camera.
    target[::100, ::2] = 0.01
    shown = camera.film_point(
        mi.Point3f(*target.T.astype(np.float32)), mi.Point2f(*(np.float32(part) for part in lens))
    )
    start_point, film = shown.origin, shown.film
    seen = shown.inside.numpy() & np.ones(500, bool)
    behind = np.arange(500) % 100 == 0
    kept = inside & ~behind
    assert seen[kept].all()
    assert seen[behind].all() == (name in ALL_AROUND)
    np.testing.assert_allclose((start_point.numpy().T + np.zeros((500, 3)))[kept], origin[kept], atol=1e-6)
    np.testing.assert_allclose(film.numpy().T[kept], np.stack([x, y], axis=1)[kept], atol=3e-5)


@pytest.mark.parametrize("name", CAMERAS)
def test_what_a_place_of_the_film_stands_for(name):
    """The area across the ray that a unit of film covers at a distance, by differences; both eyes show a point."""
    camera = CAMERAS[name]
    places = 2.0 if "left" in camera.topology.views else 1.0
    generator = np.random.default_rng(3)
    x, y = generator.uniform(0.05, 0.95, (2, 300))
    x, y = off_seams(x), off_seams(y)
    lens = np.full(300, 0.4), np.full(300, 0.3)
    distance, step = generator.uniform(0.3, 3.0, (300, 1)), 1e-3

    def at(x, y):
        origin, direction, _ = rays(camera, x, y, lens)
        return origin.astype(np.float64) + direction * distance

    _, direction, inside = rays(camera, x, y, lens)
    across = (at(x + step, y) - at(x - step, y)) / (2 * step)
    along = (at(x, y + step) - at(x, y - step)) / (2 * step)
    covered = np.abs(np.sum(np.cross(across, along) * direction, axis=1))
    target = mi.Point3f(*at(x, y).T.astype(np.float32))
    eye = lens[0] if places == 1.0 else 0.5 * (lens[0] + of_right_eye(camera, x, y))
    shown = camera.film_point(target, mi.Point2f(*(part.astype(np.float32) for part in (eye, lens[1]))))
    angle = camera.solid_angle(mi.Vector3f(*direction.T.astype(np.float32))).numpy() * np.ones(300)
    weight = shown.weight.numpy() * np.ones(300)
    inside &= shown.inside.numpy() & np.ones(300, bool)
    assert inside.mean() > 0.6
    np.testing.assert_allclose(weight[inside], (places * angle * distance[:, 0] ** 2 / covered)[inside], rtol=5e-3)


# Through the rim of a lens that distorts, the solid angle is the weight's matter: see the test before.
@pytest.mark.parametrize("name", sorted(CAMERAS.keys() - {"distorted lens"}))
def test_solid_angle_is_that_between_neighbouring_rays(name):
    camera = CAMERAS[name]
    generator = np.random.default_rng(2)
    x, y, *lens = generator.uniform(0.15, 0.85, (4, 200))
    x, y = off_seams(x), off_seams(y)
    step = 1e-3
    _, direction, inside = rays(camera, x, y, lens)
    _, right, _ = rays(camera, x + step, y, lens)
    _, left, _ = rays(camera, x - step, y, lens)
    _, above, _ = rays(camera, x, y + step, lens)
    _, below, _ = rays(camera, x, y - step, lens)
    found = np.linalg.norm(np.cross(right - left, above - below), axis=1) / (2 * step) ** 2
    wanted = camera.solid_angle(mi.Vector3f(*direction.T.astype(np.float32))).numpy() * np.ones(200)
    np.testing.assert_allclose(found[inside], wanted[inside], rtol=2e-3)
