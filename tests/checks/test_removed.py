"""What `check` reports of surfaces that are removed."""

from dataclasses import replace

import numpy as np
import pytest

from lightdepth.cameras import Perspective
from lightdepth.checks import Severity, inspect_scene
from lightdepth.directions import look_at_rotation
from lightdepth.scene.model import CameraView, Role, Scene
from tests.place.virtual_room import CAPTURES, REAL, photograph
from tests.transport.places import WHITE, ball

ROOM, PILLAR = REAL
SMALL = Perspective(type="perspective", width=40, height=30, fov=60)
AT = np.array([-1.8, 0.2, 1.4])
VIEW = CameraView(SMALL, AT, look_at_rotation(AT, (0.0, 0.0, 1.2)))
AWAY = CameraView(SMALL, AT, look_at_rotation(AT, (-3.0, 0.2, 1.4)))


@pytest.fixture(scope="module")
def scene():
    removed = replace(PILLAR, removed=True)
    return Scene(photograph(CAPTURES[0], 64), (ROOM, removed), cameras={"view": VIEW, "away": AWAY})


def found(scene):
    return [problem for problem in inspect_scene(scene).problems if "removed" in problem.message]


def test_the_share_of_the_picture_that_nobody_knows(scene):
    (hint,) = found(scene)
    # The pillar is 0.6 m wide and its near side 1.5 m off, in a picture 2 tan 30 degrees wide; it fills its height.
    share = 100.0 * 0.6 / 1.5 / (2.0 * np.tan(np.radians(30.0)))
    assert hint.severity is Severity.HINT
    words = hint.message.split()
    assert words[0] == "[camera.view]:"
    assert float(words[1]) == pytest.approx(share, abs=4.0)
    assert float(words[words.index("of", 8) + 1]) == pytest.approx(float(words[1]), abs=1.0)


def test_a_second_panorama_knows(scene):
    (hint,) = found(replace(scene, further=(photograph(CAPTURES[1], 64),)))
    assert "a panorama sees everything behind them" in hint.message


def test_environment_keeps_its_shadow(scene):
    walls = replace(ROOM, role=Role.ENVIRONMENT)
    _, warning = sorted(found(replace(scene, real=(walls, scene.real[1]))), key=lambda each: each.severity == "warning")
    assert 'is environment ("room"), which keeps the shadow' in warning.message


def test_an_object_may_stand_in_its_place(scene):
    thing = ball(WHITE, (0.0, 0.0, 0.25), 0.25)
    for real, count in ((scene.real, 0), (REAL, 1)):
        problems = inspect_scene(replace(scene, real=real, synthetic=(thing,))).problems
        assert sum("entirely behind or inside" in problem.message for problem in problems) == count
