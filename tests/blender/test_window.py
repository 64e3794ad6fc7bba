"""A person's way through the extension: a real window, a real mouse and keyboard, on a display in memory."""

import json
import shutil
import subprocess

import numpy as np
import pytest
from PIL import Image

from lightdepth.directions import euler_rotation
from lightdepth.images.radiance import write_radiance

WIDTH = 512
SECOND = np.array([2.6, 2.9, 1.4]), np.array([-2.0, 1.0, 140.0])
"""Position and rotation of a second panorama."""
PROGRAMS = {"Xvfb": "xvfb", "xdotool": "xdotool", "nm": "binutils"}
"""Programs that are needed, and Debian's packages that have them."""


@pytest.fixture(scope="module")
def display(folder):
    """A small display, as everything on it is drawn without a graphics card."""
    missing = [package for program, package in PROGRAMS.items() if shutil.which(program) is None]
    if missing:
        pytest.skip(f"Debian's packages {', '.join(missing)} are not installed")
    command = ["Xvfb", "-displayfd", "1", "-screen", "0", "800x540x24", "-nolisten", "tcp", "-fbdir", str(folder)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as server:
        try:
            yield f":{server.stdout.readline().strip()}"
        finally:
            server.terminate()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("window")


@pytest.fixture(scope="module")
def found(blender, room, display, folder):
    write_radiance(folder / "room.exr", room.radiance(WIDTH))
    write_radiance(folder / "second.exr", room.radiance(WIDTH, *SECOND))
    write_radiance(folder / "plate.exr", room.photo(300) / np.float32(255))
    shares = np.array([WIDTH, WIDTH / 2])
    corners = room.pixels(room.RUG, WIDTH) / shares
    others = {
        "second": room.pixels(room.RUG, WIDTH, *SECOND) / shares,
        "plate": room.photo_pixels(room.RUG[1:]) / room.PHOTO.resolution,
    }
    pairs = {name: np.stack([corners[-len(each) :], each], axis=1).tolist() for name, each in others.items()}
    (folder / "truth.json").write_text(json.dumps({"corners": corners.tolist(), "width": 2.0, "pairs": pairs}))
    return blender.run("windowed", folder, DISPLAY=display, LIBGL_ALWAYS_SOFTWARE="1")


@pytest.mark.parametrize(("editor", "degrees", "metres"), [("image editor", 1.5, 0.05), ("viewport", 0.5, 0.02)])
def test_clicks_at_whole_pixels_give_the_pose(found, room, editor, degrees, metres):
    solved = found[editor]
    truth = room.pixels(room.RUG, WIDTH) / (WIDTH, WIDTH / 2)
    if editor == "image editor":  # the whole panorama in the window, a pixel of which is coarse
        np.testing.assert_allclose(solved["corners"], truth, atol=found["pixel"] * 2.0)
    else:
        np.testing.assert_allclose(solved["corners"], truth, atol=0.0005)
    pose = np.array(solved["matrix"])
    off = euler_rotation(room.ROTATION).T @ pose[:3, :3]
    assert np.degrees(np.arccos(np.clip((np.trace(off) - 1.0) / 2.0, -1.0, 1.0))) < degrees
    np.testing.assert_allclose(pose[:3, 3], room.POSITION, atol=metres)
    assert 0.0 <= solved["residual"] < 0.3


def test_points_are_clicked_in_turn_on_two_pictures(found, folder):
    pairs = json.loads((folder / "truth.json").read_text())["pairs"]
    for name, truth in pairs.items():
        np.testing.assert_allclose(found["matched"][name], truth, atol=found["pixel"] * 2.0, err_msg=name)


def test_blender_stays_usable_while_a_renderer_hangs_and_escape_ends_it(found):
    assert found["asked"] == 1
    assert found["asked after Escape"] == [0, True]
    assert "Solve Pose: given up" in found["told after Escape"]


def test_what_is_clicked_on_the_floor_is_modelled(found):
    expected = {
        "Floor": [[-1.0, -2.0, 0.0], [3.0, 4.0, 0.0]],
        "Walls": [[-1.0, -2.0, 0.0], [3.0, 4.0, 2.5]],
        "Box": [[0.0, 2.0, 0.0], [1.0, 2.5, 0.75]],
    }
    for name, bounds in expected.items():
        np.testing.assert_allclose(found["bounds"][name], bounds, atol=0.03, err_msg=name)
    place = {"Floor", "Floor grid", "Walls"}
    assert list(map(set, found["undone"])) == [place, {"Floor grid"}, place, place | {"Box"}]
    assert found["shown"] == "MATERIAL"
    assert found["roles shown"] == ["SOLID", "OBJECT"]


def test_f12_shows_its_progress_and_escape_keeps_what_there_is(found, folder):
    assert len(found["renderers after"]) == 1
    assert found["renderers"] == found["renderers after Escape"] == found["renderers after"]  # the same process
    for name, width in (("finished", 48), ("progressing", 40), ("stopped", 40)):
        pixels = np.asarray(Image.open(folder / f"{name}.png"))
        assert pixels.shape[:2] == (32, width)
        assert pixels[..., :3].std() > 5.0


def test_the_viewport_shows_what_is_placed_and_follows_it(found):
    for name, (inside, shining) in found["green"].items():
        assert inside > 0.97, name
        assert shining > 0.9, name
    assert list(found["green"]) == ["first", "moved", "turned"]


def test_the_preview_and_f12_share_a_process(found):
    assert found["F12 beside the preview"] == 44
    assert found["preview's renderer"] == found["renderers after the preview"] == found["renderers after"]


def test_no_panel_fails_to_draw(found):
    assert "Traceback" not in found["said"]
