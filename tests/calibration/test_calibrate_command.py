"""`lightdepth calibrate` as a person, or another program, runs it."""

import json
import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from lightdepth.calibration.scene_file import write_pose
from lightdepth.cli.app import app
from lightdepth.directions import direction_to_latlong, euler_rotation
from lightdepth.errors import InputError
from lightdepth.images.radiance import write_radiance

WIDTH = 512

SCENE = """\
# The lounge, first try.
[render]
samples = 16   # few

[panorama]           # photographed in May
image = "room.exr"
rotation = [0.0, 0.0, 0.0]   # not yet calibrated
scale = 2.0

[[real]]
mesh = 'floor.ply'
role = "support"
"""


@pytest.fixture(scope="module")
def panorama(room, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("calibrate") / "room.exr"
    write_radiance(path, room.radiance(WIDTH))
    return path


def text(points: np.ndarray) -> str:
    return " ".join(f"{x:.3f},{y:.3f}" for x, y in points)


def run(*arguments) -> dict:
    result = CliRunner().invoke(app, ["calibrate", *map(str, arguments), "--json"], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def test_rectangle_to_json_scene_and_picture(room, panorama, tmp_path):
    scene, picture = panorama.with_name("lounge.toml"), tmp_path / "check.png"
    scene.write_text(SCENE)
    clicks = text(room.pixels(room.RUG, WIDTH))
    found = run(panorama, "--rectangle", clicks, "--width", 2.0, "--write", scene, "--picture", picture)
    np.testing.assert_allclose(found["rotation"], room.ROTATION, atol=0.01)
    np.testing.assert_allclose(found["position"], room.POSITION, atol=0.001)
    np.testing.assert_allclose(found["rectangle_size"], [2.0, 3.0], atol=0.005)
    assert found["residual"] < 0.01
    assert found["confidence"] is None
    assert set(found["residuals"]) == {"rectangle"}

    lines = scene.read_text().splitlines()
    expected = SCENE.splitlines()
    expected[6] = f"rotation = {found['rotation']}   # not yet calibrated"
    expected.insert(8, f"position = {found['position']}")
    assert lines == expected

    # The drawn axes are where the world's are.
    pixels = np.asarray(Image.open(picture)).astype(int)
    assert pixels.shape == (512, 1024, 3)
    for axis in range(3):
        x, y = np.floor(room.pixels(0.6 * np.eye(3)[axis], 1024)).astype(int)
        colour = pixels[y, x]
        assert (colour[axis] > 1.5 * np.delete(colour, axis)).all(), (axis, colour)
    # A grid line of the floor is lighter than the floor beside it.
    line, beside = (room.pixels(np.array([[-1.0, 0.5, 0.0], [-1.15, 0.5, 0.0]]), 1024)).astype(int)
    assert pixels[line[1], line[0]].sum() > 1.3 * pixels[beside[1], beside[0]].sum()


def test_angles_and_verticals_and_heading(room, panorama):
    def degrees(points):
        u, v = direction_to_latlong((points - room.POSITION) @ euler_rotation(room.ROTATION))
        return text(np.stack([(u - 0.5) * 360, (0.5 - v) * 180], axis=-1))

    arguments = []
    for x, y in ((room.LOW[0], room.HIGH[1]), (room.HIGH[0], room.HIGH[1]), (room.LOW[0], room.LOW[1])):
        arguments += ["--vertical", degrees(np.array([[x, y, 0.0], [x, y, room.HIGH[2]]]))]
    heading = degrees(room.POSITION + np.array([[1.0, 1.0, 0.2]]))
    found = run(panorama, "--angles", *arguments, "--heading", heading, "--bearing", 45, "--camera-height", 1.5)
    np.testing.assert_allclose(found["rotation"], room.ROTATION, atol=0.01)
    assert found["position"] == [0.0, 0.0, 1.5]
    assert run(panorama, "--angles", *arguments)["position"] is None


def test_automatic_and_rectangle_together(room, panorama):
    clicks = text(np.round(room.pixels(room.RUG, WIDTH)))
    found = run(panorama, "--auto", "--rectangle", clicks, "--width", 2.0, "--length", 3.0, "--origin", "camera")
    np.testing.assert_allclose(found["rotation"], room.ROTATION, atol=0.3)
    np.testing.assert_allclose(found["position"], [0.0, 0.0, room.POSITION[2]], atol=0.05)
    assert found["confidence"] > 0.9
    assert set(found["residuals"]) == {"rectangle", "room"}


def test_a_scene_of_another_panorama_is_reported(room, panorama, tmp_path):
    scene = tmp_path / "other.toml"
    scene.write_text('[panorama]\nimage = "kitchen.exr"\n')
    found = run(panorama, "--rectangle", text(room.pixels(room.RUG, WIDTH)), "--width", 2, "--write", scene)
    assert any("its panorama is" in warning for warning in found["warnings"])


def test_the_commands_of_the_document(room, tmp_path, monkeypatch):
    """They run, and print the rotations that the document shows."""
    document = (Path(__file__).parents[2] / "docs/calibration.md").read_text(encoding="utf-8")
    shown = re.findall(r"^\$ lightdepth (calibrate .*)\nrotation +(\S+) +(\S+) +(\S+) ", document, re.MULTILINE)
    assert len(shown) == 5
    monkeypatch.chdir(tmp_path)
    write_radiance(Path("room.exr"), room.radiance(1024))
    Path("room.toml").write_text('[panorama]\nimage = "room.exr"   # photographed in May\n')
    for command, *rotation in shown:
        result = CliRunner().invoke(app, shlex.split(command), catch_exceptions=False)
        assert result.exit_code == 0
        printed = re.search(r"rotation +(\S+) +(\S+) +(\S+) ", result.stdout).groups()
        np.testing.assert_allclose(np.array(printed, dtype=float), np.array(rotation, dtype=float), atol=0.02)
    assert Path("room.toml").read_text().strip() in document
    assert {path.name for path in tmp_path.iterdir()} == {"room.exr", "room.toml", "check.png", "auto.png"}


def test_the_table_for_people(room, panorama):
    arguments = ["calibrate", str(panorama), "--rectangle", text(room.pixels(room.RUG[::-1], WIDTH)), "--width", "2"]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0
    assert "rotation" in result.stdout
    assert "clockwise order" in result.stderr


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("panorama.image = 'x.exr'\n# end\n", ["panorama.rotation", "# end"]),
        ("panorama = { image = 'x.exr' }  # short\n", ["rotation = [1.0, 2.0, 3.0]}", "# short"]),
        ("[panorama]\r\nimage = 'x.exr'\r\n", ["image = 'x.exr'\r\n", "rotation = [1.0, 2.0, 3.0]\r\n"]),
        ("[panorama]\nrotation = [\n  1.0, # a\n  2.0,\n  3.0,\n]\nimage = 'x.exr'", ["image = 'x.exr'"]),
    ],
)
def test_poses_are_written_into_any_style_of_scene(tmp_path, text, names):
    import tomllib

    scene = tmp_path / "scene.toml"
    scene.write_bytes(text.encode())
    assert write_pose(scene, [1, 2, 3], [4, 5, -0.0]) == tmp_path / "x.exr"
    written = scene.read_bytes().decode()
    assert all(name in written for name in names), written
    expected = {"image": "x.exr", "rotation": [1.0, 2.0, 3.0], "position": [4.0, 5.0, 0.0]}
    assert tomllib.loads(written) == {"panorama": expected}
    write_pose(scene, [0, 0, 7], None)
    assert tomllib.loads(scene.read_text())["panorama"] == {**expected, "rotation": [0.0, 0.0, 7.0]}


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (None, "no such file"),
        ("[panorama\n", "not valid TOML"),
        ("[render]\nsamples = 4\n", r"has no \[panorama\] table"),
        ("panorama = 3\n", r"has no \[panorama\] table"),
    ],
)
def test_scenes_that_cannot_take_a_pose(tmp_path, content, words):
    scene = tmp_path / "scene.toml"
    if content is not None:
        scene.write_text(content)
    with pytest.raises(InputError, match=words):
        write_pose(scene, [0, 0, 0], None)
    assert list(tmp_path.iterdir()) == ([] if content is None else [scene])


