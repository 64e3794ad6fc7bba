"""What meshes leave open, as the reconstruction reports it."""

import numpy as np
import pytest

from lightdepth.directions import euler_rotation
from lightdepth.reconstruction.coverage import measure_coverage
from lightdepth.reconstruction.pose import Pose
from tests.checks.rooms import CAPTURE, room


@pytest.mark.parametrize(("missing", "right"), [("front", 0.0), ("right", 90.0), ("back", 180.0)])
def test_a_hole_is_whole_also_across_the_panoramas_edge(missing, right):
    """Solid angle of a wall of 4 x 2.5 m at 3 m, or 6 x 2.5 m at 2 m, from a point over its middle."""
    a, distance = (3.0, 2.0) if missing == "right" else (2.0, 3.0)
    share = np.arctan(a * 1.25 / (distance * np.sqrt(a * a + 1.25**2 + distance**2))) / np.pi
    coverage = measure_coverage(room(without=[missing]), Pose(CAPTURE, np.eye(3)))
    assert coverage.hole_share == pytest.approx(share, rel=0.01)
    assert coverage.open == pytest.approx(share, rel=0.01)
    assert np.cos(np.radians(coverage.hole[0] - right)) > np.cos(np.radians(0.5))
    assert coverage.hole[1] == pytest.approx(0.0, abs=0.5)


def test_the_largest_of_holes_at_a_pole_and_beside_is_found():
    coverage = measure_coverage(room(without=["ceiling", "front"]), Pose(CAPTURE, euler_rotation([90.0, 0.0, 0.0])))
    assert coverage.hole_share == pytest.approx(coverage.open)  # Both, for they meet.
