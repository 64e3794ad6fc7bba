"""`lightdepth check` of a scene that moves."""

import json

import pytest

from .room_folder import edit, make_room

KEYS = "{{ frame = [1, 100], value = [{}, {}] }}"


@pytest.fixture
def moving(tmp_path):
    scene = make_room(tmp_path)
    edit(scene, "[panorama]", "[sequence]\nframes = [1, 100]\n\n[panorama]")
    return scene


def test_a_good_sequence(command, moving):
    edit(moving, "center = [0.5, 1.0, 0.3]", "center = " + KEYS.format("[0.5, 1, 0.3]", "[0.7, 1, 0.3]"))
    status, output, _ = command("check", moving)
    assert status == 0
    assert "no problems" in output


def test_what_goes_wrong_has_its_frames(command, moving):
    """The ball, 0.3 m in radius, reaches 10 % of its surface beyond the wall at x = 2 where its centre is at 1.77."""
    edit(moving, "center = [0.5, 1.0, 0.3]", "center = " + KEYS.format("[0.5, 1, 0.3]", "[2.48, 1, 0.3]"))
    edit(moving, "height = 9", "height = 9\nposition = " + KEYS.format("[0, 0, 1.3]", "[0, -3.96, 1.3]"))
    status, output, _ = command("check", moving, "--json")
    assert status == 2
    problems = {p["message"].split(":")[0] + p["severity"]: p for p in json.loads(output)["problems"]}
    through = next(p for p in problems.values() if "goes through a wall" in p["message"])
    outside = next(p for p in problems.values() if "is outside the room: its middle" in p["message"])
    camera = next(p for p in problems.values() if "[camera.view]: is outside the room" in p["message"])
    assert (through["severity"], outside["severity"], camera["severity"]) == ("warning", "error", "warning")
    # x = 0.5 + 0.02 (frame - 1), and the middle is at the wall at frame 76; frames looked at are two or three apart.
    assert 63 <= through["frames"][0] <= 68
    assert through["frames"][-1] < outside["frames"][0]
    assert outside["frames"][-1] == 100
    # y = -0.04 (frame - 1) meets the wall at -3 at frame 76.
    assert 76 <= camera["frames"][0] <= 79
    assert f"(frames {through['frames'][0]:g} to {through['frames'][-1]:g}; the numbers are those" in through["message"]


def test_tables_are_checked_at_every_frame(command, moving):
    """A size that goes through zero at one frame between two keys."""
    box = '[[synthetic]]\nname = "box"\nshape = "cube"\nposition = [0.5, -1, 1]\nmaterial = { type = "diffuse" }\n'
    moving.write_text(moving.read_text() + box + "scale = { frame = [1, 99], value = [0.2, -0.2] }\n")
    status, output, _ = command("check", moving)
    assert status == 2
    assert output.count("error ") == 1
    assert "scene.toml:" in output
    assert "must be one number or three, none of them 0, found [0.0, 0.0, 0.0] (at frame 50)" in output
