"""Sampling of the light-depth map: its distribution, its density from any point, and the Jacobian between the two."""

import numpy as np
import pytest
from scipy.stats import chi2, poisson

from lightdepth.kernel.start import start

start("cpu")

import drjit as dr  # noqa: E402
import mitsuba as mi  # noqa: E402

from lightdepth.directions import pixel_solid_angles  # noqa: E402
from lightdepth.parameters.place import PlaceParameters  # noqa: E402
from lightdepth.place.map_distribution import MapDistribution, hilbert_curve  # noqa: E402
from lightdepth.place.place import Place  # noqa: E402
from lightdepth.place.real_surfaces import merge_real_surfaces  # noqa: E402
from lightdepth.place.traced_surfaces import TracedSurfaces, shadow_ray  # noqa: E402
from tests.chance import FALSE_ALARM, Seen, check_seen, standard_errors  # noqa: E402
from tests.transport.places import CAPTURE, HIGH, LOW, lamp_image, room  # noqa: E402

BINS = (16, 32)


def make_place(scene, **settings):
    return Place(scene.panorama, TracedSurfaces(merge_real_surfaces(scene.real)), **settings)


@pytest.fixture(scope="module", params=[False, True], ids=["what stands out", "all light"])
def place(request):
    return make_place(room(lamp_image(128)), alone=request.param)


def seen(place, hit, direction):
    """What the photograph sends along directions, and the density of that."""
    ray = mi.Ray3f(mi.Point3f(0.0), direction)
    return place.photograph.arriving(ray, hit, hit.distance, mi.Bool(True))[:2]


def bin_of(direction):
    """Equal-area bins of world directions, shape (n,)."""
    x, y, z = direction
    row = np.clip(((z + 1) / 2 * BINS[0]).astype(int), 0, BINS[0] - 1)
    column = np.clip(((np.arctan2(y, x) / (2 * np.pi) + 0.5) * BINS[1]).astype(int), 0, BINS[1] - 1)
    return row * BINS[1] + column


def expected_shares(place, point, per_side=2048):
    """Integral of p_x over each bin by a fine regular grid of directions."""
    total = np.zeros(BINS[0] * BINS[1])
    z = (np.arange(per_side) + 0.5) / per_side * 2 - 1
    for chunk in np.array_split(z, 16):
        z_all, phi = np.meshgrid(
            chunk, ((np.arange(2 * per_side) + 0.5) / (2 * per_side) - 0.5) * 2 * np.pi, indexing="ij"
        )
        ring = np.sqrt(1 - z_all**2)
        direction = np.stack([ring * np.cos(phi), ring * np.sin(phi), z_all]).reshape(3, -1).astype(np.float32)
        w = mi.Vector3f(direction)
        hit = place.surfaces.first_real(mi.Ray3f(mi.Point3f(point), w), mi.Bool(True))
        _, pdf = seen(place, hit, w)
        np.add.at(total, bin_of(direction), pdf.numpy())
    return total * 4 * np.pi / (2 * per_side**2)


@pytest.mark.parametrize(
    "point", [CAPTURE, CAPTURE + [1.5, 1.2, -1.0], LOW + [0.4, 0.4, 0.05], HIGH - [0.3, 0.3, 0.3]], ids=str
)
def test_samples_follow_the_density_from_any_point(place, point):
    lights = place.presample_lights(np.random.default_rng(5), 1 << 18)
    number = 1 << 18
    light = lights.sample((dr.arange(mi.Float, number) + 0.5) / number, mi.Bool(True))
    direction, distance, pdf = place.toward(light, mi.Point3f(point))
    free = ~place.surfaces.real.ray_test(shadow_ray(mi.Point3f(point), direction, direction, distance))
    kept = (free & (pdf > 0.0)).numpy()
    observed = np.bincount(bin_of(direction.numpy())[kept], minlength=BINS[0] * BINS[1])
    expected = expected_shares(place, point) * number
    enough = expected > 10
    statistic = ((observed - expected)[enough] ** 2 / expected[enough]).sum()
    # Stratified samples scatter less than the test assumes, so only an excess speaks against the density.
    # A density that is off by a 25th here and there is caught.
    assert chi2.sf(statistic, int(enough.sum()) - 1) > FALSE_ALARM
    few, met = expected[~enough].sum(), observed[~enough].sum()
    assert min(poisson.sf(met - 1, few), poisson.cdf(met, few)) > 0.5 * FALSE_ALARM


