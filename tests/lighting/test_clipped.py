"""Sources that were clipped on purpose, recovered from what they light."""

from dataclasses import replace

import numpy as np
import pytest
from bench.places import PLACES
from bench.places.meshes import rectangle
from bench.truth import truth

from lightdepth.directions import latlong_to_direction, pixel_directions, pixel_solid_angles
from lightdepth.errors import InputError
from lightdepth.images.radiance import read_radiance
from lightdepth.lighting.clipped import recover_clipped, solve_gains
from lightdepth.lighting.explained import ExplainedLight
from lightdepth.lighting.panorama_view import PanoramaView
from lightdepth.scene.lights.clipped import ClippedSource, unclipped
from lightdepth.scene.model import Panorama, RealSurface, Role, Scene, SunLight

WIDTH = 512
TIMES_THE_MEAN = (1.0, 4.0, 64.0)


@pytest.fixture(scope="module")
def court():
    """The court, its sun's irradiance on a surface that faces it, and the sun's direction."""
    place = PLACES["court"]()
    sky = place.sky
    direction = np.array(sky.sun_direction) / np.linalg.norm(sky.sun_direction)
    irradiance = np.array(sky.sun_radiance) * np.pi * np.sin(np.radians(0.5 * sky.sun_diameter)) ** 2
    return place.scene(WIDTH, 64), irradiance, direction, sky.sun_diameter


def clipped(scene, times):
    radiance = scene.panorama.radiance
    limit = np.float32(times * radiance.mean())
    return replace(scene, panorama=replace(scene.panorama, radiance=np.minimum(radiance, limit)))


@pytest.mark.parametrize("times", TIMES_THE_MEAN)
def test_the_court_s_sun_is_recovered_from_the_shadows_of_its_walls(court, times):
    scene, irradiance, direction, diameter = court
    found = recover_clipped(clipped(scene, times), diameter=diameter)[0]
    assert found.method == "shadow edges"
    np.testing.assert_allclose(found.irradiance, irradiance, rtol=0.10)
    assert np.all(found.low <= irradiance)
    assert np.all(irradiance <= found.high)
    u, v = np.array(found.source.pixel) / (WIDTH, WIDTH / 2)
    toward = scene.panorama.rotation @ latlong_to_direction(u, v)
    assert np.degrees(np.arccos(toward @ direction)) < 0.75


def test_the_corrected_map_lights_like_the_whole_one(court):
    scene, _, _, diameter = court
    cut = clipped(scene, 8.0)
    found = recover_clipped(cut, diameter=diameter)[0]
    mended = replace(cut, panorama=replace(cut.panorama, unclipped=unclipped(cut.panorama.radiance, found.source)))
    points = np.array([[0.0, 1.0, 0.0], [1.5, 2.0, 0.0], [-4.8, 0.0, 0.0]])  # The last lies in a wall's shadow.
    normals = np.broadcast_to([0.0, 0.0, 1.0], points.shape)
    whole, cut_light, mended_light = (
        ExplainedLight(each.panorama, each.real).irradiance(points, normals, 1024) for each in (scene, cut, mended)
    )
    assert np.all(cut_light[:2] < 0.6 * whole[:2])
    np.testing.assert_allclose(mended_light[:2], whole[:2], rtol=0.08)
    # Depth of the shadow: what stays of the light in it.
    np.testing.assert_allclose(mended_light[2] / mended_light[0], whole[2] / whole[0], atol=0.03)


def test_clicked_pairs_tell_the_court_s_sun(court):
    scene, irradiance, _, diameter = court
    view = PanoramaView(scene)
    lit, shaded = ([(x, y, 0.0) for y in (-0.5, 0.0, 0.5)] for x in (-3.6, -4.7))
    clicks = zip(view.pixels(np.array(lit)), view.pixels(np.array(shaded)), strict=True)
    pairs = [f"{a[0]:.2f},{a[1]:.2f} {b[0]:.2f},{b[1]:.2f}" for a, b in clicks]
    found = recover_clipped(clipped(scene, 32.0), pairs=pairs, diameter=diameter)[0]
    assert found.method == "clicked pairs"
    np.testing.assert_allclose(found.irradiance, irradiance, rtol=0.10)


