"""`lightdepth calibrate view` as a person runs it, and projects of fSpy."""

import json
import re
import shlex
import struct
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from lightdepth.calibration.fspy import read_fspy
from lightdepth.cli.app import app
from lightdepth.directions import euler_rotation
from lightdepth.errors import InputError
from lightdepth.images.radiance import write_radiance
from tests.calibration.calibration_helpers import angle_between

FLAT = """\
[panorama]
image = "room.exr"  # in May
position = [1.3, -0.9, 1.55]
rotation = [3.0, -2.0, 21.0]

[[real]]
name = "floor"
mesh = "floor.obj"
role = "support"
"""


def text(points):
    return " ".join(f"{x:.3f},{y:.3f}" for x, y in points)


@pytest.fixture(scope="module")
def photo(tmp_path_factory):
    path = tmp_path_factory.mktemp("view") / "plate.jpg"
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0xA405] = 25
    Image.new("RGB", (1200, 800), (90, 80, 70)).save(path, exif=exif)
    return path


@pytest.fixture(scope="module")
def lines(room):
    options = []
    for name, points in room.photo_lines():
        options += [f"--{name}", text(room.photo_pixels(points))]
    return options


def points(room, *world):
    options = []
    for place in world:
        click = text(room.photo_pixels(np.array([place], float)))
        options += ["--point", f"{click} = {','.join(map(str, place))}"]
    return options