def test_light_samples_and_lookups_agree(place):
    """What a light sample says of itself is what a ray toward it finds: radiance, and eval / pdf."""
    lights = place.presample_lights(np.random.default_rng(6), 4096)
    point = mi.Point3f(CAPTURE + [0.9, -0.7, -0.5])
    light = lights.sample((dr.arange(mi.Float, 4096) + 0.5) / 4096, mi.Bool(True))
    direction, distance, pdf = place.toward(light, point)
    hit = place.surfaces.first_real(mi.Ray3f(point, direction), mi.Bool(True))
    radiance, looked_up = seen(place, hit, direction)
    valid = (pdf > 0).numpy()
    assert valid.mean() > 0.95
    np.testing.assert_allclose(hit.distance.numpy()[valid], distance.numpy()[valid], rtol=1e-3)
    value = (light.radiance / pdf).numpy()[:, valid]
    other = (radiance / looked_up).numpy()[:, valid]
    # The rims of the lamp are steep: a rounding of the direction moves the value there.
    check_seen(np.median(np.abs(value / other - 1)), Seen(11, 2.38e-07, 2.38e-07, 0.0), high=1e-3)
    check_seen(np.quantile(np.abs(value / other - 1), 0.98), Seen(11, 7.86e-07, 8.34e-07, 4.47e-08), high=0.02)


def test_the_jacobian_goes_to_one_as_depth_grows():
    image = lamp_image(64)
    offset = np.array([0.5, -0.4, 0.3])
    last = np.inf
    for scale in (1.0, 10.0, 100.0, 1000.0):
        scene = room(image)
        mesh = scene.real[0].mesh
        grown = (mesh.vertices - CAPTURE.astype(np.float32)) * np.float32(scale) + CAPTURE.astype(np.float32)
        surfaces = merge_real_surfaces(scene.real)
        object.__setattr__(surfaces, "vertices", grown.astype(np.float32))
        object.__setattr__(surfaces, "rest", grown.astype(np.float32))
        place = Place(scene.panorama, TracedSurfaces(surfaces))
        generator = np.random.default_rng(2)
        directions = generator.normal(size=(3, 2000))
        w = mi.Vector3f((directions / np.linalg.norm(directions, axis=0)).astype(np.float32))
        hit = place.surfaces.first_real(mi.Ray3f(mi.Point3f(CAPTURE + offset), w), mi.Bool(True))
        w0, _ = place.photograph.from_capture(hit, w)
        _, at_capture = place.photograph.map.radiance_and_pdf(w0)
        _, here = seen(place, hit, w)
        ratio = (here / at_capture).numpy()
        error = np.median(np.abs(ratio[ratio > 0] - 1))
        assert error < last
        last = error
    check_seen(last, Seen(11, 0.000227, 0.000227, 2.52e-05), high=2e-3)


def test_sky_is_directional():
    scene = room(lamp_image(64))
    place = Place(scene.panorama, TracedSurfaces(merge_real_surfaces(())))
    w = mi.Vector3f(0.6, 0.0, 0.8)
    hit = place.surfaces.first_real(mi.Ray3f(mi.Point3f(CAPTURE + 3.0), w), mi.Bool(True))
    radiance, pdf = seen(place, hit, w)
    turned = mi.Matrix3f(scene.panorama.rotation.T.astype(np.float32)) @ w
    expected, density = place.photograph.map.radiance_and_pdf(turned)
    np.testing.assert_allclose(radiance.numpy(), expected.numpy(), rtol=1e-6)
    np.testing.assert_allclose(pdf.numpy(), density.numpy(), rtol=1e-6)


