"""Suns that cannot be as they are declared."""

from dataclasses import replace

import numpy as np
import pytest

from lightdepth.checks import Severity, find_problems
from lightdepth.directions import pixel_directions, pixel_solid_angles
from lightdepth.scene.lights.frame import sun_direction
from lightdepth.scene.model import Panorama, RealSurface, Role, Scene, SunLight
from tests.checks.rooms import CAPTURE, box, room, side, sphere


def scene(direction, opening):
    """A room whose right wall is a pane, or not."""
    walls = room(without=("right",))
    pane = RealSurface("right", side("right"), Role.ENVIRONMENT, opening=opening)
    sun = SunLight("sun", direction, 0.53, np.array([5.0, 5.0, 5.0]))
    image = np.ones((32, 64, 3), np.float32)
    return Scene(Panorama(image, CAPTURE, np.eye(3)), (*walls, pane), (sphere((0.5, 1.5, 0.3), 0.3),), lights=(sun,))


def showing_a_sun(scene, share):
    """The same with a sun in its panorama that shines in elsewhere, with a share of the declared one's irradiance."""
    directions, angles = pixel_directions(256, 512), pixel_solid_angles(256, 512)[:, None]
    disc = directions @ sun_direction(40.0, 10.0) > np.cos(np.radians(0.6))
    image = np.ones((256, 512, 3), np.float32)
    image[disc] += np.float32(share * 5.0 / (angles * disc).sum())
    return replace(scene, panorama=Panorama(image, CAPTURE, np.eye(3)))


def found(scene):
    return [(p.severity, p.message) for p in find_problems(scene) if "[[light]]" in p.message]


def test_a_sun_that_shines_through_a_pane_is_right():
    behind_a_pillar = scene(sun_direction(90.0, 30.0), opening=True)
    pillar = RealSurface("pillar", box([0.3, -0.3, 0.0], [0.6, 0.3, 2.5]), Role.ENVIRONMENT)
    hidden = replace(behind_a_pillar, real=(*behind_a_pillar.real, pillar))
    assert found(hidden) == []
    # Nor is there anything wrong with a small bright thing behind the pane.
    assert found(showing_a_sun(hidden, 0.08)) == []
    ((severity, message),) = found(showing_a_sun(hidden, 1.0))
    assert severity is Severity.WARNING
    assert "the panorama shows a sun itself, at pixel " in message


@pytest.mark.parametrize(
    ("azimuth", "opening", "severity", "words"),
    [
        (90.0, True, Severity.ERROR, "counted twice"),
        (90.0, False, Severity.ERROR, "opening = true"),
        (270.0, True, Severity.WARNING, "lights nothing"),
    ],
)
def test_one_that_cannot_be_is_named(azimuth, opening, severity, words):
    ((found_severity, message),) = found(scene(sun_direction(azimuth, 30.0), opening))
    assert found_severity is severity
    assert words in message