@pytest.mark.parametrize("second", [0.0, 3.0])
def test_a_shadow_whose_caster_is_not_modelled_has_none_of_the_clipped_light(second):
    """A plain under an even sky and a sun of 12 degrees; what throws the shadow at one place is small and not modelled.

    A second sun that the scene declares lights both places, and is no light that the first one lost.
    """
    directions, angles = pixel_directions(64, 128), pixel_solid_angles(64, 128)[:, None]
    disc = directions @ np.array([0.0, np.sqrt(0.5), np.sqrt(0.5)]) > np.cos(np.radians(6.0))
    sky, sun = np.float32(1.0), np.float32(200.0)
    of_sun = sun * float((angles * disc * directions[..., 2].clip(0.0)).sum())
    shade = 0.3 / np.pi * (np.pi * sky + second)
    radiance = np.where(directions[..., 2] > 0.0, sky, shade + 0.3 / np.pi * of_sun).astype(np.float32)
    radiance[disc] = 40.0
    radiance[48:53, 30:35] = shade
    plain = RealSurface("plain", rectangle((-300.0, -300.0, 0.0), (600.0, 0.0, 0.0), (0.0, 600.0, 0.0)), Role.SUPPORT)
    panorama = Panorama(np.repeat(radiance[..., None], 3, axis=2), np.array([0.0, 0.0, 1.6]), np.eye(3), sky=True)
    declared = (SunLight("second", np.array([0.0, 0.0, 1.0]), 0.53, np.full(3, second)),) if second else ()
    found = recover_clipped(Scene(panorama, (plain,), lights=declared), pairs=["70.5,50.5 32.5,50.5"])[0]
    np.testing.assert_allclose(found.irradiance, of_sun * np.sqrt(2.0), rtol=0.05)


def test_a_sun_in_a_clipped_glow_is_a_disc_in_the_glow_s_middle():
    """A sun of half a degree, 20 degrees over the horizon; its glow is clipped where it is 11 degrees wide to each side."""
    height = 128
    directions, angles = pixel_directions(height, 2 * height), pixel_solid_angles(height, 2 * height)[:, None]
    toward = np.array([np.sin(1.0) * np.cos(0.35), np.cos(1.0) * np.cos(0.35), np.sin(0.35)])
    away = np.degrees(np.arccos(np.clip(directions @ toward, -1.0, 1.0)))
    sky = (0.3 + 8.0 * np.exp(-away / 8.0)) * np.array([1.0, 0.9, 0.7])[:, None, None]
    above = directions[..., 2] > 0.0
    sun, albedo = np.array([8.0, 7.0, 5.0]), np.array([0.1, 0.13, 0.04])
    light = np.array([(angles * channel * directions[..., 2].clip(0.0)).sum() for channel in sky]) + sun * toward[2]
    radiance = np.where(above[..., None], np.moveaxis(sky, 0, -1), albedo * light / np.pi).astype(np.float32)
    clip = np.float32(np.interp(11.0, np.sort(away.ravel()), sky[2].ravel()[np.argsort(away.ravel())]))
    plain = RealSurface("plain", rectangle((-300.0, -300.0, 0.0), (600.0, 0.0, 0.0), (0.0, 600.0, 0.0)), Role.SUPPORT)
    panorama = Panorama(np.minimum(radiance, clip), np.array([0.0, 0.0, 1.6]), np.eye(3), sky=True)
    found = recover_clipped(Scene(panorama, (plain,)), grey=["20.5,100.5 0.1 0.13 0.04"])[0]
    assert found.source.diameter == 0.53
    u, v = np.array(found.source.pixel) / (2 * height, height)
    assert np.degrees(np.arccos(latlong_to_direction(u, v) @ toward)) < 0.5
    # What the glow itself lost counts as the sun's.
    lost = np.maximum(sky - clip, 0.0) * above
    np.testing.assert_allclose(found.irradiance, sun + (angles * lost).sum(axis=(1, 2)), rtol=0.05)


def test_a_sun_that_was_not_clipped_is_left_alone(court):
    scene, _, _, diameter = court
    (found,) = recover_clipped(scene, diameter=diameter)
    assert (found.source, found.method) == (None, "not clipped")


