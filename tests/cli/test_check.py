import json

import numpy as np

from .room_folder import edit, make_room, write_panorama


def test_good_scene(command, tmp_path):
    status, output, _ = command("check", make_room(tmp_path))
    assert status == 0
    assert "coverage: 100.0 %" in output
    assert "no problems" in output


def test_all_problems_at_once(command, tmp_path):
    """Bad radiance, a hole, a floating object and one outside are told together, though the first is fatal."""
    scene = make_room(tmp_path)
    radiance = np.full((16, 32), 0.5, np.float32)
    radiance[3, 5] = np.nan
    radiance[9, 1:3] = -1.0
    write_panorama(tmp_path / "room.exr", radiance)
    edit(scene, "center = [0.5, 1.0, 0.3]", "center = [0.5, 1.0, 0.35]")
    with scene.open("a") as file:
        file.write(
            '[[synthetic]]\nname = "lost"\nshape = "sphere"\ncenter = [9, 0, 1]\nradius = 0.2\n'
            'material = { type = "glass" }\n'
        )
    status, output, _ = command("check", scene)
    assert status == 2
    for words in (
        "1 pixel has NaN radiance",
        "row 3, column 5",
        "2 pixels have negative radiance",
        '"lost": is outside the room',
        '"ball": floats 50.0 mm',
        "coverage: 100.0 %",
    ):
        assert words in output
    assert sorted(tmp_path.iterdir()) == sorted(
        tmp_path / n for n in ("room.exr", "floor.ply", "walls.ply", "scene.toml")
    )


def test_json(command, tmp_path):
    scene = make_room(tmp_path)
    edit(scene, "center = [0.5, 1.0, 0.3]", "center = [0.5, 1.0, 0.35]")
    status, output, _ = command("check", scene, "--json")
    report = json.loads(output)
    assert status == 0
    assert report["coverage"]["share"] == 1.0
    assert [problem["severity"] for problem in report["problems"]] == ["hint"]


def test_warnings_alone_are_no_failure(command, tmp_path):
    scene = make_room(tmp_path)
    edit(scene, '[[real]]\nname = "walls"\nmesh = "walls.ply"\nrole = "environment"\n', "")
    status, output, _ = command("check", scene)
    assert status == 0
    assert "hit no real surface" in output
    assert "largest hole" in output
