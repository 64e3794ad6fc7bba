"""A declared sun in places whose light has a closed form."""

from dataclasses import replace

import numpy as np
import pytest

from lightdepth.kernel.start import start

start("cpu")

import drjit as dr  # noqa: E402
import mitsuba as mi  # noqa: E402

from lightdepth.api import begin_rendering  # noqa: E402
from lightdepth.directions import pixel_directions  # noqa: E402
from lightdepth.errors import InputError  # noqa: E402
from lightdepth.place.place import Place  # noqa: E402
from lightdepth.place.real_surfaces import merge_real_surfaces  # noqa: E402
from lightdepth.place.traced_surfaces import TracedSurfaces  # noqa: E402
from lightdepth.preparation.place import prepare_place  # noqa: E402
from lightdepth.recovery.irradiance import estimate_irradiance  # noqa: E402
from lightdepth.scene.lights.frame import azimuth_and_elevation, sun_axes, sun_direction  # noqa: E402
from lightdepth.scene.materials import Diffuse  # noqa: E402
from lightdepth.scene.model import (  # noqa: E402
    AnalyticShape,
    CameraView,
    Mesh,
    Panorama,
    RealSurface,
    RenderSettings,
    Role,
    Scene,
    SunLight,
    SyntheticObject,
    SyntheticPart,
)
from tests.chance import Seen, check_seen, mean_and_limit  # noqa: E402
from tests.transport.places import GREY, ball  # noqa: E402

HALF, HEIGHT = 2.0, 2.5
"""Of the room: from -HALF to HALF, and its height, metres."""
WINDOW = ((-0.5, 0.5), (1.0, 2.0))
"""In the wall at x = HALF: from and to along y and z."""
CAPTURE = np.array([-1.2, -1.2, 1.5])
SUN = SunLight("sun", sun_direction(90.0, 40.0), 0.53, np.array([900.0, 800.0, 600.0]))
ALBEDO = np.array([0.5, 0.4, 0.3])


def quad(*corners):
    """A rectangle by its corners in order."""
    return Mesh(np.array(corners, np.float32), np.array([[0, 1, 2], [0, 2, 3]], np.int32))


def surfaces(opening):
    """Floor, three walls, ceiling, and a wall around a window, which is a pane or a hole."""
    h, z = HALF, HEIGHT
    (y0, y1), (z0, z1) = WINDOW
    room = {
        "floor": quad([-h, -h, 0], [h, -h, 0], [h, h, 0], [-h, h, 0]),
        "ceiling": quad([-h, -h, z], [-h, h, z], [h, h, z], [h, -h, z]),
        "west": quad([-h, -h, 0], [-h, h, 0], [-h, h, z], [-h, -h, z]),
        "south": quad([-h, -h, 0], [-h, -h, z], [h, -h, z], [h, -h, 0]),
        "north": quad([-h, h, 0], [h, h, 0], [h, h, z], [-h, h, z]),
        "sill": quad([h, -h, 0], [h, -h, z0], [h, h, z0], [h, h, 0]),
        "lintel": quad([h, -h, z1], [h, -h, z], [h, h, z], [h, h, z1]),
        "left": quad([h, -h, z0], [h, -h, z1], [h, y0, z1], [h, y0, z0]),
        "right": quad([h, y1, z0], [h, y1, z1], [h, h, z1], [h, h, z0]),
    }
    real = [
        RealSurface(name, mesh, Role.SUPPORT if name == "floor" else Role.ENVIRONMENT) for name, mesh in room.items()
    ]
    if opening:
        pane = quad([h, y0, z0], [h, y0, z1], [h, y1, z1], [h, y1, z0])
        real.append(RealSurface("pane", pane, Role.ENVIRONMENT, opening=True))
    return tuple(real)


def lit(points):
    """Which points the middle of the sun shines on, shape (n,)."""
    direction = SUN.direction
    at = points + (HALF - points[:, :1]) / direction[0] * direction
    (y0, y1), (z0, z1) = WINDOW
    return (at[:, 1] > y0) & (at[:, 1] < y1) & (at[:, 2] > z0) & (at[:, 2] < z1)


