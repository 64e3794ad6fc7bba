"""Objects that cameras do not see by themselves: their light, shadow and reflection stay."""

from dataclasses import replace

import numpy as np
import pytest

import lightdepth
from lightdepth.scene.materials import Emitter, Metal
from lightdepth.scene.model import Role
from tests.chance import Seen, check_seen
from tests.transport.places import CAPTURE, GREY, ball, room

AWAY = CAPTURE + [-0.8, -0.6, -0.2]
AHEAD = np.array([np.sin(np.radians(15.0)), np.cos(np.radians(15.0)), -np.tan(np.radians(15.0))])
LAMP = Emitter(type="emitter", radiance=(40.0, 30.0, 20.0))
SILVER = Metal(type="metal", name="Ag", roughness=0.1)


def lamp(distance, radius=0.12, **settings):
    """A lamp in the middle of the camera "view"."""
    return replace(ball(LAMP, AWAY + distance * AHEAD, radius), name="lamp", **settings)


def test_nothing_of_it_is_in_the_picture_of_a_place_that_does_not_change():
    """In a room without support nothing but the lamp would be new."""
    shown, hidden = (
        lightdepth.render(room(0.5, [lamp(1.0, visible_to_camera=seen)], Role.ENVIRONMENT), "view", samples=8)
        for seen in (True, False)
    )
    assert shown.coverage.max() == 1.0
    assert shown.beauty.max() > 10.0
    assert not hidden.coverage.any()
    np.testing.assert_array_equal(hidden.beauty, hidden.plate)
    assert not hidden.object_id.any()
    assert hidden.depth.min() > 1.5


@pytest.fixture(scope="module")
def lit():
    """The silver ball behind an opaque lamp, and beside it a grey one: with the lamp seen, unseen, and not there."""
    things = [ball(SILVER, AWAY + 2.2 * AHEAD, 0.5), ball(GREY, AWAY + 2.2 * AHEAD + [0.9, 0.0, 0.0], 0.3)]
    scene = room(0.5, things, irradiance_samples=64)
    lamps = [(lamp(1.0),), (lamp(1.0, visible_to_camera=False),), ()]
    return [
        lightdepth.render(replace(scene, synthetic=scene.synthetic + some), "view", samples=128, seed=3)
        for some in lamps
    ]


def test_what_is_behind_it_shows(lit):
    seen, unseen, without = lit
    there = seen.object_id == 3
    assert there.mean() > 0.01
    np.testing.assert_array_equal(unseen.object_id, without.object_id)
    np.testing.assert_allclose(unseen.depth, without.depth, rtol=1e-6)
    np.testing.assert_allclose(unseen.coverage, without.coverage, atol=0.05)
    assert seen.beauty[there].mean() > 25.0


def test_its_light_and_its_reflection_stay(lit):
    seen, unseen, without = lit
    beside = (seen.object_id == unseen.object_id) & (seen.coverage == unseen.coverage)
    for where in (beside & (unseen.object_id == 2), beside & (unseen.object_id == 0)):
        lit_by, as_before = unseen.beauty[where].mean(), seen.beauty[where].mean()
        check_seen(lit_by / as_before - 1.0, Seen(12, 0.0, 0.002, 0.0056), -0.07, 0.07)
        assert lit_by > 1.5 * without.beauty[where].mean()
    # The silver ball mirrors the lamp where that stands before it.
    there = (seen.object_id == 3) & (unseen.object_id == 1)
    assert unseen.beauty[there].max() > 5.0 * without.beauty[there].max()
