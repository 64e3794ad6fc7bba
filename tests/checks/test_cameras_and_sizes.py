"""Objects of a size that cannot be meant or around a camera, and cameras that ask too much of the photograph."""

from dataclasses import replace

import numpy as np
import pytest

from lightdepth.cameras import VR180, EquiAngularCubemap, Equirectangular, Fisheye, OmnidirectionalStereo, Perspective
from lightdepth.checks.cameras import camera_problems, pixels_per_degree
from lightdepth.checks.inspection import find_problems
from lightdepth.checks.problem import Severity
from lightdepth.checks.view import look_around
from lightdepth.directions import look_at_rotation
from lightdepth.parameters import ChecksParameters
from lightdepth.scene.materials import Emitter
from lightdepth.scene.model import CameraView, SyntheticObject
from tests.checks.rooms import CAPTURE, box, room, scene, sphere


def messages(a_scene):
    return [(problem.severity, problem.message) for problem in find_problems(a_scene)]


def camera(position=CAPTURE, look_at=(0.0, 3.0, 1.0), **settings):
    settings = {"width": 64, "height": 40, "fov": 60.0, **settings}
    position = np.asarray(position, float)
    made = Perspective(type="perspective", position=tuple(position.tolist()), **settings)
    return CameraView(made, position, look_at_rotation(position, look_at))


@pytest.mark.parametrize(
    ("radius", "words"),
    [(0.0035, "is 7 x 7 x 7 mm large"), (38.0, "is 76 x 76 x 76 m large"), (0.2, None), (0.006, None)],
)
def test_a_size_that_cannot_be_meant_is_reported(radius, words):
    found = [m for s, m in messages(scene(synthetic=[sphere([0.0, 1.5, radius], radius)])) if "large" in m]
    assert bool(found) == (words is not None)
    if words:
        assert words in found[0]
        assert "scale = 0.001" in found[0]


def test_which_sizes_can_be_meant_goes_by_the_parameters():
    room_with_ball = scene(synthetic=[sphere([0.0, 1.5, 0.3], 0.3)])
    small = find_problems(room_with_ball, tuned=ChecksParameters(largest_object=0.5))
    assert any("is 0.6 x 0.6 x 0.6 m large" in problem.message for problem in small)
    assert not find_problems(room_with_ball)


def test_a_distant_sun_may_be_large():
    sun = sphere([0.0, 0.0, 500.0], 40.0)
    part = replace(sun.parts[0], material=Emitter(type="emitter", radiance=(5.0, 5.0, 5.0)))
    open_room = scene(
        real=[r for r in room() if r.name == "floor"], synthetic=[SyntheticObject("sun", (part,))], sky=True
    )
    assert not any("large" in message for _, message in messages(open_room))


def test_an_object_around_the_capture_point_or_a_camera_is_reported():
    around = scene(synthetic=[sphere(CAPTURE + [0.1, 0.0, 0.0], 0.6)])
    assert any("stands around the capture point" in m for s, m in messages(around) if s is Severity.WARNING)
    beside = replace(scene(synthetic=[sphere([1.0, 1.5, 1.2], 0.6)]), cameras={"view": camera([1.0, 1.5, 1.2])})
    assert any("stands around the camera 'view'" in m for _, m in messages(beside))
    free = replace(scene(synthetic=[sphere([1.0, 1.5, 0.6], 0.6)]), cameras={"view": camera([-1.0, 0.0, 1.2])})
    assert not any("stands around" in m for _, m in messages(free))


def test_a_view_finer_than_the_plate_is_reported_with_the_factor():
    """64 columns are 0.178 pixels a degree; 64 pixels over 10 degrees about 6.4."""
    fine = replace(scene(), cameras={"view": camera(fov=10.0)})
    (hint,) = [m for s, m in messages(fine) if s is Severity.HINT and "softer" in m]
    factor = 64 / (2 * np.tan(np.radians(5))) * np.pi / 180 / (64 / 360)
    assert f"{factor:.1f} times softer" in hint
    coarse = replace(scene(), cameras={"view": camera(width=16, height=10, fov=60.0)})
    assert not any("softer" in m for _, m in messages(coarse))


def test_pixels_per_degree_of_every_camera():
    def posed(made):
        return CameraView(made, CAPTURE, np.eye(3))

    assert pixels_per_degree(posed(Equirectangular(type="equirectangular", width=720))) == pytest.approx(2.0)
    assert pixels_per_degree(posed(Fisheye(type="fisheye", width=540, fov=180))) == pytest.approx(3.0)
    narrow = Perspective(type="perspective", width=100, height=50, fov=1.0)
    assert pixels_per_degree(posed(narrow)) == pytest.approx(100.0, rel=1e-4)
    for made, wanted in (
        (OmnidirectionalStereo(type="ods", width=720, layout="side-by-side"), 1.0),
        (VR180(type="vr180", width=720), 2.0),
        (EquiAngularCubemap(type="eac", width=810), 3.0),
    ):
        assert pixels_per_degree(posed(made)) == pytest.approx(wanted, rel=1e-4)


def test_a_camera_far_from_the_capture_point_is_reported():
    far = replace(scene(), cameras={"view": camera([1.5, -2.5, 1.0])})
    (words,) = (m for _, m in messages(far) if "from the capture point, and surfaces are" in m)
    assert "occluded" not in words  # The room is empty: the capture point sees all of it.
    near = replace(scene(), cameras={"view": camera(CAPTURE + [0.2, 0.1, 0.0])})
    assert not any("from the capture point, and surfaces" in m for _, m in messages(near))


def test_a_camera_that_sees_behind_furniture_is_reported_with_the_share():
    # A screen right before the capture point; the camera a hand's breadth beside it looks behind it.
    from lightdepth.scene.model import RealSurface, Role

    screen = RealSurface("screen", box([-1.0, 0.5, 0.0], [0.02, 0.52, 2.5]), Role.ENVIRONMENT)
    blocked = replace(scene(real=[*room(), screen]), cameras={"view": camera([0.3, 0.4, 1.25], (-1.0, 3.0, 1.0))})
    (hint,) = [
        p.message for p in camera_problems(blocked, [look_around(blocked)], {}) if "occluded from there" in p.message
    ]
    assert int(hint.split(" % of")[0].split()[-1]) > 15


def test_what_is_kept_of_a_camera_is_of_that_camera_and_of_what_was_asked():
    far, other = camera([2.0, 2.5, 1.0]), camera([9.0, 0.0, 1.2])
    one, two = (replace(scene(), cameras={"view": each}) for each in (far, other))
    quiet = [problem for problem in find_problems(one, hints=False) if "[camera.view]" in problem.message]
    assert not quiet
    for _ in range(2):
        assert sum("from the capture point, and surfaces" in message for _, message in messages(one)) == 1
        assert sum("is outside the room" in message for _, message in messages(two)) == 1