def black_room(objects=(), opening=True, suns=(SUN,), **settings):
    """A room that is black but for the floor, whose patch of sun is all that its photograph shows."""
    directions = pixel_directions(256, 512)
    with np.errstate(divide="ignore"):
        floor = CAPTURE + directions * np.where(directions[..., 2:] < 0, -CAPTURE[2] / directions[..., 2:], 1e6)
    on_floor = (directions[..., 2] < 0) & (np.abs(floor[..., :2]) < HALF).all(axis=-1)
    patch = on_floor & lit(np.where(on_floor[..., None], floor, 0.0).reshape(-1, 3)).reshape(on_floor.shape)
    image = np.where(patch[..., None], ALBEDO * SUN.irradiance * SUN.direction[2] / np.pi, 0.0).astype(np.float32)
    from lightdepth.cameras import Perspective
    from lightdepth.directions import look_at_rotation

    camera = Perspective(type="perspective", width=96, height=64, fov=60)
    view = CameraView(camera, CAPTURE, look_at_rotation(CAPTURE, (0.5, 0.0, 0.2)))
    return Scene(
        Panorama(image, CAPTURE, np.eye(3), sky=True),
        surfaces(opening),
        tuple(objects),
        {"view": view},
        RenderSettings(**{"irradiance_samples": 256, **settings}),
        lights=tuple(suns),
    )


def place_of(scene):
    return Place(scene.panorama, TracedSurfaces(merge_real_surfaces(scene.real)), declared=scene.lights)


IN_PATCH = np.array([[0.2, 0.1, 0.0], [0.5, -0.2, 0.0]], np.float32)
BESIDE = np.array([[0.2, 1.2, 0.0], [-1.5, 0.0, 0.0]], np.float32)
UP = np.tile(np.array([0.0, 0.0, 1.0], np.float32), (2, 1))


@pytest.mark.parametrize("opening", [True, False], ids=["pane", "hole"])
def test_the_sun_lights_its_patch_alone(opening):
    assert lit(IN_PATCH).all()
    assert not lit(BESIDE).any()
    place = place_of(black_room(opening=opening))
    generator = np.random.default_rng(1)
    inside, _ = estimate_irradiance(place, IN_PATCH, UP, generator, 64)
    np.testing.assert_allclose(inside, np.tile(SUN.irradiance * SUN.direction[2], (2, 1)), rtol=2e-3)
    beside, _ = estimate_irradiance(place, BESIDE, UP, generator, 64)
    assert beside.max() < 1e-3 * inside.min() + 20.0  # From the patch itself comes nothing: the floor is flat.


def test_half_of_the_disc_lights_the_middle_of_the_penumbra():
    place = place_of(black_room())
    # Rays start a fraction of a millimetre above the floor, which lets in up to 2 % more.
    # The sill's edge, z = 1, along the sun's rays down to the floor.
    reach = WINDOW[1][0] / SUN.direction[2] * SUN.direction[0]
    edge = np.array([[HALF - reach, 0.0, 0.0], [HALF - reach, 0.2, 0.0]], np.float32)
    found, _ = estimate_irradiance(place, edge, UP, np.random.default_rng(2), 1 << 17)
    check_seen(found / (SUN.irradiance * SUN.direction[2]), Seen(11, 0.513, 0.513, 0.000187), 0.47, 0.53)


def test_light_paths_are_shared_by_what_stands_out_of_the_photograph():
    """Half of the sphere is three times as bright as the other: a quarter of its light lies above the mean.

    Photograph and sun are weighted by the squares of one quarter and three quarters.
    """
    image = np.ones((32, 64, 3), np.float32)
    image[:16] = 3.0
    scene = black_room()
    place = place_of(replace(scene, panorama=replace(scene.panorama, radiance=image)))
    assert place.standing_out == pytest.approx(0.25, abs=1e-6)
    np.testing.assert_allclose(place.path_shares, [0.1, 0.9], atol=1e-6)
    even = place_of(replace(scene, panorama=replace(scene.panorama, radiance=np.ones_like(image))))
    np.testing.assert_allclose(even.path_shares, [0.0, 1.0])


def test_a_mask_holds_back_its_share():
    right, up = sun_axes(SUN.direction)
    middle = IN_PATCH[0] @ np.stack([right, up], axis=1)
    mask = np.full((8, 8), 0.25, np.float32)
    extent = (middle[0] - 0.1, middle[1] - 0.1, middle[0] + 0.1, middle[1] + 0.1)
    place = place_of(black_room(suns=[replace(SUN, mask=mask, mask_extent=extent)]))
    found, _ = estimate_irradiance(place, IN_PATCH, UP, np.random.default_rng(3), 64)
    np.testing.assert_allclose(found[0], 0.25 * SUN.irradiance * SUN.direction[2], rtol=2e-3)
    assert found[1].max() < 1e-3 * found[0].min()