@pytest.fixture(scope="module")
def grass(shared_data):
    """A real meadow with the sun near the zenith, over a plane: nothing in the model throws a shadow."""
    radiance = read_radiance(shared_data / "hdr" / "noon_grass_1k.hdr")
    ground = RealSurface("ground", rectangle((-50.0, -50.0, 0.0), (100.0, 0.0, 0.0), (0.0, 100.0, 0.0)), Role.SUPPORT)
    return Scene(Panorama(radiance, np.array([0.0, 0.0, 1.6]), np.eye(3), sky=True), (ground,))


def test_a_sun_over_a_plane_is_left_with_bounds(grass):
    found = recover_clipped(clipped(grass, 8.0))[0]
    assert (found.source, found.method, found.confidence) == (None, "none", "none")
    true = sun_of(grass)
    assert np.all(found.low <= true)
    assert np.all(true <= found.high)


@pytest.mark.parametrize("times", TIMES_THE_MEAN)
def test_places_of_known_albedo_tell_the_meadow_s_sun(grass, times):
    view, places = PanoramaView(grass), np.array([[500.5, 380.5], [300.5, 400.5], [700.5, 390.5]])
    seen = view.look(places)
    light = ExplainedLight(grass.panorama, grass.real).irradiance(seen.point, seen.normal, 1024)
    steps = [np.array([dx, dy]) for dx in (-1, 0, 1) for dy in (-1, 0, 1)]
    albedo = np.pi * np.mean([view.colour(places + step) for step in steps], axis=0) / light
    grey = [f"{x},{y} {r} {g} {b}" for (x, y), (r, g, b) in zip(places, albedo)]
    found = recover_clipped(clipped(grass, times), grey=grey)[0]
    assert found.method == "known albedo"
    np.testing.assert_allclose(found.irradiance, sun_of(grass), rtol=0.10)


def sun_of(scene):
    """Irradiance from within one degree of the brightest place."""
    radiance = scene.panorama.radiance.astype(float)
    height, width = radiance.shape[:2]
    angles, directions = pixel_solid_angles(height, width)[:, None], pixel_directions(height, width)
    bright = radiance.mean(axis=2) > 0.2 * radiance.mean(axis=2).max()
    middle = (directions * (angles * bright)[..., None]).sum(axis=(0, 1))
    near = directions @ (middle / np.linalg.norm(middle)) > np.cos(np.radians(1.0))
    return (radiance * (angles * near)[..., None]).sum(axis=(0, 1))


@pytest.mark.parametrize(
    ("option", "text", "words"),
    [
        ("pairs", "10,200", "1 points, 2 are needed"),
        ("pairs", "500,380 500,100", "point 2 lies on no real surface"),
        ("pairs", "200.5,266.5 200.5,277.5", "contradict each other"),  # The first is in the trees' shadow.
        ("grey", "500,380", "write a place and its albedo"),
        ("grey", "500,380 1.5", "not between 0.01 and 1"),
        ("grey", "500,380 1 1 1", "the albedo is too large"),
    ],
)
def test_bad_clicks_are_refused_in_words(grass, option, text, words):
    with pytest.raises(InputError, match=words):
        recover_clipped(clipped(grass, 8.0), **{option: [text]})


def test_clicks_that_contradict_each_other_are_named(grass):
    """Two places of one meadow, of which one is said to be ten times as dark as the other."""
    with pytest.raises(InputError, match=r"--grey: the clicks contradict each other: by click 1 .* by click 2"):
        recover_clipped(clipped(grass, 8.0), grey=["500.5,380.5 0.3", "300.5,400.5 0.03"])


def test_a_disc_gets_its_solid_angle_wherever_it_is():
    radiance = np.full((64, 128, 3), 1.0, np.float32)
    angles = pixel_solid_angles(64, 128)[:, None]
    for pixel, diameter in (((20.3, 30.7), 10.0), ((127.9, 40.2), 12.0), ((64.0, 32.0), 0.5), ((5.0, 1.5), 9.0)):
        light = unclipped(radiance, ClippedSource(pixel, np.array([101.0, 51.0, 1.0]), diameter))
        wanted = 4.0 * np.pi * np.sin(0.25 * np.radians(diameter)) ** 2
        more = ((light - radiance) * angles[..., None]).sum(axis=(0, 1))
        np.testing.assert_allclose(more, [100.0 * wanted, 50.0 * wanted, 0.0], rtol=0.02)


