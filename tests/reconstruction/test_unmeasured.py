"""Walls, floor and ceiling go on where a scan saw nothing."""

import numpy as np
import pytest

from lightdepth.directions import euler_rotation
from lightdepth.reconstruction.cleaning import smoothed, thinned
from lightdepth.reconstruction.point_cloud import PointCloud
from lightdepth.reconstruction.unmeasured import continued_planes
from tests.reconstruction.virtual_room import CAPTURE, distance_to_surface, scanned

CELL = 0.08
TURN = euler_rotation([0.0, 0.0, 33.0])
"""The room stands askew in the world."""


def added_to(scan):
    cloud = thinned(PointCloud(scan @ TURN.T), CELL / 2)
    points, normals = smoothed(cloud, TURN @ CAPTURE)
    added, facing = continued_planes(points, normals, TURN @ CAPTURE, CELL)
    return added @ TURN, facing @ TURN


@pytest.mark.parametrize(("name", "toward"), [("a corner", [-1.0, -1.0, 0.3]), ("the ceiling", [0.1, 0.1, 1.0])])
def test_planes_meet_in_their_edges_and_corners(name, toward):
    points, normals = added_to(scanned(np.array(toward), 50.0))
    assert distance_to_surface(points).max() < 0.03
    assert np.percentile(np.abs(normals).max(axis=1), 1) > 0.999  # Along the axes of the room.
    assert (np.einsum("ij,ij->i", normals, CAPTURE - points) > 0).all()
    directions = (points - CAPTURE) / np.linalg.norm(points - CAPTURE, axis=1, keepdims=True)
    # They reach to the middle of what was not seen.
    assert (directions @ toward).max() / np.linalg.norm(toward) > np.cos(np.radians(3.0))


def test_a_wall_that_was_not_seen_at_all_is_closed_where_the_others_end():
    points, normals = added_to(scanned(np.array([-1.0, 0.0, 0.1]), 48.0))
    lid = normals[:, 0] > 0.99
    assert lid.sum() > 500
    assert points[lid, 0].max() - points[lid, 0].min() < 0.05
    assert np.median(distance_to_surface(points[lid])) < 0.1
    assert distance_to_surface(points[~lid]).max() < 0.05


def test_one_does_not_see_through_a_hole_in_furniture():
    """The hole is in the middle of the cupboard's front: it is left open, or the front goes on."""
    points, _ = added_to(scanned(np.array([1.8, -0.5, -0.8]), 10.0))
    assert (distance_to_surface(points) < 0.03).all()


def test_a_capture_point_outside_of_what_was_scanned_is_no_reason_to_fail():
    scan = scanned(np.array([0.0, -1.0, 0.0]), 90.0)
    assert np.isfinite(added_to(scan[scan[:, 1] > 0.5])[0]).all()


def test_what_was_seen_gets_no_points():
    points, _ = added_to(scanned(np.array([0.0, 0.0, -1.0]), 0.0))
    assert len(points) == 0