def run(*arguments):
    result = CliRunner().invoke(app, ["calibrate", "view", *map(str, arguments), "--json"], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def failure(*arguments):
    with pytest.raises(InputError) as caught:
        CliRunner().invoke(app, ["calibrate", "view", *map(str, arguments)], catch_exceptions=False)
    return str(caught.value)


def check_pose(room, report, degrees=0.01, metres=0.003):
    assert angle_between(euler_rotation(report["rotation"]), room.PHOTO_ROTATION) < degrees
    np.testing.assert_allclose(report["position"], room.PHOTO_POSITION, atol=metres)
    assert report["fov"] == pytest.approx(room.PHOTO.fov, abs=0.03)


def test_photograph_to_scene_and_picture(room, photo, lines, tmp_path):
    scene, picture = tmp_path / "flat.toml", tmp_path / "check.png"
    scene.write_text(FLAT + '\n[camera.plate]\ntype = "perspective"\nwidth = 9\nheight = 9\nlook_at = [0, 0, 0]\n')
    known = points(room, (2, 3, 0), (0, 3, 0), (2, 0.1, 0), (3.6, 0.2, 2.05))
    arguments = [photo, *lines, *known, "--distortion", "free", "--write", scene, "--picture", picture]
    report = run(*arguments)
    check_pose(room, report)
    np.testing.assert_allclose(report["distortion"], room.PHOTO.distortion, atol=1e-3)
    assert report["residual"] < 0.01
    assert report["warnings"] == []
    written = scene.read_text()
    assert written.startswith(FLAT)
    assert f"fov = {report['fov']}" in written
    assert "look_at" not in written
    drawn = np.asarray(Image.open(picture))
    assert drawn.shape == (800, 1200, 3)
    # The line along the rug is drawn on beyond its clicks, bent as the lens bends it.
    beyond = room.photo_pixels(np.array([2.0, 3.6, 0.0])) - 0.5
    x, y = np.round(beyond).astype(int)
    around = drawn[y - 2 : y + 3, x - 2 : x + 3].astype(int)
    assert (around[..., 1] - around[..., 0]).max() > 60  # Green is y.


def test_points_that_the_panorama_shows_too(room, photo, tmp_path):
    write_radiance(tmp_path / "room.exr", room.radiance(256))
    corners = "\n".join(f"v {x} {y} {z}" for x, y, z in room.FLOOR)
    (tmp_path / "floor.obj").write_text(f"{corners}\nf 1 2 3 4\n")
    (tmp_path / "flat.toml").write_text(FLAT)
    matches = []
    for place in ([2, 3, 0], [0, 3, 0], [2, 0.1, 0], [1, 2, 0], [3, 4, 0], [3.3, 1, 0]):
        here, there = room.photo_pixels(np.array([place])), room.pixels(np.array([place]), 256)
        matches += ["--match", f"{text(here)} = {text(there)}"]
    lens = ["--distortion", "-0.16,0.03", "--fov", room.PHOTO.fov]
    check_pose(room, run(photo, *matches, *lens, "--scene", tmp_path / "flat.toml"))
    up = f"600,400 = {text(room.pixels(np.array([[1, 2, 2.7]]), 256))}"
    assert "shows no real surface" in failure(photo, "--match", up, "--scene", tmp_path / "flat.toml")


def test_the_command_of_the_document(room, photo):
    document = (Path(__file__).parents[2] / "docs/view-calibration.md").read_text(encoding="utf-8")
    command = re.search(r"^\$ lightdepth calibrate view plate.png (.*) --picture check.png$", document, re.MULTILINE)[1]
    report = run(photo, *shlex.split(command))
    for key in ("rotation", "position", "distortion"):
        shown = re.search(rf"^{key} +(.*)$", document, re.MULTILINE)[1].split()
        np.testing.assert_allclose(report[key], np.array(shown[: len(report[key])], float), atol=2e-3)


def test_field_of_view_of_the_exif_data(room, photo, lines):
    report = run(photo, *lines, "--fov", "exif", "--distortion", "-0.16,0.03", "--camera-height", 1.4)
    # The diagonal of 24 x 36 mm over that of this picture, at 25 mm.
    wanted = 2 * np.degrees(np.arctan(0.5 * np.hypot(36, 24) / np.hypot(1200, 800) * 1200 / 25))
    assert report["fov"] == pytest.approx(wanted, abs=1e-4)
    assert report["fov_error"] == 0
    np.testing.assert_allclose(report["position"], [0, 0, 1.4], atol=1e-3)


def test_fspy_there_and_back(room, photo, lines, tmp_path):
    project = tmp_path / "plate.fspy"
    straight = [photo, *lines, *points(room, (2, 3, 0), (0, 3, 0), (2, 0.1, 0), (3.6, 0.2, 2.05))]
    report = run(*straight, "--distortion", "free", "--fspy", project)
    assert "fSpy knows no distortion" in report["warnings"][0]
    # As fSpy's add-on for Blender reads it: header, camera to world with the camera looking along -z, radians.
    content = project.read_bytes()
    magic, version, state_size, image_size = struct.unpack("<4sIII", content[:16])
    assert (magic, version) == (b"fspy", 1)
    assert content[16 + state_size :] == photo.read_bytes()
    assert image_size == len(photo.read_bytes())
    camera = json.loads(content[16 : 16 + state_size])["cameraParameters"]
    rows = np.array(camera["cameraTransform"]["rows"])
    np.testing.assert_allclose(rows[:3, 3], report["position"], atol=1e-4)
    np.testing.assert_allclose(-rows[:3, 2], euler_rotation(report["rotation"])[:, 1], atol=1e-6)
    np.testing.assert_allclose(rows @ camera["viewTransform"]["rows"], np.eye(4), atol=1e-9)
    assert np.degrees(camera["horizontalFieldOfView"]) == pytest.approx(report["fov"], abs=1e-4)
    assert camera["relativeFocalLength"] == pytest.approx(1 / np.tan(np.radians(report["fov"] / 2)), rel=1e-5)
    # What was written as its lines and its reference distance leads to the same camera.
    again = run(project)
    for key in ("rotation", "position", "fov"):
        np.testing.assert_allclose(again[key], report[key], atol=2e-4)


def test_fspys_one_vanishing_point_and_units(room, photo, lines, tmp_path):
    project = tmp_path / "plate.fspy"
    known = points(room, (2, 3, 0), (0, 3, 0), (2, 0.1, 0), (3.6, 0.2, 2.05))
    report = run(photo, *lines, *known, "--distortion", "free", "--fspy", project)
    content = project.read_bytes()
    state = read_fspy(project).state
    state["globalSettings"]["calibrationMode"] = "OneVanishingPoint"
    state["calibrationSettings1VP"] |= {"principalPointMode": "Default", "horizonMode": "Manual"}
    first, second = state["cameraParameters"]["vanishingPoints"][:2]
    relative = [{"x": 0.5 + p["x"] / 2, "y": 0.5 - p["y"] / 2 * 1.5} for p in (first, second)]
    state["controlPointsState1VP"]["horizon"] = sorted(relative, key=lambda point: point["x"])
    state["calibrationSettingsBase"] |= {"referenceDistanceUnit": "Feet", "referenceDistance": 1 / 0.3048}
    changed = json.dumps(state).encode()
    project.write_bytes(struct.pack("<4sII", b"fspy", 1, len(changed)) + content[12:16] + changed + photo.read_bytes())
    again = run(project)
    assert angle_between(euler_rotation(again["rotation"]), euler_rotation(report["rotation"])) < 0.01
    np.testing.assert_allclose(again["position"], report["position"], atol=1e-3)
    for damage, words in (
        (b"fspz" + content[4:], "does not start like one"),
        (b"fspy\2\0\0\0" + content[8:], "version 2"),
        (content[:200], "cut off"),
        (content.replace(b'"globalSettings": {', b'"globalSettings": 3{'), "not JSON"),
        (content.replace(b'"lineSegments"', b'"lineSegmemts"'), "missing"),
    ):
        project.write_bytes(damage)
        assert words in failure(project)


def test_input_that_is_refused(photo, lines, tmp_path):
    for arguments, words in (
        ([tmp_path / "none.jpg"], "no such file"),
        ([photo, "--x-line", "1,2"], "two or more along the edge"),
        ([photo, "--x-line", "1,2 1300,20"], "not on the photograph of 1200 x 800"),
        ([photo, "--point", "1,2 = 3,4"], "x,y = X,Y,Z"),
        ([photo, "--distance", "1,2 30,40 = -2 m"], "not a length"),
        ([photo, "--match", "1,2 = 3,4"], "--match and --scene go together"),
        ([photo, *lines, "--fov", "wide"], "degrees from 1 to 170"),
        ([photo, *lines, "--distortion", "some"], "two numbers k1,k2"),
        ([photo, *lines, "--picture", "check.jpg"], ".png"),
        ([photo], "do not determine a camera"),
    ):
        assert words in failure(*arguments), arguments
    (tmp_path / "text.jpg").write_text("no picture")
    assert "not a readable photograph" in failure(tmp_path / "text.jpg")