def test_bad_input_ends_in_one_message_and_nothing_written(room, panorama, tmp_path):
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2] / "src")}
    clicks = text(room.pixels(room.RUG, WIDTH))
    command = [sys.executable, "-c", "from lightdepth.cli.app import main; main()", "calibrate", str(panorama)]
    command += ["--rectangle", clicks, "--width", "2", "--picture", "check.png", "--write", "none/missing.toml"]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path, env=environment, check=False)
    assert done.returncode == 2
    assert done.stderr.strip() == "error: none/missing.toml: cannot be written (there is no folder 'none')"
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--rectangle", "1,1 2,2 3,3"], "3 points, 4 are needed"),
        (["--rectangle", "1,1 2,2 3;3 4,4"], "'3' is not a point; write each one as x,y"),
        (["--rectangle", "1,1 2,2 3,nan 4,4"], "point 3 is 3,nan"),
        (
            ["--rectangle", "100,200 300,200 300,400 100,300", "--width", "1"],
            "point 3 is 300,400; allowed are x from -512 to 1024 and y from 0 to 256 pixels",
        ),
        (["--angles", "--vertical", "0,0 0,91"], "point 2 is 0,91"),
        (["--width", "2"], "give --rectangle as well"),
        (["--snap", "--auto"], "--snap moves the corners of a floor rectangle"),
        (["--picture", "check.jpg", "--auto"], "the check picture must be a .png file"),
        (["--bearing", "nan", "--auto"], "--bearing nan"),
        ([], "0 verticals are not enough"),
        (["--auto", "--camera-height", "0"], "camera height 0: a finite number above 0"),
    ],
)
def test_bad_options_are_named(panorama, arguments, words):
    with pytest.raises(InputError) as error:
        CliRunner().invoke(app, ["calibrate", str(panorama), *arguments], catch_exceptions=False)
    assert words in str(error.value)


def test_help_loads_nothing_heavy():
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[2] / "src")}
    program = (
        "import sys, lightdepth.cli.app as c; sys.argv[1:] = ['calibrate', '--help']\n"
        "try: c.main()\n"
        "except SystemExit: pass\n"
        "assert not {'cv2', 'numpy', 'scipy', 'mitsuba'} & set(sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, env=environment, check=False)
    assert done.returncode == 0, done.stderr
    assert "lightdepth calibrate lounge.exr" in done.stdout
