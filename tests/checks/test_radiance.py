import numpy as np

from lightdepth.checks import Severity, find_problems

from .rooms import scene


def test_clipped_lights_are_reported():
    radiance = np.full((32, 64, 3), 0.5, np.float32)
    radiance[4:8, 10:20] = 41.0
    (problem,) = find_problems(scene(radiance=radiance))
    assert problem.severity is Severity.WARNING
    assert "clipped" in problem.message
    assert "40 pixels" in problem.message


def test_black_panorama_is_reported():
    (problem,) = find_problems(scene(radiance=np.zeros((32, 64, 3), np.float32)))
    assert "black" in problem.message
