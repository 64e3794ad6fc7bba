"""Which points of the place the photograph of an ordinary camera shows."""

from dataclasses import replace

import numpy as np
import pytest

from lightdepth.kernel.start import start
from lightdepth.scene.model import Gloss
from tests.film.test_plate import POSITION, VIEW, plate_of
from tests.place.virtual_room import REAL, radiance

start("cpu")

import mitsuba as mi  # noqa: E402

from lightdepth.place.real_surfaces import merge_real_surfaces  # noqa: E402
from lightdepth.place.seen_plate import SeenPlate  # noqa: E402
from lightdepth.place.traced_surfaces import TracedSurfaces  # noqa: E402

ROOM, PILLAR = REAL
UNKNOWN = -1.0
GAIN = np.float32([0.5, 0.5, 0.5])


@pytest.fixture(scope="module")
def floor():
    """The room without the pillar."""
    return TracedSurfaces(merge_real_surfaces([ROOM]))


def looked_up(floor, point, mirrored, *real):
    """What the plate of a place shows of a point of the floor, and what is mirrored there."""
    surfaces = TracedSurfaces(merge_real_surfaces(real))
    seen = SeenPlate(plate_of(VIEW) * GAIN, VIEW, GAIN, surfaces, mirrored)
    above = np.asarray(point) + [0.0, 0.0, 0.5]
    hit = floor.first_real(mi.Ray3f(mi.Point3f(*above.tolist()), mi.Vector3f(0.0, 0.0, -1.0)), mi.Bool(True))
    direction = np.asarray(point) - POSITION
    toward = mi.Vector3f(*(direction / np.linalg.norm(direction)).tolist())
    found = seen.over(mi.Color3f(UNKNOWN), mi.Color3f(UNKNOWN), hit, toward, mi.Bool(True))
    return [each.numpy().ravel() for each in found]


def shown(floor, point, *real):
    """What the plate shows of a point of the floor."""
    return looked_up(floor, point, None, *real)[0]


def test_the_floor_has_its_own_pixel_in_the_unit_of_the_panorama(floor):
    point = np.array([-1.0, -0.7, 0.0])
    np.testing.assert_allclose(shown(floor, point, ROOM, PILLAR), radiance(point[None])[0], rtol=0.02)


def test_a_glossy_floor_has_its_own_pixel_where_it_is_known_what_it_mirrors():
    """Along the picture's columns, what is mirrored goes from 0 to 1 in an image with fewer pixels."""
    glossy = replace(ROOM, gloss=Gloss(0.2, 0.5))
    floor = TracedSurfaces(merge_real_surfaces([glossy]))
    point = np.array([-1.0, -0.7, 0.0])
    ramp = np.broadcast_to(((np.arange(40) + 0.5) / 40)[:, None], (30, 40, 3)).astype(np.float32)
    radiance_there, mirrored = looked_up(floor, point, ramp, glossy, PILLAR)
    np.testing.assert_allclose(radiance_there, radiance(point[None])[0], rtol=0.02)
    film, _ = VIEW.camera.film_of((point - VIEW.position) @ VIEW.rotation)
    np.testing.assert_allclose(mirrored, film[0], atol=1.0 / VIEW.resolution[0])
    assert all((each == UNKNOWN).all() for each in looked_up(floor, point, None, glossy, PILLAR))


def test_what_stands_behind_something_is_not_shown(floor):
    assert (shown(floor, (0.0, -1.0, 0.0), ROOM, PILLAR) == UNKNOWN).all()


def test_what_is_removed_tells_nothing_of_what_is_behind_it(floor):
    """Not even of what stands so close behind it that a model's error could be as large."""
    point = (-0.2, 0.29, 0.0)
    assert (shown(floor, point, ROOM, PILLAR) != UNKNOWN).all()
    assert (shown(floor, point, ROOM, replace(PILLAR, removed=True)) == UNKNOWN).all()