def test_a_plateau_is_raised_across_the_seam_and_nothing_else():
    radiance = np.full((8, 16, 3), 1.0, np.float32)
    radiance[3, [14, 15, 0, 1]] = 5.0
    radiance[6, 7] = 5.0
    light = unclipped(radiance, ClippedSource((0.5, 3.5), np.array([50.0, 40.0, 30.0])))
    raised = np.zeros((8, 16), bool)
    raised[3, [14, 15, 0, 1]] = True
    np.testing.assert_array_equal(light[raised], np.broadcast_to([50.0, 40.0, 30.0], (4, 3)))
    np.testing.assert_array_equal(light[~raised], radiance[~raised])


def test_a_pixel_beside_the_panorama_is_refused():
    with pytest.raises(InputError, match="pixel 16,3 is not on the panorama of 16 x 8 pixels"):
        unclipped(np.ones((8, 16, 3), np.float32), ClippedSource((16.0, 3.0), np.ones(3)))


def test_a_lamp_and_a_window_are_recovered_from_how_their_light_falls_off():
    place = PLACES["lamp_and_window"]()
    seen = truth(place, "panorama", 192, 128, objects=False)
    rotation = place.camera("panorama", 192).rotation
    real = tuple(RealSurface(part.name, part.mesh, part.role) for part in place.parts)
    whole = Panorama(seen.mean.astype(np.float32), np.array(place.position), rotation)
    limit = np.float32(8.0 * whole.radiance.mean())
    assert limit < 6.0  # Below both the window and the lamp, above the walls.
    found = recover_clipped(Scene(replace(whole, radiance=np.minimum(whole.radiance, limit)), real))
    assert [each.method for each in found] == ["falloff", "falloff"]
    angles = pixel_solid_angles(96, 192)[:, None]
    for each in found:
        true = (whole.radiance * (angles * each.plateau.pixels)[..., None]).sum(axis=(0, 1))
        np.testing.assert_allclose(each.irradiance, true, rtol=0.12)

    # The same from places of known albedo, before the window, under the lamp and between: both are solved at once.
    cut = Scene(replace(whole, radiance=np.minimum(whole.radiance, limit)), real)
    floor, albedo = next((part.mesh, part.color) for part in place.parts if part.name == "floor")
    low, high = floor.vertices[:, :2].min(axis=0), floor.vertices[:, :2].max(axis=0)
    places = [
        [*(low + share * (high - low)), 0.0] for share in np.array([[0.1, 0.6], [0.7, 0.63], [0.4, 0.8], [0.6, 0.2]])
    ]
    grey = [f"{x:.2f},{y:.2f} {' '.join(map(str, albedo))}" for x, y in PanoramaView(cut).pixels(np.array(places))]
    found = recover_clipped(cut, grey=grey)
    assert [each.method for each in found] == ["known albedo", "known albedo"]
    for each in found:
        true = (whole.radiance * (angles * each.plateau.pixels)[..., None]).sum(axis=(0, 1))
        np.testing.assert_allclose(each.irradiance, true, rtol=0.12)
    wrong = f"{grey[3].split()[0]} {' '.join(str(0.15 * value) for value in albedo)}"
    with pytest.raises(InputError, match=r"contradict each other: .* click 4 would have \d+(\.\d+)? times the albedo"):
        recover_clipped(cut, grey=[*grey[:3], wrong])


def test_sources_that_no_place_tells_apart_share_a_gain():
    """Two lamps that light two places alike, and one that lights the second alone."""
    given = np.array([[[1.0], [2.0], [0.0]], [[1.0], [2.0], [4.0]]]) * np.ones(3)
    light, missing = given.sum(axis=1) + 1.0, (given * np.array([3.0, 3.0, 0.5])[:, None]).sum(axis=1)
    gains, errors = solve_gains(missing, given, light)
    np.testing.assert_allclose(gains, [[3.0] * 3, [3.0] * 3, [0.5] * 3], rtol=0.15)
    assert np.all(errors[0] > 3.0 * errors[2])