def test_the_density_integrates_to_one(place):
    assert expected_shares(place, CAPTURE).sum() == pytest.approx(1.0, abs=3e-3)


def test_a_single_bright_pixel_is_sampled_without_outliers():
    image = np.full((32, 64, 3), 1e-3, np.float32)
    image[9, 17] = 1e5
    place = make_place(room(image))
    _, direction = place.photograph.map.sample(1 << 14, np.random.default_rng(3))
    radiance, pdf = place.photograph.map.radiance_and_pdf(direction)
    weight = (radiance / pdf).numpy()
    check_seen(weight.max() / weight.mean(), Seen(11, 1.07, 1.07, 0.000323), high=1.1)


def bright_spots(count):
    """A grey panorama with ``count`` equal lamps of 3 by 3 pixels along the horizon, and where they are."""
    image = np.ones((64, 128, 3), np.float32)
    columns = np.arange(count) * 128 // count + 5
    for column in columns:
        image[30:33, column - 1 : column + 2] = 400.0
    return image, columns


def test_what_is_no_brighter_than_the_mean_is_left_to_scattering():
    image, _ = bright_spots(4)
    generator = np.random.default_rng(4)
    _, direction = MapDistribution(image).sample(1 << 14, generator)
    # The rims of the lamps are interpolated: half a pixel around them is as dark as any.
    assert MapDistribution(image).radiance(direction).x.numpy().min() > 1.0
    even = PlaceParameters(even=1.0)
    all_of_it = MapDistribution(image, parameters=even).sample(1 << 10, np.random.default_rng(5))[0]
    expected = MapDistribution(image, alone=True).sample(1 << 10, np.random.default_rng(5))[0]
    np.testing.assert_array_equal(all_of_it, expected)
    _, direction = MapDistribution(image, alone=True).sample(1 << 14, generator)
    light = image[..., 0].mean(axis=1) @ pixel_solid_angles(64, 128) * 128
    is_grey = MapDistribution(image).radiance(direction).x.numpy() == 1.0
    share = 4.0 * np.pi / light
    # Independent samples would spread more than these, which are even; two hundredths are caught.
    limit = standard_errors() * np.sqrt(share * (1.0 - share) / is_grey.size)
    assert limit < 0.02
    assert abs(is_grey.mean() - share) < limit


@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_of_an_even_map_everything_is_sampled(noise):
    image = 1.0 + noise * np.random.default_rng(8).random((64, 128, 3), dtype=np.float32)
    index, _ = MapDistribution(image).sample(1 << 15, np.random.default_rng(9))
    check_seen(len(np.unique(index)) / (64 * 128 * 2 / np.pi), Seen(11, 1.49, 1.49, 9.67e-05), low=0.9)


def test_evenly_spaced_samples_are_spread_over_the_lamps():
    image, columns = bright_spots(8)
    index, _ = MapDistribution(image).sample(1 << 14, np.random.default_rng(10))
    column = index.reshape(8, -1) % 128  # Evenly spaced ones are the columns of this.
    nearest = np.abs((column[..., None] - columns + 64) % 128 - 64).argmin(axis=-1)
    lamps_met = np.array([len(np.unique(numbers)) for numbers in nearest.T])
    check_seen(lamps_met.mean(), Seen(11, 8.0, 8.0, 0.000665), low=7.5)  # Of independent ones, 8 (1 - (7/8)^8) = 5.25.


def test_the_curve_goes_from_neighbour_to_neighbour():
    curve = hilbert_curve(5)
    place_of = np.empty((curve.size, 2), int)
    place_of[curve.ravel()] = np.indices(curve.shape).reshape(2, -1).T
    assert (np.abs(np.diff(place_of, axis=0)).sum(axis=1) == 1).all()
