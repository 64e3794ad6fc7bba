"""The tuned constants of reconstruction are arguments, and do what their documentation says."""

import warnings

import numpy as np
import pytest

from lightdepth.calibration.line_detection import detect_arcs
from lightdepth.calibration.room_frame import find_room_frame
from lightdepth.directions import latlong_to_direction, pixel_directions, pixel_solid_angles
from lightdepth.errors import InputError, InputWarning
from lightdepth.lightmap.file import LightDepthMap
from lightdepth.parameters.reconstruction import (
    BoxParameters,
    ClickParameters,
    DepthParameters,
    EstimateParameters,
    FloorParameters,
    PlaneParameters,
    PointParameters,
    ReconstructionParameters,
    ReviewParameters,
    SourceParameters,
    UnitParameters,
)
from lightdepth.quickstart.place import guess_place
from lightdepth.quickstart.pose import GuessedPose
from lightdepth.reconstruction.cleaning import without_outliers
from lightdepth.reconstruction.coverage import enclosing_shell, measure_coverage
from lightdepth.reconstruction.depth_image import DepthImage, denoised, fill_missing
from lightdepth.reconstruction.depth_unit import Unit, solve_unit
from lightdepth.reconstruction.floor import find_floor
from lightdepth.reconstruction.from_estimate import surfaces_from_estimate
from lightdepth.reconstruction.layout import Clicked, surfaces_from_layout
from lightdepth.reconstruction.lights import strongest_sources
from lightdepth.reconstruction.point_cloud import PointCloud
from lightdepth.reconstruction.pose import Pose
from lightdepth.reconstruction.room_box import fit_room_box
from lightdepth.reconstruction.room_planes import find_room_planes
from tests.checks.rooms import CAPTURE as CENTRE
from tests.checks.rooms import room
from tests.quickstart.painted_room import CAPTURE as PAINTED
from tests.quickstart.painted_room import painted_room
from tests.reconstruction.test_floor import plane
from tests.reconstruction.test_from_estimate import FILE
from tests.reconstruction.test_layout import FLOOR, PLAN, SOURCE, click, level
from tests.reconstruction.virtual_room import CAPTURE, trace

COARSE = {"rows": 128, "walls": 16, "ceilings": 12, "starts": 1}


def test_clicks_fit_together_as_exactly_as_is_asked_for():
    corner = np.array([*PLAN[0], FLOOR + 2.4])
    beside = corner + [0.6, 0.0, 0.0]
    clicked = Clicked(click(level(PLAN, FLOOR)), ceiling_corner=click([beside]))
    with pytest.raises(InputError, match="within 5 degrees"):
        surfaces_from_layout(clicked, SOURCE, camera_height=1.5)
    surfaces_from_layout(clicked, SOURCE, camera_height=1.5, tuned=ClickParameters(ceiling_corner=12.0))
    middle = np.array([2.0, 0.4, FLOOR + 1.9])
    lamp = Clicked(click(level(PLAN, FLOOR)), lamps=[f"lamp: at={click([middle])} height=1.9 radius=0.1"])
    finer = ClickParameters(lamp_subdivisions=3)
    counts = [
        len(surfaces_from_layout(lamp, SOURCE, camera_height=1.5, ceiling=2.4, tuned=tuned)[-1].mesh.faces)
        for tuned in (ClickParameters(), finer)
    ]
    assert counts == [20 * 4**2, 20 * 4**3]


@pytest.fixture(scope="module")
def painted():
    radiance = painted_room(128)
    return radiance, find_room_frame(detect_arcs(radiance))


def test_a_box_is_as_high_as_is_expected_where_nothing_else_counts(painted):
    radiance, frame = painted
    for height in (2.0, 3.5):
        sure = BoxParameters(**COARSE, usual_height=height, height_weight=1e6, low_weight=0.0, settled=0.0)
        box = fit_room_box(radiance, frame, PAINTED[2], sure)
        assert (box.high[2] - box.low[2]) * PAINTED[2] == pytest.approx(height, rel=0.01)


def test_a_box_is_taken_for_the_room_from_the_evidence_on_that_is_asked_for(painted):
    radiance, frame = painted
    pose = GuessedPose(frame.rotation, float(PAINTED[2]), "", "", frame)
    kinds = [guess_place(radiance, pose, boxes=BoxParameters(**COARSE, likely=share)).kind for share in (0.2, 1.0)]
    assert kinds == ["box", "dome"]


def test_holes_are_closed_and_noise_is_smoothed_as_far_as_is_asked_for(depth, pose):
    down = pose.to_world(pixel_directions(*depth.shape))[..., 2]
    holed = DepthImage(np.where(down < -np.cos(np.radians(32)), np.nan, depth))
    hole = holed.missing
    errors = [
        np.abs(fill_missing(holed, DepthParameters(**some))[hole] / depth[hole] - 1.0).max()
        for some in ({}, {"largest_hole": 20.0})
    ]
    assert errors[0] < 1e-4
    assert errors[1] > 0.05  # Flat on the inside.
    noisy = DepthImage(depth + np.random.default_rng(0).normal(0, 0.01, depth.shape))
    assert denoised(noisy, DepthParameters(negligible_noise=1.0)) is noisy
    assert denoised(noisy) is not noisy


