"""A virtual room in two fisheye circles side by side, and back: directions, radiance and the seam against the truth."""

import json

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from lightdepth.capture.lens import Lens
from lightdepth.cli.app import app
from lightdepth.directions import pixel_directions
from lightdepth.images.exr import ExrPart, write_exr
from lightdepth.images.radiance import read_radiance
from tests.support.photography import TestCamera, look_up, rig_rotation, sensor_radiance

SIDE, FOV, GAIN = 360, 197.0, 1.2
BACK = (180.9, -0.6, 91.1)
"""Yaw, pitch and roll of the second lens: mounted on its side, and not quite straight."""
OFFSETS = ((6, 3), (-4, 5))
"""Of the circles from the middle of their halves, pixels: right, down."""


def run(*arguments):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


@pytest.fixture(scope="module")
def dual(place):
    """Both circles, linear, shape (404, 808, 3)."""
    picture = np.zeros((404, 808, 3), np.float32)
    camera = TestCamera(size=(SIDE, SIDE), fov=FOV, vignetting=(0.0, 0.0))
    for index, (pose, gain, (right, down)) in enumerate(zip(((0, 0, 0), BACK), (1.0, GAIN), OFFSETS, strict=True)):
        left, top = 404 * index + 22 + right, 22 + down
        picture[top : top + SIDE, left : left + SIDE] = gain * sensor_radiance(place, rig_rotation(*pose), camera)
    return picture


@pytest.fixture(scope="module")
def stitched(dual, tmp_path_factory):
    folder = tmp_path_factory.mktemp("dual")
    write_exr(folder / "dual.exr", [ExrPart({name: dual[..., i] for i, name in enumerate("RGB")}, "", {})])
    result = run(
        "capture", "stitch", folder / "dual.exr", "-o", folder / "pano.exr", "--dual", "--report", folder / "r.json"
    )
    assert result.exit_code == 0, result.output
    return read_radiance(folder / "pano.exr"), json.loads((folder / "r.json").read_text())


def test_directions(stitched):
    """What the found lenses see, pixel by pixel, against what the true ones saw."""
    _, report = stitched
    angles = []
    for index, pose in enumerate(((0, 0, 0), BACK)):
        circle, second = report["circles"][index], report["second"]
        found = (0.0, 0.0, 0.0) if index == 0 else (second["yaw"], second["pitch"], second["roll"])
        column, row = np.meshgrid(np.linspace(30, 330, 31), np.linspace(30, 330, 31))
        inside = np.hypot(column - 180, row - 180) < 0.95 * SIDE / 2
        column, row = column[inside], row[inside]
        truth = Lens(SIDE, SIDE, "fisheye", FOV, yaw=pose[0], pitch=pose[1], roll=pose[2]).unproject(column, row)
        left, top = 404 * index + 22 + OFFSETS[index][0], 22 + OFFSETS[index][1]
        side = 2 * circle["radius"]
        lens = Lens(side, side, "fisheye", report["lens"]["fov"], yaw=found[0], pitch=found[1], roll=found[2])
        seen = lens.unproject(column + left - circle["x"] + side / 2, row + top - circle["y"] + side / 2)
        angles.append(np.degrees(np.arccos(np.clip((truth * seen).sum(axis=-1), -1, 1))))
    both = np.concatenate(angles)
    print(
        f"directions off by {np.median(both):.3f} degrees (median), {both.max():.3f} at most; {report['lens']['fov']:.2f}"
    )
    assert np.median(both) < 0.1
    assert both.max() < 0.3
    assert report["lens"]["fov"] == pytest.approx(FOV, abs=1.0)


def test_radiance_and_seam(stitched, place):
    panorama, report = stitched
    directions = pixel_directions(*panorama.shape[:2])
    truth = look_up(place, directions)
    ratio = np.log(np.maximum(panorama, 1e-9) / np.maximum(truth, 1e-9)).mean(axis=2)
    from_seam = np.degrees(np.arcsin(directions[..., 1]))
    ratio -= np.median(ratio)
    near, front, back = np.abs(from_seam) < 4, from_seam > 4, from_seam < -4
    step = np.median(ratio[front]) - np.median(ratio[back])
    print(
        f"radiance {np.median(np.abs(ratio)):.2%}, near the seam {np.median(np.abs(ratio[near])):.2%}, step {step:.2%}"
    )
    assert np.median(np.abs(ratio)) < 0.02
    assert np.median(np.abs(ratio[near])) < 0.03
    assert abs(step) < 0.01
    gains = np.array(report["exposure"]["gains"])
    np.testing.assert_allclose(gains[0] / gains[1], GAIN, rtol=0.02)
    assert report["exposure"]["disagreement"] < 0.1 * report["exposure"]["disagreement_before"] + 0.02
    assert report["covered"] == pytest.approx(1.0, abs=1e-3)
    assert report["warnings"] == []


def test_a_cameras_jpeg_without_exif_is_stitched_as_well(dual, tmp_path):
    codes = 255 * np.clip(dual / np.percentile(dual, 95), 0, 1) ** (1 / 2.2)
    Image.fromarray(codes.astype(np.uint8)).save(tmp_path / "R0010001.JPG", quality=95)
    refused = run("new", tmp_path / "R0010001.JPG", "-o", tmp_path / "s.toml")
    assert refused.exit_code != 0
    assert "--dual" in str(refused.exception)
    options = ("--dual", "--fov", FOV, "--circles", "208,205,180 602,207,180", "--width", 256)
    result = run("capture", "stitch", tmp_path / "R0010001.JPG", "-o", tmp_path / "p.exr", *options)
    assert result.exit_code == 0, result.output
    assert read_radiance(tmp_path / "p.exr").shape == (128, 256, 3)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--dual", "--circles", "1,2,3"), "two circles"),
        (("--dual", "--circles", "100,100,90 2000,100,90"), "lies outside its 128 x 64 pixels"),
        (("--dual", "--lens", "rectilinear"), "shows no circle"),
        (("--dual", "--distortion", "0,5,0"), "values between -1 and 1"),
        (("--turn", "90"), "go with --dual"),
    ],
)
def test_wrong_options_are_explained(tmp_path, options, message):
    Image.fromarray(np.full((64, 128, 3), 90, np.uint8)).save(tmp_path / "a.png")
    result = run("capture", "stitch", tmp_path / "a.png", "-o", tmp_path / "p.exr", *options)
    assert result.exit_code != 0
    assert message in str(result.exception)
    assert not (tmp_path / "p.exr").exists()
