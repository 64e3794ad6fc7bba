"""Kind of place, size of objects, free floor, and the view."""

import numpy as np
import pytest

from lightdepth.directions import euler_rotation, pixel_directions
from lightdepth.images.panorama_image import PanoramaImage
from lightdepth.images.radiance import read_radiance
from lightdepth.kernel.raycasting import RayCaster
from lightdepth.parameters import QuickstartParameters
from lightdepth.quickstart.kind import is_open
from lightdepth.quickstart.objects import default_objects, offsets, plausible_scale
from lightdepth.quickstart.place import dome, guess_place
from lightdepth.quickstart.pose import guess_pose
from lightdepth.quickstart.scene import view_of
from lightdepth.quickstart.spot import FloorSpot, find_floor_spot
from tests.quickstart.painted_room import meadow, painted_room


@pytest.mark.parametrize(
    ("longest", "factor"),
    [
        (0.26, 1.0),  # A bottle in metres.
        (2.9, 1.0),
        (260.0, 0.001),  # In millimetres,
        (26.0, 0.01),  # in centimetres,
        (0.007, 100.0),  # and a helmet of 7 mm.
        (76.0, 0.01),
    ],
)
def test_sizes_that_cannot_be_meant_are_taken_for_another_unit(longest, factor):
    found, words = plausible_scale(longest)
    assert found == pytest.approx(factor)
    assert bool(words) == (factor != 1.0)
    if words:
        assert "guess" in words


def test_a_size_that_no_unit_explains_is_scaled_to_a_usual_one():
    factor, words = plausible_scale(1e9)
    assert 1e9 * factor == pytest.approx(0.4, rel=0.01)
    assert "scaled to 0.4 m" in words


def test_objects_stand_beside_each_other_around_the_middle():
    things = default_objects()
    left, right = offsets(things)
    assert left == pytest.approx(-right)
    assert right - left > 2 * 0.18  # They do not touch.


def test_a_meadow_is_open_and_a_room_is_not():
    level = np.eye(3)
    assert is_open(meadow(64), level, False)
    assert not is_open(painted_room(64), level, True)
    # Under clouds there is no blue; the zenith is smooth and brighter than the ground.
    grey = meadow(64).mean(axis=-1, keepdims=True).repeat(3, axis=-1)
    assert is_open(grey.clip(0, 2), level, False)


def test_real_places_are_distinguished(shared_data):
    found = {}
    for path in sorted((shared_data / "hdr").iterdir()):
        found[path.stem] = is_open(read_radiance(path), np.eye(3), "grass" not in path.stem and "park" not in path.stem)
    assert {name for name, is_it in found.items() if is_it} == {
        "noon_grass_1k",
        "rooitou_park_1k",
        "modern_buildings_2_1k",
    }


def test_a_dome_is_closed_and_its_faces_look_inward():
    surfaces = dome(1.6, 6.4, 4.0)
    directions = pixel_directions(32, 64).reshape(-1, 3)
    hits = RayCaster([surface.mesh for surface in surfaces]).cast(np.array([0.0, 0.0, 1.6]), directions)
    assert np.isfinite(hits.distance).all()
    assert (np.einsum("ij,ij->i", hits.normal, directions) < 0.0).all()
    points = np.array([0.0, 0.0, 1.6]) + hits.distance[:, None] * directions
    assert points[:, 2].max() == pytest.approx(4.0, abs=0.05)
    assert np.linalg.norm(points[:, :2], axis=1).max() <= 6.4 + 1e-4


@pytest.fixture(scope="module")
def open_place():
    radiance = meadow(128)
    pose = guess_pose(PanoramaImage(radiance), 1.5)
    return radiance, pose, guess_place(radiance, pose)


def test_without_edges_it_is_taken_as_level_and_says_so(open_place):
    _, pose, place = open_place
    np.testing.assert_array_equal(pose.rotation, np.eye(3))
    assert "guess: taken as level" in pose.rotation_words
    assert place.kind == "ground"
    assert place.sky


def test_without_edges_the_metadata_says_what_is_level():
    tilted = euler_rotation([5.0, 3.0, -60.0])
    pose = guess_pose(PanoramaImage(meadow(64), tilted))
    np.testing.assert_array_equal(pose.rotation, tilted)
    assert "GPano" in pose.rotation_words
    assert pose.height == 1.6
    assert "guess" in pose.height_words


def test_the_spot_keeps_clear_of_what_stands_on_the_floor(open_place):
    radiance, pose, place = open_place
    # A red blanket everywhere in front, up to the feet, but for a sector on the right.
    directions = pixel_directions(128, 256)
    azimuth = np.degrees(np.arctan2(directions[..., 0], directions[..., 1]))
    covered = (directions[..., 2] < 0) & (directions[..., 2] > -0.9) & ~((azimuth > 60) & (azimuth < 150))
    changed = np.where(covered[..., None], np.float32([0.5, 0.05, 0.05]), radiance)
    spot = find_floor_spot(changed, pose, place, 0.4, 0.2, 2.4)
    # What the objects need is 12 degrees wide to either side.
    assert 72 < np.degrees(np.arctan2(spot.point[0], spot.point[1])) < 138
    # Free all around, it is in front.
    ahead = find_floor_spot(radiance, pose, place, 0.4, 0.2, 2.4).away
    assert ahead @ [0.0, 1.0, 0.0] > 0.5


@pytest.mark.parametrize(("far", "tall"), [(2.6, 0.36), (1.0, 0.7), (1.2, 0.05)])
def test_the_view_shows_the_objects_whole(far, tall):
    from dataclasses import replace

    from lightdepth.directions import look_at_rotation

    away = np.array([0.6, 0.8, 0.0])
    spot = FloorSpot(far * away, away, 0.0, True)
    things = [replace(thing, size=np.full(3, tall)) for thing in default_objects()]
    view = view_of(spot, things, 1.6, 1024)
    eye = np.array([0.0, 0.0, 1.6])
    rotation = look_at_rotation(eye, view.look_at)
    right = np.array([away[1], -away[0], 0.0])
    for offset in offsets(things):
        for corner in np.stack(np.meshgrid(*[[-0.5, 0.5]] * 3), axis=-1).reshape(-1, 3):
            point = (
                spot.point
                + offset * right
                + tall * (corner[0] * right + corner[1] * away)
                + [0, 0, (corner[2] + 0.5) * tall]
            )
            x, y, z = (point - eye) @ rotation
            half = np.tan(np.radians(view.fov) / 2)
            assert y > 0
            assert abs(x / y) < half
            assert abs(z / y) < half * view.height / view.width


def test_guesses_go_by_their_parameters():
    tuned = QuickstartParameters(ball=0.1, gap=0.0, aspect=0.5, camera_height=1.2, smallest_object=0.3)
    objects = default_objects(tuned)
    np.testing.assert_allclose(offsets(objects, tuned), [-0.1, 0.1])
    spot = FloorSpot(np.array([0.0, 2.0, 0.0]), np.array([0.0, 1.0, 0.0]), 0.0, True)
    view = view_of(spot, objects, 1.5, 1024, tuned)
    assert view.height == view.width / 2
    assert plausible_scale(0.2)[0] == 1.0
    assert plausible_scale(0.2, tuned=tuned)[0] != 1.0
    assert guess_pose(PanoramaImage(np.ones((64, 128, 3), np.float32)), tuned=tuned).height == 1.2