@pytest.fixture(scope="module")
def seen():
    """Reciprocal distances of the room, level."""
    return 1.0 / trace(CAPTURE, pixel_directions(64, 128))


def test_a_unit_needs_as_much_floor_as_is_asked_for(seen):
    rise = pixel_directions(64, 128)[..., 2]
    weights = np.repeat(pixel_solid_angles(64, 128)[:, None], 128, axis=1)
    few = UnitParameters(trials=60)
    unit = solve_unit(3.0 * seen, rise, weights, CAPTURE[2], "disparity", False, few)
    assert unit.scale == pytest.approx(1.0 / 3.0, rel=0.02)
    assert unit.floor < 0.95
    with pytest.raises(InputError, match="no floor is found"):
        solve_unit(
            3.0 * seen, rise, weights, CAPTURE[2], "disparity", False, UnitParameters(trials=60, least_floor=0.95)
        )


def test_planes_are_as_many_and_the_error_as_smooth_as_is_asked_for(seen):
    unit = Unit("disparity", 1.0, 0.0, 1.0)
    found = find_room_planes(seen, CAPTURE[2], unit, PlaneParameters(trials=100, most_walls=2, most_ceilings=0))
    assert (len(found.vectors), found.ceilings, len(found.coefficients)) == (3, 0, 25)
    smooth = find_room_planes(seen, CAPTURE[2], unit, PlaneParameters(trials=100, most_walls=2, degree=1))
    assert len(smooth.coefficients) == 4
    assert smooth.ceilings == 1
    corrected = smooth.correction(pixel_directions(64, 128), seen, unit)
    np.testing.assert_allclose(corrected, seen, rtol=0.05)


def test_an_estimate_is_reported_where_more_is_unknown_than_is_allowed(seen):
    level_pose = Pose(CAPTURE, np.eye(3))
    values = seen.copy()
    values[28:34, 20:30] = 0.0
    planes = PlaneParameters(trials=100, most_walls=4, rounds=2)
    settings = {"kind": "disparity", "shift": False}
    allowed = ReconstructionParameters(planes=planes, estimate=EstimateParameters(much_unknown=0.5))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        surfaces_from_estimate(values, level_pose, CAPTURE[2], FILE, **settings, tuned=allowed)
    with pytest.warns(InputWarning, match="of all directions the estimate means nothing"):
        surfaces_from_estimate(
            values, level_pose, CAPTURE[2], FILE, **settings, tuned=ReconstructionParameters(planes=planes)
        )


def test_a_table_is_a_floor_where_what_is_below_it_does_not_count():
    points = np.concatenate([plane(9_000, [-2, -2], [2, 2], 0.75, seed=1), plane(3_000, [-3, -3], [3, 3], 0.0, seed=2)])
    eye = np.array([0.0, 0.0, 1.6])
    heights = [find_floor(points, eye, tuned=FloorParameters(lower_share=share)).offset for share in (0.25, 0.9)]
    assert heights == pytest.approx([0.0, 0.75], abs=0.01)


def test_points_are_outliers_only_from_the_distance_on_that_is_asked_for():
    grid = np.stack(np.meshgrid(np.arange(20.0), np.arange(20.0), [0.0]), axis=-1).reshape(-1, 3)
    cloud = PointCloud(np.concatenate([grid, [[10.0, 10.0, 6.0]]]))
    lax = PointParameters(outlier_factor=100.0, stray_factor=100.0)
    assert [len(without_outliers(cloud, tuned).points) for tuned in (PointParameters(), lax)] == [400, 401]


def test_a_source_is_as_bright_and_as_large_as_is_asked_for():
    directions = pixel_directions(64, 128)
    toward = directions @ latlong_to_direction(0.5, 0.5)
    light = np.where(toward > np.cos(np.radians(20.0)), 20.0, 0.1)
    light[toward > np.cos(np.radians(8.0))] = 100.0
    pixels = np.repeat(light[..., None], 3, axis=-1).astype(np.float32)
    lamp = LightDepthMap(pixels, np.full((64, 128), np.inf, np.float32), np.zeros(3), np.eye(3))
    (whole,), (core,) = strongest_sources(lamp), strongest_sources(lamp, tuned=SourceParameters(edge=0.5))
    assert (whole.pixels == (light > 1.0)).all()
    assert (core.pixels == (light > 50.0)).all()
    assert not strongest_sources(lamp, tuned=SourceParameters(bright=1000.0))


def test_coverage_and_shell_follow_the_review_s_parameters():
    surfaces, pose = room(without=["front"]), Pose(CENTRE, np.eye(3))
    coarse, fine = (measure_coverage(surfaces, pose, tuned=ReviewParameters(coverage_rows=rows)) for rows in (16, 128))
    exact = measure_coverage(surfaces, pose).open
    assert 0.0 < abs(fine.open - exact) < abs(coarse.open - exact)
    corners = np.concatenate([surface.mesh.vertices for surface in surfaces])
    shell = enclosing_shell(surfaces, pose, ReviewParameters(shell_margin=0.5)).mesh.vertices
    np.testing.assert_allclose(shell.min(axis=0), corners.min(axis=0) - 0.5, atol=1e-5)
