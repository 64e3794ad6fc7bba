"""Gloss that the photograph contradicts."""

import numpy as np
import pytest

from lightdepth.checks import Severity, find_problems
from lightdepth.directions import pixel_directions
from lightdepth.scene.model import Gloss, Panorama, RealSurface, Role, Scene
from tests.checks.rooms import CAPTURE, room, sphere


def found(specular, floor):
    """What is found where the walls send 1 and the floor sends ``floor``."""
    real = tuple(
        RealSurface(each.name, each.mesh, each.role, Gloss(0.3, specular) if each.role is Role.SUPPORT else None)
        for each in room()
    )
    image = np.where(pixel_directions(32, 64)[..., 2:] < -0.4, floor, 1.0) * np.ones(3, np.float32)
    scene = Scene(Panorama(image.astype(np.float32), CAPTURE, np.eye(3)), real, (sphere((0.5, 1.5, 0.3), 0.3),))
    return [p for p in find_problems(scene) if "gloss" in p.message]


def test_a_floor_that_is_too_dark_to_mirror_so_much():
    (problem,) = found(1.0, 0.02)
    assert problem.severity is Severity.WARNING
    assert '[[real]] "floor"' in problem.message
    assert "more than the photograph shows" in problem.message


@pytest.mark.parametrize(("specular", "floor"), [(0.1, 0.5), (0.5, 0.5)])
def test_gloss_that_can_be_is_right(specular, floor):
    assert found(specular, floor) == []