def test_a_place_without_light_but_the_sun_is_prepared_without_dividing_by_it():
    """At first, most of its vertices get no light at all: what edges deviate by there is relative to nothing."""
    prepared = prepare_place(black_room(irradiance_samples=64), infinite=True)
    assert (prepared.real.irradiance == 0.0).any()
    assert np.isfinite(prepared.real.irradiance).all()
    assert prepared.real.irradiance.max() > 0.0


def test_what_samples_and_rays_say_of_the_sun_agrees():
    place = place_of(black_room())
    point = mi.Point3f(*IN_PATCH[0].tolist())
    lights = place.presample_lights(np.random.default_rng(4), 4096)
    u = (dr.arange(mi.Float, 4096) + 0.5) / 4096
    light = place.sample_light(lights, u, dr.fma(u, 7.0, 0.3) - dr.floor(dr.fma(u, 7.0, 0.3)), place.shares)
    is_sun = light.light.numpy() == 1
    assert is_sun.sum() == 512
    direction, _, pdf = place.toward(light, point)
    ray = mi.Ray3f(point + mi.Vector3f(0.0, 0.0, 1e-3), direction)
    hit = place.surfaces.first_real(ray, mi.Bool(True))
    _, (radiance, looked_up, _) = place.arriving(ray, hit, hit.distance, mi.Bool(True))
    found = looked_up.numpy()[is_sun]
    assert (found > 0.0).mean() > 0.99  # A direction at the rim may be rounded out of the disc.
    np.testing.assert_allclose(0.125 * found[found > 0.0], pdf.numpy()[is_sun][found > 0.0], rtol=1e-5)
    met, drawn = (value.numpy()[:, is_sun][:, found > 0.0] for value in (radiance, light.radiance))
    np.testing.assert_allclose(met, drawn)
    # Uniform over the disc: the mean of 1 / density is its solid angle, over the share of the list.
    assert np.mean(1.0 / pdf.numpy()[is_sun]) == pytest.approx(8.0 * np.pi * np.radians(0.265) ** 2, rel=1e-4)


def test_an_object_in_the_patch_is_lit_and_takes_the_sun_from_the_floor():
    scene = black_room([ball(GREY, (0.3, 0.0, 0.25), 0.15)], max_bounces=1)
    rendering = begin_rendering(scene, "view", seed=1)
    frame = rendering.complete(64)
    on_ball = (frame.object_id == 1) & (frame.coverage == 1.0)
    normal = frame.normal[on_ball].astype(np.float64)
    facing = normal @ SUN.direction
    direct = np.array(GREY.color) / np.pi * SUN.irradiance * np.maximum(facing, 0.0)[:, None]
    sunny = facing > 0.2
    error = frame.synthetic[on_ball][sunny] - direct[sunny]
    # One bounce more than direct light: the floor's patch is in the photograph and lights the ball from below.
    check_seen(np.median(np.abs(error) / direct[sunny]), Seen(11, 0.00309, 0.00309, 0.00063), high=0.1)
    # In the shadow's core nothing is left of the patch.
    share = frame.change.sum(axis=-1) / np.maximum(frame.plate.sum(axis=-1), 1e-6)
    dark = share[(frame.plate.sum(axis=-1) > 10.0) & (frame.coverage == 0.0)]
    check_seen(dark.min(), Seen(11, -1.0, -1.0, 1.6e-05), low=-1.0 - 1e-3)
    check_seen((dark < -0.97).sum(), Seen(11, 88.0, 88.0, 0.0), low=20)
    without = begin_rendering(replace(scene, lights=()), "view", seed=1).complete(16)
    check_seen(
        without.synthetic[on_ball][sunny].mean() / frame.synthetic[on_ball][sunny].mean(),
        Seen(11, 0.00499, 0.00499, 0.000217),
        high=0.3,
    )


