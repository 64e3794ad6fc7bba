"""Which points of the place the photograph of an ordinary camera shows."""

from dataclasses import replace

import numpy as np
import pytest

from lightdepth.kernel.start import start
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


def shown(floor, point, *real):
    """What the plate of a place shows of a point of the floor."""
    surfaces = TracedSurfaces(merge_real_surfaces(real))
    seen = SeenPlate(plate_of(VIEW) * GAIN, VIEW, GAIN, surfaces)
    above = np.asarray(point) + [0.0, 0.0, 0.5]
    hit = floor.first_real(mi.Ray3f(mi.Point3f(*above.tolist()), mi.Vector3f(0.0, 0.0, -1.0)), mi.Bool(True))
    direction = np.asarray(point) - POSITION
    toward = mi.Vector3f(*(direction / np.linalg.norm(direction)).tolist())
    return seen.over(mi.Color3f(UNKNOWN), hit, toward, mi.Bool(True)).numpy().ravel()


def test_the_floor_has_its_own_pixel_in_the_unit_of_the_panorama(floor):
    point = np.array([-1.0, -0.7, 0.0])
    np.testing.assert_allclose(shown(floor, point, ROOM, PILLAR), radiance(point[None])[0], rtol=0.02)


def test_what_stands_behind_something_is_not_shown(floor):
    assert (shown(floor, (0.0, -1.0, 0.0), ROOM, PILLAR) == UNKNOWN).all()


def test_what_is_removed_tells_nothing_of_what_is_behind_it(floor):
    """Not even of what stands so close behind it that a model's error could be as large."""
    point = (-0.2, 0.29, 0.0)
    assert (shown(floor, point, ROOM, PILLAR) != UNKNOWN).all()
    assert (shown(floor, point, ROOM, replace(PILLAR, removed=True)) == UNKNOWN).all()
