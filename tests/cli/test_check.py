import json

import numpy as np
import pytest
import trimesh

from .room_folder import edit, make_room, write_panorama


def test_good_scene(command, tmp_path):
    status, output, _ = command("check", make_room(tmp_path))
    assert status == 0
    assert "coverage: 100.0 %" in output
    assert "no problems" in output


LOST = """
[[synthetic]]
name = "lost"
shape = "sphere"
center = [9, 0, 1]
radius = 0.2
material = { type = "glass" }
"""


def test_all_problems_at_once(command, tmp_path):
    """What is wrong in the scene file, in its files, in the panorama, in the place and with the objects."""
    scene = make_room(tmp_path)
    radiance = np.full((16, 32), 0.5, np.float32)
    radiance[3, 5] = np.nan
    radiance[9, 1:3] = -1.0
    write_panorama(tmp_path / "room.exr", radiance)
    walls = trimesh.load(tmp_path / "walls.ply")
    walls.update_faces(np.arange(len(walls.faces)) != np.argmax(walls.triangles_center[:, 2]))
    walls.export(tmp_path / "walls.ply")
    edit(scene, "center = [0.5, 1.0, 0.3]", "center = [0.5, 1.0, 0.35]\nradios = 0.2")
    table = '[[real]]\nname = "table"\nmesh = "table.ply"\nrole = "environment"\n'
    scene.write_text(scene.read_text() + table + LOST)
    before = sorted(tmp_path.iterdir())
    status, output, _ = command("check", scene)
    assert status == 2
    for words in (
        "unknown key 'radios'; did you mean 'radius'?",
        '[[real]] 3 ("table"): mesh:',
        "table.ply: no such file",
        "1 pixel has NaN radiance",
        "row 3, column 5",
        "2 pixels have negative radiance",
        "of all directions, without 1 surface that could not be read, hit no real surface",
        '"lost": is outside the room',
        '"ball": floats 50.0 mm',
        "of all directions meet a real surface",
    ):
        assert words in output
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.parametrize("spoil", ["missing", "square", "wrong scale"])
def test_the_place_is_checked_without_its_picture(command, tmp_path, spoil):
    scene = make_room(tmp_path)
    scene.write_text(scene.read_text() + LOST)
    if spoil == "missing":
        (tmp_path / "room.exr").unlink()
    elif spoil == "square":
        write_panorama(tmp_path / "room.exr", np.ones((16, 16), np.float32))
    else:
        edit(scene, 'image = "room.exr"', 'image = "room.exr"\nscale = -1')
    status, output, _ = command("check", scene)
    assert status == 2
    assert {"missing": "no such file", "square": "twice as wide", "wrong scale": "greater than 0"}[spoil] in output
    assert '"lost": is outside the room' in output
    assert "coverage: 100.0 %" in output
    assert output.count("error ") == 2


def test_the_picture_is_checked_without_its_pose(command, tmp_path):
    scene = make_room(tmp_path)
    edit(scene, "position = [0.0, 0.0, 1.3]", 'position = "here"')
    radiance = np.full((16, 32), np.inf, np.float32)
    write_panorama(tmp_path / "room.exr", radiance)
    status, output, _ = command("check", scene)
    assert status == 2
    assert "position: must be a list of 3 numbers" in output
    assert "512 pixels have infinite radiance" in output


def test_an_object_of_a_wrong_material_is_still_checked(command, tmp_path):
    scene = make_room(tmp_path)
    scene.write_text(scene.read_text() + LOST.replace('"glass"', '"glas"'))
    status, output, _ = command("check", scene)
    assert status == 2
    assert "did you mean 'glass'?" in output
    assert '"lost": is outside the room' in output


def test_json(command, tmp_path):
    scene = make_room(tmp_path)
    edit(scene, "center = [0.5, 1.0, 0.3]", "center = [0.5, 1.0, 0.35]")
    status, output, _ = command("check", scene, "--json")
    report = json.loads(output)
    assert status == 0
    assert report["coverage"]["share"] == 1.0
    assert [problem["severity"] for problem in report["problems"]] == ["hint"]


def without_walls(scene):
    edit(scene, '[[real]]\nname = "walls"\nmesh = "walls.ply"\nrole = "environment"\n', "")


def test_a_hole_is_an_error_unless_it_is_sky(command, tmp_path):
    scene = make_room(tmp_path)
    without_walls(scene)
    status, output, _ = command("check", scene)
    assert status == 2
    assert "hit no real surface" in output
    assert "largest hole" in output
    edit(scene, 'image = "room.exr"', 'image = "room.exr"\nsky = true')
    status, output, _ = command("check", scene)
    assert status == 0
    assert "% are sky" in output
    assert "no problems" in output


def test_warnings_alone_are_no_failure(command, tmp_path):
    scene = make_room(tmp_path)
    write_panorama(tmp_path / "room.exr", np.zeros((16, 32), np.float32))
    status, output, _ = command("check", scene)
    assert status == 0
    assert "black everywhere" in output
