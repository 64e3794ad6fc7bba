"""Surfaces from depth images of a room that is known exactly."""

from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

from lightdepth.directions import pixel_directions
from lightdepth.errors import InputError
from lightdepth.images.exr import ExrPart, write_exr
from lightdepth.kernel.raycasting import RayCaster
from lightdepth.reconstruction.coverage import measure_coverage
from lightdepth.reconstruction.depth_image import DepthImage, denoised, fill_missing, read_depth_image, reduced
from lightdepth.reconstruction.from_depth import surfaces_from_depth
from lightdepth.scene.model import Role
from tests.reconstruction.virtual_room import CAPTURE, FURNITURE, distance_to_surface, trace

FAULTS = Path(__file__).parents[1] / "faults"


def errors(surface):
    mesh = trimesh.Trimesh(surface.mesh.vertices, surface.mesh.faces, process=False)
    return distance_to_surface(trimesh.sample.sample_surface(mesh, 20_000, seed=0)[0])


@pytest.fixture(scope="module")
def measured(depth, pose):
    """1 cm noise, a fifth of the pixels and everything below the tripod missing."""
    random = np.random.default_rng(0)
    noisy = depth + random.normal(0, 0.01, depth.shape)
    noisy[random.random(depth.shape) < 0.2] = np.nan
    noisy[pose.to_world(pixel_directions(*depth.shape))[..., 2] < -np.cos(np.radians(20))] = np.nan
    return DepthImage(noisy)


def test_a_noisy_image_with_holes_gives_the_room_within_two_centimetres(measured, pose):
    result = surfaces_from_depth(measured, pose)
    surfaces = {surface.name: surface for surface in result.surfaces}
    assert surfaces["floor"].role is Role.SUPPORT
    assert surfaces["place"].role is Role.ENVIRONMENT
    assert np.median(errors(surfaces["floor"])) < 0.005
    assert np.median(errors(surfaces["place"])) < 0.01
    assert result.floor.tilt < 0.2
    assert abs(result.floor.offset) < 0.005
    assert result.sky is None


def test_what_the_capture_point_sees_is_closed_by_what_lies_behind(depth, pose):
    result = surfaces_from_depth(DepthImage(depth), pose)
    *seen, behind = result.surfaces
    assert behind.name == "behind"
    assert measure_coverage(seen, pose).open > 1e-3
    assert measure_coverage(result.surfaces, pose).open < 1e-4


def test_from_beside_one_sees_the_wall_behind_an_object(depth, pose):
    """Rays that pass just beside the cupboard, from half a metre off, meet something near the wall or floor there."""
    result = surfaces_from_depth(DepthImage(depth), pose)
    _, high = FURNITURE["cupboard"]
    targets = np.array([[2.8, high[1] - 0.1, z] for z in np.linspace(0.3, 1.3, 20)])
    origin = CAPTURE + np.array([0.0, 0.6, 0.0])
    directions = (targets - origin) / np.linalg.norm(targets - origin, axis=1, keepdims=True)
    hits = RayCaster([surface.mesh for surface in result.surfaces]).cast(origin, directions)
    assert np.isfinite(hits.distance).all()
    assert np.median(distance_to_surface(origin + directions * hits.distance[:, None].astype(float))) < 0.1


def test_holes_in_planes_are_closed_exactly(depth, pose):
    down = pose.to_world(pixel_directions(*depth.shape))[..., 2]
    holed = np.where(down < -np.cos(np.radians(32)), np.nan, depth)
    filled = fill_missing(DepthImage(holed))
    np.testing.assert_allclose(filled, depth, rtol=1e-4)


def test_an_exact_image_is_not_smoothed(depth):
    assert denoised(DepthImage(depth)).depth is depth


def test_smoothing_takes_noise_away_and_keeps_edges(pose):
    exact = trace(CAPTURE, pose.to_world(pixel_directions(256, 512)))
    random = np.random.default_rng(0)
    noise = random.normal(0, 0.01, exact.shape)
    noise[random.random(exact.shape) < 0.2] = np.nan
    after = denoised(DepthImage(exact + noise)).depth - exact
    assert np.nanmedian(np.abs(after)) < 0.35 * np.nanmedian(np.abs(noise))
    np.testing.assert_array_equal(np.isnan(after), np.isnan(noise))
    edges = np.abs(np.diff(exact, axis=1)) > 0.3
    assert np.nanmedian(np.abs(after[:, 1:][edges])) < 0.015


