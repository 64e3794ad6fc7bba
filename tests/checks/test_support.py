import numpy as np
import pytest

from lightdepth.checks import Severity, find_problems
from lightdepth.parameters import ChecksParameters
from lightdepth.scene.model import Mesh

from .rooms import RealSurface, Role, box, room, scene, side

SCREEN = RealSurface("screen", box([1.0, -3.0, 0.0], [1.01, 3.0, 2.5]), Role.ENVIRONMENT)


def test_share_of_support_behind_a_screen():
    (problem,) = find_problems(scene([*room(), SCREEN]))
    assert problem.severity is Severity.HINT
    assert '"floor"' in problem.message
    share = float(problem.message.split("cannot see ")[1].split(" %")[0])
    assert share == pytest.approx(25.0, abs=1.5)


def test_what_is_reported_goes_by_the_parameters():
    """The place is the same, and what was found of it is kept: not for other parameters."""
    place = scene([*room(), SCREEN])
    for tuned, found in (
        (ChecksParameters(), [Severity.HINT]),
        (ChecksParameters(much_unseen_support=0.2), [Severity.WARNING]),
        (ChecksParameters(unseen_support=0.3), []),
    ):
        assert [problem.severity for problem in find_problems(place, tuned=tuned)] == found


def test_support_that_is_wholly_unseen():
    unseen = RealSurface("shelf", box([1.5, -1.0, 1.0], [1.9, 1.0, 1.03]), Role.SUPPORT)
    problems = find_problems(scene([*room(), SCREEN, unseen]))
    assert problems[0].severity is Severity.ERROR
    assert '"shelf": the capture point cannot see 100 % of this support' in problems[0].message


@pytest.mark.parametrize(
    ("far", "severity"), [(1.0, None), (1.5, Severity.HINT), (4.0, Severity.WARNING), (14.0, Severity.ERROR)]
)
def test_the_more_support_is_unseen_the_worse(far, severity):
    """A shelf along the line of sight, of which all that lies beyond the screen at x = 1 m is unseen."""
    shelf = RealSurface("shelf", box([0.0, 1.0, 0.5], [far, 1.5, 0.5]), Role.SUPPORT)
    wide = RealSurface("room", box([-2.0, -3.0, 0.0], [far + 1.0, 3.0, 2.5]), Role.ENVIRONMENT)
    problems = [p for p in find_problems(scene([wide, SCREEN, shelf])) if '"shelf"' in p.message]
    assert [problem.severity for problem in problems] == ([] if severity is None else [severity])
    if severity is not None:
        share = float(problems[0].message.split("cannot see ")[1].split(" %")[0])
        assert share == pytest.approx(100 * (1 - 1 / far), abs=1.0)


def test_rest_positions_that_are_seen_will_do():
    shelf = box([1.5, -1.0, 1.0], [1.9, 1.0, 1.03])
    floor = side("floor").vertices
    rest = np.linspace(floor[0] * 0.3, floor[2] * 0.3, len(shelf.vertices), dtype=np.float32)
    rest[:, 0] *= np.where(np.arange(len(rest)) % 2, 0.2, 1.0)
    mesh = Mesh(shelf.vertices, shelf.faces, rest=rest)
    problems = find_problems(scene([*room(), SCREEN, RealSurface("shelf", mesh, Role.SUPPORT)]))
    assert not any('"shelf"' in problem.message for problem in problems)
