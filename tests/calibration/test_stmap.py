"""ST maps: there and back, against OpenCV's undistortion, and through files."""

import cv2
import numpy as np
import pytest
from scipy.ndimage import map_coordinates
from typer.testing import CliRunner

from lightdepth.calibration.stmap import distortion, fit_lens, needed_overscan, undistortion
from lightdepth.cameras import Perspective
from lightdepth.cli.app import app
from lightdepth.images.exr import ExrPart, read_exr, write_exr
from lightdepth.images.stmap import read_stmap, write_stmap

BARREL = Perspective(
    type="perspective", width=320, height=200, fov=70, principal_point=(0.48, 0.53), distortion=(-0.15, 0.03)
)
PINCUSHION = BARREL.model_copy(update={"distortion": (0.12, 0.04)})


def read_at(stmap, film):
    """The map between its pixels, linearly, as a compositing program reads it, for film positions (n, 2)."""
    height, width = stmap.shape[:2]
    x, y = (film * [width, height] - 0.5).T
    return np.stack([map_coordinates(stmap[..., i], [y, x], order=1, mode="nearest") for i in (0, 1)], axis=-1)


@pytest.mark.parametrize("camera", [BARREL, PINCUSHION])
@pytest.mark.parametrize("overscan", [1.0, 1.25])
def test_there_and_back_under_a_twentieth_of_a_pixel(camera, overscan, tmp_path):
    write_stmap(tmp_path / "u.exr", undistortion(camera, overscan))
    write_stmap(tmp_path / "r.exr", distortion(camera, overscan))
    away, back = read_stmap(tmp_path / "u.exr"), read_stmap(tmp_path / "r.exr")
    assert back.shape == (200, 320, 2)
    assert away.shape == (round(200 * overscan), round(320 * overscan), 2)
    assert np.hypot(*((back[4, 4] - away[4, 4]) * [320, 200])) > 10  # They do distort.
    inner = np.s_[4:-4, 4:-4]
    there = back[inner].reshape(-1, 2)
    seen = ((there > 0.02) & (there < 0.98)).all(axis=1)
    assert seen.mean() > (0.99 if overscan > needed_overscan(camera) + 0.05 else 0.8)
    again = read_at(away, there[seen])
    x, y = np.meshgrid((np.arange(320) + 0.5) / 320, (np.arange(200) + 0.5) / 200)
    here = np.stack([x, y], axis=-1)[inner].reshape(-1, 2)[seen]
    assert np.hypot(*((again - here) * [320, 200]).T).max() < 0.05


def test_the_map_is_opencvs_and_counts_from_the_lower_left_corner(tmp_path):
    focal = 160 / np.tan(np.radians(35))
    matrix = np.array([[focal, 0, 0.48 * 320 - 0.5], [0, focal, 0.53 * 200 - 0.5], [0, 0, 1]])
    x, y = cv2.initUndistortRectifyMap(matrix, np.array([-0.15, 0.03, 0, 0]), None, matrix, (320, 200), cv2.CV_32FC1)
    write_stmap(tmp_path / "u.exr", undistortion(BARREL))
    channels = read_exr(tmp_path / "u.exr")[0].channels
    np.testing.assert_allclose(channels["R"], (x + 0.5) / 320, atol=1e-5)
    np.testing.assert_allclose(channels["G"], 1 - (y + 0.5) / 200, atol=1e-5)


@pytest.mark.parametrize("undistorts", [True, False])
def test_a_lens_is_found_from_its_map(undistorts):
    lens = fit_lens(undistortion(BARREL) if undistorts else distortion(BARREL), 70, undistorts)
    np.testing.assert_allclose(lens.distortion, (-0.15, 0.03), atol=1e-5)
    np.testing.assert_allclose(lens.principal_point, (0.48, 0.53), atol=1e-6)
    assert lens.largest < 1e-3


def test_commands(tmp_path):
    scene, away, back = tmp_path / "room.toml", tmp_path / "u.exr", tmp_path / "r.exr"
    scene.write_text(
        '[panorama]\nimage = "none.exr"\n[camera.plate]\ntype = "perspective"\nwidth = 64\nheight = 40\nfov = 60\n'
        "distortion = [-0.2, 0.05]\n"
    )
    run = CliRunner()
    result = run.invoke(app, ["stmap", "write", str(scene), "--undistort", str(away), "--redistort", str(back)])
    assert result.exit_code == 0, result.output
    assert "--overscan 1.0" in result.output
    result = run.invoke(app, ["stmap", "read", str(back), "--fov", "60", "--distorts"])
    assert "distortion = [-0.200000, 0.050000]" in result.output
    write_exr(tmp_path / "half.exr", [ExrPart({"RGB": np.zeros((4, 4, 3), np.float16)})])
    write_exr(tmp_path / "grey.exr", [ExrPart({"Y": np.zeros((4, 4), np.float32)})])
    for arguments, words in (
        (["write", scene], "--undistort"),
        (["write", scene, "--undistort", away, "--camera", "no"], "no camera 'no'"),
        (["write", scene, "--undistort", "u.png"], "OpenEXR"),
        (["read", tmp_path / "half.exr", "--fov", "60"], "32 bits"),
        (["read", tmp_path / "grey.exr", "--fov", "60"], "channels R and G"),
    ):
        failed = run.invoke(app, ["stmap", *map(str, arguments)])
        assert words in str(failed.exception), arguments