def test_sky_stays_open_and_is_declared(depth, pose):
    up = pose.to_world(pixel_directions(*depth.shape))[..., 2] > np.sin(np.radians(35))
    result = surfaces_from_depth(DepthImage(np.where(up, np.inf, depth)), pose)
    coverage = measure_coverage(result.surfaces, pose, result.sky)
    assert coverage.sky == pytest.approx(0.5 * (1.0 - np.sin(np.radians(35))), abs=0.01)
    assert coverage.open < 1e-4


def test_large_images_are_reduced_by_medians():
    fine = np.add.outer(np.arange(32.0), np.zeros(64)) + 1.0
    fine[:4, :4] = np.nan
    fine[4:8, 4:6] = 100.0
    coarse = reduced(DepthImage(fine), 16).depth
    assert coarse.shape == (8, 16)
    assert np.isnan(coarse[0, 0])
    assert coarse[1, 1] < 9.0
    assert reduced(DepthImage(fine), 64).depth is fine


def test_every_format_is_read(tmp_path, depth):
    np.save(tmp_path / "depth.npy", depth)
    write_exr(tmp_path / "depth.exr", [ExrPart({"Y": depth.astype(np.float32)})])
    millimetres = np.round(depth * 1000).astype(np.uint16)
    millimetres[:3] = 0
    cv2.imwrite(str(tmp_path / "depth.png"), millimetres)
    np.testing.assert_array_equal(read_depth_image(tmp_path / "depth.npy").depth, depth)
    np.testing.assert_allclose(read_depth_image(tmp_path / "depth.exr", scale=2.0).depth, 2 * depth, rtol=1e-6)
    png = read_depth_image(tmp_path / "depth.png", scale=0.001)
    assert png.missing[:3].all()
    np.testing.assert_allclose(png.depth[3:], depth[3:], atol=5.1e-4)
    assert np.isinf(read_depth_image(tmp_path / "depth.png", scale=0.001, sky=True).depth[:3]).all()


def test_distances_along_the_viewing_axis_give_those_along_the_rays():
    """Both files show one room."""
    truth = read_depth_image(FAULTS / "07-depth/layer_z.exr").depth
    depth = read_depth_image(FAULTS / "28-depth/zdepth.npy", kind="z").depth
    known = ~np.isnan(depth)
    assert known.mean() > 0.9
    np.testing.assert_allclose(depth[known], truth[known], rtol=1e-4)


def test_what_is_far_may_be_sky(tmp_path):
    depth = np.full((16, 32), 3.0)
    depth[:4] = 200.0
    np.save(tmp_path / "x.npy", depth)
    read = read_depth_image(tmp_path / "x.npy", scale=2.0, sky_beyond=400.0).depth
    assert np.isinf(read[:4]).all()
    assert (read[4:] == 6.0).all()


def test_wrong_files_are_explained(tmp_path):
    cv2.imwrite(str(tmp_path / "eight.png"), np.full((16, 32), 9, np.uint8))
    cv2.imwrite(str(tmp_path / "sixteen.png"), np.full((16, 32), 9, np.uint16))
    np.save(tmp_path / "square.npy", np.ones((16, 16)))
    np.save(tmp_path / "whole.npy", np.full((16, 32), 900, np.int32))
    np.save(tmp_path / "empty.npy", np.zeros((16, 32)))
    (tmp_path / "broken.npy").write_bytes(b"\x93NUMPY")
    (tmp_path / "depth.jpg").touch()
    for name, scale, message in (
        ("none.npy", None, "no such file"),
        ("eight.png", 0.001, "one channel of 16 bit"),
        ("sixteen.png", None, "give --scale"),
        ("square.npy", None, "twice as many columns"),
        ("whole.npy", None, "holds whole numbers; give --scale"),
        ("empty.npy", None, "no pixel holds a positive"),
        ("broken.npy", None, "not a readable .npy"),
        ("depth.jpg", None, r"allowed are .exr, .png"),
    ):
        with pytest.raises(InputError, match=message):
            read_depth_image(tmp_path / name, scale)