def test_beside_an_even_sky_the_sun_is_blocked_without_noise():
    """A black disc over a floor: the light that it takes has a closed form, for the sun and for the sky."""
    radius, height, sky = 0.5, 0.6, 2.0
    centre, direct = np.array([0.6, 0.0, height]), 4.0 * np.pi * sky
    direction = np.array([-1.0, 0.0, 2.0]) / np.sqrt(5.0)
    sun = SunLight("sun", direction, 0.53, np.full(3, direct / direction[2]))
    albedo, before = 0.05, direct + np.pi * sky  # Darker than the sky, which light samples are then of as well.
    down = pixel_directions(64, 128)[..., 2:] < 0.0
    image = np.where(down, albedo / np.pi * before, sky).astype(np.float32) * np.ones(3, np.float32)
    # It hides the sun from the capture point, and looks like the sky that it hides.
    capture = np.array([-3.0, 0.0, 2.0])
    at = capture + direction
    hidden = quad(
        *(at + np.array(corner) for corner in ([-0.1, -0.1, 0], [0.1, -0.1, 0], [0.1, 0.1, 0], [-0.1, 0.1, 0]))
    )
    floor = quad([-20, -20, 0], [20, -20, 0], [20, 20, 0], [-20, 20, 0])
    to_world = np.diag([radius, radius, 1.0, 1.0])
    to_world[:3, 3] = centre
    black = Diffuse(type="diffuse", color=(0.0, 0.0, 0.0))
    from lightdepth.cameras import Perspective
    from lightdepth.directions import look_at_rotation

    where = np.array([1.5, 0.0, 4.0])
    camera = Perspective(type="perspective", width=48, height=32, fov=30)
    scene = Scene(
        Panorama(image, capture, np.eye(3), sky=True),
        (RealSurface("floor", floor, Role.SUPPORT), RealSurface("shade", hidden, Role.ENVIRONMENT)),
        (SyntheticObject("disc", (SyntheticPart(AnalyticShape("disk", to_world), black),)),),
        {"view": CameraView(camera, where, look_at_rotation(where, (1.5, 1e-3, 0.0)))},
        RenderSettings(irradiance_samples=1024, max_bounces=1),
        lights=(sun,),
    )
    samples, repeats = 16, 12
    frames = [begin_rendering(scene, "view", seed=seed).complete(samples) for seed in range(repeats)]
    share = np.array([frame.change.mean(axis=-1) / frame.plate.mean(axis=-1) for frame in frames])
    row, column = np.mgrid[:32, :48] + 0.5
    across = 2.0 * where[2] * np.tan(np.radians(15.0)) / 48
    point = where[:2] + across * np.stack([column - 24.0, 16.0 - row], axis=-1)
    # Of a parallel disc, as seen from a point of the floor (Howell's catalogue of view factors).
    away = np.linalg.norm(point - centre[:2], axis=-1)
    z = away**2 + height**2 + radius**2
    sky_share = 0.5 * (1.0 - (z - 2.0 * radius**2) / np.sqrt(z**2 - 4.0 * (radius * away) ** 2))
    shadow = np.linalg.norm(point - (centre[:2] - height / direction[2] * direction[:2]), axis=-1)
    plain = frames[0].coverage == 0.0
    for region, blocked in ((shadow < radius - 0.06, 1.0), ((shadow > radius + 0.06) & (away < 1.2), 0.0)):
        inside = region & plain
        assert inside.sum() > 100
        taken = -share[:, inside]
        light = blocked * direct + np.pi * sky * sky_share[inside]
        ratio = taken.sum(axis=1) / (light / before).sum()
        mean, limit = mean_and_limit(ratio)  # 0.003 in the shadow, and 0.06 of the little that the sky sends beside it.
        assert abs(mean - 1.0) < limit + 0.005, f"{mean} {limit}"
        # One shadow ray for sun and sky together, where only the disc's bounding sphere is known.
        cone = np.minimum(radius**2 * height / (away[inside] ** 2 + height**2) ** 1.5, 1.0)
        most = direct + np.pi * sky * np.maximum(cone, sky_share[inside])
        one_draw = light * (most - light) / before**2 / samples
        check_seen(taken.var(axis=0, ddof=1).mean() / one_draw.mean(), Seen(11, 0.0419, 0.132, 0.00772), high=0.25)


def test_angles_and_directions():
    np.testing.assert_allclose(sun_direction(90.0, 0.0), [1.0, 0.0, 0.0], atol=1e-12)
    assert azimuth_and_elevation(sun_direction(200.0, 35.0)) == pytest.approx((200.0, 35.0))
    right, up = sun_axes(SUN.direction)
    np.testing.assert_allclose(np.cross(right, up), SUN.direction, atol=1e-12)


def test_the_method_of_the_paper_refuses_it():
    with pytest.raises(InputError, match="envpath"):
        begin_rendering(black_room([ball(Diffuse(type="diffuse", color=(0.5, 0.5, 0.5)))]), "view", method="envpath")
