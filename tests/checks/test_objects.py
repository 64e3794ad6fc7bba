import numpy as np
import pytest

from lightdepth.checks import Severity, find_problems
from lightdepth.scene.materials import Emitter
from lightdepth.scene.model import AnalyticShape, Mesh, SyntheticObject, SyntheticPart

from .rooms import RealSurface, Role, box, room, scene, sphere, thing

CABINET = RealSurface("cabinet", box([0.8, -1.0, 0.0], [1.2, 1.0, 2.0]), Role.ENVIRONMENT)


def found(*objects, real=None, sky=False):
    return [p for p in find_problems(scene(real, objects, sky=sky)) if "[[synthetic]]" in p.message]


@pytest.mark.parametrize("center", [[5.0, 0.0, 0.5], [0.0, 0.0, -1.0], [0.0, 4.0, 4.0]])
def test_object_outside_the_room(center):
    (problem,) = found(sphere(center, 0.3))
    assert problem.severity is Severity.ERROR
    assert 'ball": is outside the room' in problem.message


@pytest.mark.parametrize("hole", ["front", "ceiling", "right"])
def test_object_outside_a_room_with_a_hole(hole):
    """Through the hole or not, it is outside."""
    for center in ([5.0, 0.0, 0.5], [0.0, -4.0, 1.0], [0.0, 0.0, 4.0]):
        (problem,) = found(sphere(center, 0.3), real=room(without=[hole]))
        assert problem.severity is Severity.ERROR
        assert 'ball": is outside the room' in problem.message


def test_object_before_the_window_of_a_room_under_the_sky():
    (problem,) = found(sphere([0.0, 6.0, 1.0], 0.3), real=room(without=["front"]))
    assert problem.severity is Severity.ERROR
    assert found(sphere([0.0, 6.0, 1.0], 0.3), real=room(without=["front"]), sky=True) == []


def lamp(to_world):
    material = Emitter(type="emitter", radiance=(9.0, 9.0, 9.0))
    return SyntheticObject("sun", (SyntheticPart(AnalyticShape("disk", np.array(to_world)), material),))


def test_a_sun_is_never_outside():
    sun = lamp([[9.0, 0, 0, 0], [0, -9.0, 0, 0], [0, 0, -1.0, 2000.0], [0, 0, 0, 1.0]])
    assert found(sun, real=room(without=["ceiling"])) == []
    (problem,) = found(sun)
    assert problem.severity is Severity.HINT
    assert "block its light" in problem.message


def test_object_behind_furniture_is_a_warning():
    (problem,) = found(sphere([1.6, 0.0, 0.3], 0.3), real=[*room(), CABINET])
    assert problem.severity is Severity.WARNING
    assert "entirely behind" in problem.message


@pytest.mark.parametrize(
    "standing",
    [
        sphere([0.0, 1.5, 0.2], 0.2),
        thing(box([-0.2, 1.0, 0.0], [0.2, 1.4, 0.5])),
        thing(AnalyticShape("cylinder", np.array([[0.2, 0, 0, 0], [0, 0.2, 0, 1.5], [0, 0, 0.8, 0], [0, 0, 0, 1.0]]))),
        sphere([0.0, 1.5, 1.6], 0.2),  # Hangs high up: meant so.
    ],
)
def test_object_that_stands_well(standing):
    assert found(standing) == []


@pytest.mark.parametrize(
    ("height", "message"), [(0.012, "floats 12.0 mm above"), (-0.03, "reaches 30.0 mm into"), (0.001, None)]
)
def test_object_that_floats_or_sinks(height, message):
    for geometry in (sphere([0.0, 1.5, 0.2 + height], 0.2), thing(box([-1, 1, height], [-0.5, 1.5, 0.5 + height]))):
        problems = found(geometry)
        if message is None:
            assert problems == []
        else:
            assert [p.severity for p in problems] == [Severity.HINT]
            assert message in problems[0].message


def test_object_on_another_object_does_not_float():
    plinth, ball = thing(box([-0.2, 1.3, 0.0], [0.2, 1.7, 0.25]), "plinth"), sphere([0.0, 1.5, 0.35], 0.1)
    assert found(plinth, ball) == []
    assert "floats" in found(ball)[0].message


def test_rug_in_the_floor_coincides_with_it():
    rug = np.diag([0.5, 0.5, 1.0, 1.0])
    rug[1, 3] = 1.5
    (problem,) = found(thing(AnalyticShape("rectangle", rug)))
    assert problem.severity is Severity.WARNING
    assert 'coincides with "floor"' in problem.message
    rug[2, 3] = 0.001
    assert found(thing(AnalyticShape("disk", rug))) == []


def test_object_without_area_is_left_alone():
    flat = Mesh(np.zeros((3, 3), np.float32), np.array([[0, 1, 2]], np.int32))
    assert found(thing(flat)) == []
