"""Several photographs of one place: how they are weighted, what the place then looks like, and how its light is drawn."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from lightdepth.kernel.start import start

start("cpu")

import drjit as dr  # noqa: E402
import mitsuba as mi  # noqa: E402

from lightdepth.cameras import Equirectangular, Perspective  # noqa: E402
from lightdepth.directions import look_at_rotation, pixel_directions  # noqa: E402
from lightdepth.film.plate import render_plate  # noqa: E402
from lightdepth.kernel.raycasting import RayCaster  # noqa: E402
from lightdepth.lightmap.depth_meshes import meshes_from_depth  # noqa: E402
from lightdepth.place.photographs import Photographs  # noqa: E402
from lightdepth.place.place import Place  # noqa: E402
from lightdepth.place.real_surfaces import merge_real_surfaces  # noqa: E402
from lightdepth.place.traced_surfaces import TracedSurfaces  # noqa: E402
from lightdepth.recovery.irradiance import estimate_irradiance  # noqa: E402
from lightdepth.scene.model import CameraView, Mesh, RealSurface, Role  # noqa: E402
from tests.chance import FALSE_ALARM, Seen, check_seen  # noqa: E402
from tests.place.test_light_sampling import bin_of, expected_shares  # noqa: E402
from tests.place.virtual_room import CAPTURES, REAL, photograph, radiance  # noqa: E402

BETWEEN = np.array([0.1, 1.2, 1.3])
"""Where the pillar hides none of the two captures."""


@pytest.fixture(scope="module")
def surfaces():
    return TracedSurfaces(merge_real_surfaces(REAL))


@pytest.fixture(scope="module")
def captures():
    return [photograph(CAPTURES[0], turn=(0, 0, 20)), photograph(CAPTURES[1], turn=(0, 3, -50))]


@pytest.fixture(scope="module")
def place(surfaces, captures):
    return Place(captures, surfaces)


@pytest.fixture(scope="module")
def floor():
    """Points of the floor all around the pillar, and their irradiance."""
    generator = np.random.Generator(np.random.PCG64(0))  # The same points with every seed of `tests.machine`.
    points = generator.uniform([-2.8, -1.8, 1e-3], [2.8, 1.8, 1e-3], (24, 3))
    points = points[np.abs(points[:, :2]).max(axis=1) > 0.5]
    caster, count = RayCaster([surface.mesh for surface in REAL]), 1 << 16
    u, phi = (np.arange(count) + 0.5) / count, 2.0 * np.pi * np.mod(np.arange(count) * 0.6180339887, 1.0)
    directions = np.stack([np.sqrt(u) * np.cos(phi), np.sqrt(u) * np.sin(phi), np.sqrt(1.0 - u)], axis=1)
    met = [point + caster.cast(point, directions).distance[:, None] * directions for point in points]
    return points.astype(np.float32), np.array([np.pi * radiance(each).mean(axis=0) for each in met])


def irradiance(place, points, samples=1 << 14):
    return estimate_irradiance(
        place, points, np.tile(np.float32([0, 0, 1]), (len(points), 1)), np.random.default_rng(1), samples
    )[0]


def rays_from(origin, count=4096):
    """Evenly spread, always the same ones."""
    z, phi = 1.0 - (2.0 * np.arange(count) + 1.0) / count, 2.0 * np.pi * np.mod(np.arange(count) * 0.6180339887, 1.0)
    direction = np.stack([np.sqrt(1.0 - z**2) * np.cos(phi), np.sqrt(1.0 - z**2) * np.sin(phi), z])
    return mi.Ray3f(mi.Point3f(origin), mi.Vector3f(direction.astype(np.float32)))


def shares(place, origin):
    ray = rays_from(origin)
    hit = place.surfaces.first_real(ray, mi.Bool(True))
    return hit, np.array([share.numpy() for share in place.photograph.shares(hit, ray)])


def test_the_shares_add_up_where_anything_is_seen(place):
    _, both = shares(place, BETWEEN)
    total = both.sum(axis=0)
    assert np.isclose(total, 1.0, atol=1e-6).mean() > 0.9
    assert np.allclose(total[~np.isclose(total, 1.0, atol=1e-6)], 0.0)
    assert ((both > 0.05) & (both < 0.95)).any(axis=0).mean() > 0.2


@pytest.mark.parametrize("own", [0, 1])
def test_at_a_capture_point_its_photograph_is_seen_alone(place, own):
    _, both = shares(place, CAPTURES[own])
    # At edges, the pixel's centre and the ray may meet different surfaces.
    assert (both[own] > 1.0 - 1e-3).mean() > 0.995


def test_what_one_photograph_cannot_see_is_the_others(place):
    """Points behind the pillar as each capture point sees it, by casting rays."""
    hit, both = shares(place, BETWEEN)
    caster, points = RayCaster([surface.mesh for surface in REAL]), hit.point.numpy().T
    for index, capture in enumerate(CAPTURES):
        offset = points - capture
        distance = np.linalg.norm(offset, axis=1)
        hidden = caster.cast(capture, offset / distance[:, None]).distance < 0.7 * distance
        assert hidden.mean() > 0.03
        assert both[index, hidden].max() < 0.02


def test_nothing_jumps_when_the_camera_moves(place):
    """The shares of fixed points, for a camera that goes from one capture point to the other in steps of 2 cm."""
    hit, _ = shares(place, BETWEEN)
    way = np.linspace(*CAPTURES + [[0.0, 1.0, 0.0]], 200)
    steps = []
    for origin in way:
        ray = mi.Ray3f(mi.Point3f(origin), dr.normalize(mi.Vector3f(hit.point - mi.Point3f(origin))))
        front = (dr.dot(hit.normal, ray.d) < 0.0).numpy()
        steps.append(np.where(front, place.photograph.shares(hit, ray)[0].numpy(), np.nan))
    assert np.nanmax(np.abs(np.diff(steps, axis=0))) < 0.1


def test_a_camera_elsewhere_sees_what_one_capture_hides(surfaces):
    camera = Perspective(type="perspective", width=64, height=48, fov=70)
    position = np.array([1.0, 0.0, 1.3])
    view = CameraView(camera, position, look_at_rotation(position, (0.0, -1.2, 1.0)))
    column, row = np.meshgrid(np.arange(64), np.arange(48))
    middle = mi.Point2f(0.5, 0.5)
    ray = view.pixel_rays(*(mi.Float(np.float32(each.ravel())) for each in (column, row)), middle, middle).ray
    hit = surfaces.first_real(ray, mi.Bool(True))
    truth = radiance(hit.point.numpy().T.astype(np.float64), lamp=0.0).reshape(48, 64, 3)
    without_lamp = [photograph(each, lamp=0.0) for each in CAPTURES]

    def error(some):
        plate, _ = render_plate(view, some, Place(some, surfaces))
        return np.sqrt(np.mean(np.square(plate - truth)))

    assert error(without_lamp) < error(without_lamp[:1]) / 3.0


def test_one_photograph_twice_is_that_photograph(surfaces, captures, floor):
    points, _ = floor
    one, twice = Place(captures[:1], surfaces), Place([captures[0]] * 2, surfaces)
    once, again = (irradiance(place, points) for place in (one, twice))
    check_seen(np.sqrt(np.mean((once / again - 1.0) ** 2)), Seen(11, 0.00345, 0.00345, 0.000739), high=0.03)
    check_seen(again.mean() / once.mean() - 1.0, Seen(11, 0.00122, 0.00122, 0.000824), -0.015, 0.015)
    ray = rays_from(BETWEEN)
    hit = surfaces.first_real(ray, mi.Bool(True))
    pictures = [place.photograph.sharp(hit, ray).numpy() for place in (one, twice)]
    alone = Photographs(captures[:1], surfaces).sharp(hit, ray).numpy()
    np.testing.assert_allclose(pictures[1], alone, rtol=2e-4, atol=1e-5)
    # At edges, several photographs show nothing of what stands beside a surface.
    assert np.isclose(*pictures, rtol=2e-4).all(axis=0).mean() > 0.8


def test_two_captures_give_the_irradiance_that_one_cannot(place, surfaces, captures, floor):
    points, truth = floor
    both = irradiance(place, points) / truth - 1.0
    alone = irradiance(Place(captures[:1], surfaces), points) / truth - 1.0
    check_seen(abs(alone.mean()), Seen(11, 0.158, 0.158, 0.000359), low=0.05)
    check_seen(both.mean(), Seen(11, 0.000469, 0.000469, 0.000309), -0.005, 0.005)
    check_seen(np.sqrt(np.mean(both**2)), Seen(11, 0.00314, 0.00314, 0.000278), high=0.02)


def test_in_a_furnace_the_irradiance_is_pi(surfaces, captures, floor):
    white = [replace(each, radiance=np.ones_like(each.radiance)) for each in captures]
    found = irradiance(Place(white, surfaces), floor[0], 1 << 16)
    check_seen(found / np.pi, Seen(11, 0.999, 1.0, 0.000808), 0.98, 1.02)
    check_seen(found.mean() / np.pi, Seen(11, 0.999, 0.999, 5.79e-05), 0.998, 1.002)


@pytest.mark.parametrize("point", [BETWEEN, np.array([-1.5, -1.2, 0.1])], ids=str)
def test_samples_follow_their_common_density(place, point):
    number = 1 << 16
    lights = place.presample_lights(np.random.default_rng(5), number)
    light = lights.sample((dr.arange(mi.Float, number) + 0.5) / number, mi.Bool(True))
    direction, distance, pdf = place.toward(light, mi.Point3f(point))
    ray = mi.Ray3f(mi.Point3f(point), direction)
    ray.maxt = 0.999 * distance
    kept = (~place.surfaces.real.ray_test(ray) & (pdf > 0.0)).numpy()
    observed = np.bincount(bin_of(direction.numpy())[kept], minlength=512)
    expected = expected_shares(place, point, 768) * number
    enough = expected > 10
    statistic = ((observed - expected)[enough] ** 2 / expected[enough]).sum()
    # A density that is off by a twelfth here and there is caught.
    assert chi2.sf(statistic, int(enough.sum()) - 1) > FALSE_ALARM


def test_light_samples_and_lookups_agree(place):
    lights = place.presample_lights(np.random.default_rng(6), 4096)
    point = mi.Point3f(BETWEEN)
    light = lights.sample((dr.arange(mi.Float, 4096) + 0.5) / 4096, mi.Bool(True))
    direction, distance, pdf = place.toward(light, point)
    hit = place.surfaces.first_real(mi.Ray3f(point, direction), mi.Bool(True))
    found, looked_up = seen_along(place, hit, direction)
    valid = ((pdf > 0.0) & (dr.abs(hit.distance - distance) < 1e-3 * distance)).numpy()
    check_seen(valid.mean(), Seen(11, 0.992, 0.992, 0.000582), low=0.5)
    ratio = ((light.radiance / pdf) / (found / looked_up)).numpy()[:, valid]
    check_seen(np.median(np.abs(ratio - 1.0)), Seen(11, 1.19e-07, 1.19e-07, 0.0), high=1e-3)
    check_seen(np.quantile(np.abs(ratio - 1.0), 0.97), Seen(11, 8.02e-07, 8.02e-07, 4.1e-08), high=0.02)


def seen_along(place, hit, direction):
    ray = mi.Ray3f(mi.Point3f(BETWEEN), direction)
    return place.photograph.arriving(ray, hit, hit.distance, mi.Bool(True))[:2]


def test_a_wall_between_two_rooms_has_two_sides(captures):
    """A sheet that a photograph sees on either side: each side looks and shines as its own photograph shows it."""
    corners = np.float32([[0, -9, -9], [0, 9, -9], [0, 9, 9], [0, -9, 9]])
    sheet = RealSurface("wall", Mesh(corners, np.int32([[0, 1, 2], [0, 2, 3]])), Role.ENVIRONMENT)
    bright = [
        replace(
            captures[0], position=np.array([x, 0.0, 0.0]), radiance=np.full((64, 128, 3), value, np.float32), sky=True
        )
        for x, value in ((-1.0, 1.0), (1.0, 3.0))
    ]
    place = Place(bright, TracedSurfaces(merge_real_surfaces([sheet])))
    light = place.presample_lights(np.random.default_rng(0), 1024).sample(
        (dr.arange(mi.Float, 1024) + 0.5) / 1024, mi.Bool(True)
    )
    for x, value in ((-2.0, 1.0), (2.0, 3.0)):
        # Not literals, with which each side would compile kernels of its own.
        origin, direction = mi.Point3f([x], [0.3], [0.2]), mi.Vector3f([-0.5 * x], [0.0], [0.0])
        ray = mi.Ray3f(origin, direction)
        hit = place.surfaces.first_real(ray, mi.Bool(True))
        assert place.photograph.sharp(hit, ray).numpy() == pytest.approx(value)
        assert place.photograph.arriving(ray, hit, hit.distance, mi.Bool(True))[0].numpy() == pytest.approx(value)
        _, _, pdf = place.toward(light, ray.o)
        from_there = (pdf > 0.0) & light.finite
        assert light.radiance.x.numpy()[from_there.numpy()] == pytest.approx(value)


def test_what_a_mask_leaves_out_is_taken_from_the_other(surfaces, captures):
    """Someone black stood in the first photograph, where the second one sees the wall."""
    spoilt, mask = captures[0].radiance.copy(), np.ones((128, 256), np.float32)
    person = np.s_[50:90, 150:175]
    spoilt[person], mask[person] = 0.0, 0.0
    first = replace(captures[0], radiance=spoilt, mask=mask)
    view = CameraView(Equirectangular(type="equirectangular", width=256), first.position, first.rotation)
    plate, alpha = render_plate(view, [first, captures[1]], Place([first, captures[1]], surfaces))
    clean, inside = captures[0].radiance[person], plate[person]
    assert (alpha == 1.0).all()
    assert np.median(np.abs(inside / clean - 1.0)) < 0.01
    far = np.ones((128, 256), bool)
    far[40:100, 140:185] = False
    np.testing.assert_array_equal(plate[far], captures[0].radiance[far])
    alone = Place(first, surfaces)
    assert isinstance(alone.photograph, Photographs)


def test_the_retouched_plate_is_the_picture_and_not_the_light(surfaces, captures, floor):
    """A tripod that is black below the capture point; retouched, it is as bright as the floor."""
    spoilt = captures[0].radiance.copy()
    spoilt[110:] = 0.0
    light = replace(captures[0], radiance=spoilt)
    place, plain = (Place(replace(light, plate=plate), surfaces) for plate in (captures[0].radiance, None))
    down = mi.Ray3f(mi.Point3f(CAPTURES[0]), mi.Vector3f(0.0, 0.0, -1.0))
    hit = surfaces.first_real(down, mi.Bool(True))
    expected = radiance(np.array([[*CAPTURES[0][:2], 0.0]]))[0]
    for found in (place.photograph.sharp(hit, down), place.photograph.surface_radiance(hit, down.d, mi.Bool(True))):
        assert found.numpy().reshape(3) == pytest.approx(expected, rel=0.02)
    arriving, _, _ = place.photograph.arriving(down, hit, hit.distance, mi.Bool(True))
    assert arriving.numpy().max() == 0.0
    np.testing.assert_array_equal(irradiance(place, floor[0], 64), irradiance(plain, floor[0], 64))


def test_where_the_depth_says_that_something_stood_before_the_wall_the_other_is_seen(surfaces, captures):
    """A chair that is not in the model, black; the depth that came with the photograph knows it."""
    spoilt, depth = captures[0].radiance.copy(), np.full((128, 256), 50.0, np.float32)
    chair = np.s_[50:90, 150:175]
    spoilt[chair], depth[chair] = 0.0, 0.8
    place = Place([replace(captures[0], radiance=spoilt, depth=depth), captures[1]], surfaces)
    v, u = np.mgrid[55:85, 155:170] + 0.5
    hit, direction = place.photograph.each[0].look_along(
        mi.Float(np.float32(u.ravel() / 256)), mi.Float(np.float32(v.ravel() / 128))
    )
    sharp = place.photograph.sharp(hit, mi.Ray3f(mi.Point3f(CAPTURES[0]), direction)).numpy()
    truth = radiance(hit.point.numpy().T.astype(np.float64)).T
    assert np.median(np.abs(sharp / truth - 1.0)) < 0.02


def test_depth_images_make_one_model(captures):
    """The second capture's depth adds what the first one's did not see, and nothing else."""
    caster = RayCaster([surface.mesh for surface in REAL])
    measured = []
    for each in captures:
        world = pixel_directions(128, 256).reshape(-1, 3) @ each.rotation.T
        measured.append(replace(each, depth=caster.cast(each.position, world).distance.reshape(128, 256)))
    first, second = meshes_from_depth(measured)
    (alone,) = meshes_from_depth(measured[:1])
    np.testing.assert_array_equal(first.vertices, alone.vertices)
    offset = second.vertices[second.faces].mean(axis=1) - CAPTURES[0]
    distance = np.linalg.norm(offset, axis=1)
    assert (caster.cast(CAPTURES[0], offset / distance[:, None]).distance < 0.97 * distance).mean() > 0.9
    # Together they have no holes: each capture point meets something everywhere, where it was measured.
    together = RayCaster([first, second])
    for each in measured:
        world = pixel_directions(48, 96).reshape(-1, 3) @ each.rotation.T
        met, truth = (cast.cast(each.position, world).distance for cast in (together, caster))
        assert (np.abs(met / truth - 1.0) < 0.05).mean() > 0.97
