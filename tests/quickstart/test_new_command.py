"""`lightdepth new`: a scene and a picture without a question."""

import numpy as np
import pytest
import trimesh
from PIL import Image

from lightdepth.checks.sampling import object_mesh
from lightdepth.images.exr import read_exr
from lightdepth.images.radiance import write_radiance
from lightdepth.scene.load import load_scene
from tests.cli.room_folder import make_room
from tests.quickstart.painted_room import meadow, painted_room


@pytest.fixture
def field(tmp_path):
    write_radiance(tmp_path / "field.exr", meadow(64))
    return tmp_path / "field.exr"


def test_a_room_becomes_a_box_with_objects_on_its_floor(command, tmp_path):
    write_radiance(tmp_path / "room.exr", painted_room(256))
    trimesh.creation.box(bounds=[[500, 0, 20], [700, 100, 120]]).export(tmp_path / "crate.stl")  # In millimetres.
    status, _, err = command(
        "new",
        tmp_path / "room.exr",
        tmp_path / "crate.stl",
        "-o",
        tmp_path / "r.toml",
        "--no-draft",
        "--camera-height",
        1.5,
    )
    assert status == 0
    assert "as if it were in millimetres" in err
    text = (tmp_path / "r.toml").read_text()
    assert "guess: a box of" in text.lower()
    assert "# as given" in text
    scene = load_scene(tmp_path / "r.toml")
    assert {surface.name for surface in scene.real} == {"floor", "walls", "ceiling"}
    vertices = object_mesh(scene.synthetic[0]).vertices
    assert vertices[:, 2].min() == pytest.approx(0.0, abs=1e-3)
    np.testing.assert_allclose(np.sort(np.ptp(vertices, axis=0)), [0.1, 0.1, 0.2], atol=1e-3)
    status, out, _ = command("check", tmp_path / "r.toml")
    assert status == 0
    assert "synthetic" not in out  # It stands on the floor, neither above nor in it.
    assert "coverage: 100.0 %" in out


def test_the_open_gets_ground_sky_balls_and_a_picture(command, field, tmp_path):
    status, _, err = command("new", field, "-o", tmp_path / "f.toml")
    assert status == 0
    assert "warning: the camera's height is not known and taken as 1.6 m" in err
    text = (tmp_path / "f.toml").read_text()
    for key in ("position", "rotation", "sky", "at"):
        assert any(line.startswith(f"{key} = ") and "# guess" in line for line in text.splitlines()), key
    scene = load_scene(tmp_path / "f.toml")
    assert scene.panorama.sky
    assert [thing.name for thing in scene.synthetic] == ["chrome", "grey"]
    picture = np.asarray(Image.open(tmp_path / "f-view.png"))
    assert picture.shape[1] == scene.cameras["view"].camera.width
    assert (tmp_path / "f-view.exr").is_file()
    # The sun stands 45 degrees high to the right and behind: the chrome ball's shadow falls to its front and left, where
    # the grass is darker than any in the photograph (0.098).
    x, y, radius = (scene.synthetic[0].parts[0].geometry.to_world[i, 3] for i in range(3))
    view = scene.cameras["view"]
    across, forward, up = (
        np.array([x - 1.5 * radius * 0.707, y - 1.5 * radius * 0.707, 0.0]) - view.position
    ) @ view.rotation
    half = np.tan(np.radians(view.camera.fov) / 2)
    column = int((across / forward / half + 1.0) / 2.0 * view.camera.width)
    row = int(view.camera.height / 2.0 - up / forward / half * view.camera.width / 2.0)
    channels = read_exr(tmp_path / "f-view.exr", interleaved=True)[0].channels
    green = next(channels[name] for name in ("RGB", "RGBA") if name in channels)[..., 1]
    assert green[row - 2 : row + 3, column - 2 : column + 3].mean() < 0.08
    assert green[row - 2 : row + 3, :20].mean() > 0.11


def test_commands_in_the_file_can_be_pasted(command, field, tmp_path):
    assert command("new", field, "-o", tmp_path / "my field.toml", "--no-draft")[0] == 0
    text = (tmp_path / "my field.toml").read_text()
    assert "`lightdepth render 'my field.toml' --camera view`" in text
    assert "layout 'my field.toml'" in text
    assert "-o 'my field' --write 'my field.toml'" in text


def test_a_scene_file_is_never_replaced(command, field, tmp_path):
    scene = make_room(tmp_path)
    before = scene.read_bytes()
    status, _, err = command("new", field, "-o", scene)
    assert status == 2
    assert "exists already" in err
    assert scene.read_bytes() == before


def test_what_cannot_be_used_is_refused_and_nothing_is_written(command, field, tmp_path):
    flat = tmp_path / "flat.obj"
    flat.write_text("v 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\n")
    portrait = tmp_path / "portrait.jpg"
    Image.fromarray(np.full((96, 64, 3), 90, np.uint8)).save(portrait)
    for arguments, words in (
        ((field, flat), "degenerate (without area)"),
        ((field, tmp_path / "none.glb"), "no such file"),
        ((portrait,), "stands upright like a portrait"),
        ((field, "-o", tmp_path / "x.json"), "ends in .toml"),
    ):
        given = () if "-o" in arguments else ("-o", tmp_path / "x.toml")
        status, _, err = command("new", *arguments, *given)
        assert status == 2
        assert words in err
        assert not (tmp_path / "x.toml").exists()
        assert not (tmp_path / "x").exists()


def test_impossible_radiance_is_replaced_with_a_word(command, tmp_path):
    radiance = meadow(32)
    radiance[3, 5] = np.nan
    write_radiance(tmp_path / "spoilt.exr", radiance)
    status, _, err = command("new", tmp_path / "spoilt.exr", "-o", tmp_path / "s.toml", "--no-draft", "--place", "dome")
    assert status == 0
    assert "1 pixel has NaN radiance" in err
    assert "--repair" in err
    assert "as asked for; a dome" in err
    assert {surface.name for surface in load_scene(tmp_path / "s.toml", repair=True).real} == {"floor", "dome"}
