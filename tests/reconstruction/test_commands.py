"""The commands, as a person calls them."""

import json
import os
import subprocess
import sys
from pathlib import Path

import cv2
import laspy
import numpy as np
import pytest
import trimesh

from lightdepth.directions import pixel_directions
from tests.reconstruction.virtual_room import CAPTURE, LAMPS, ROOM, distance_to_surface, scanned

SOURCE = Path(__file__).parents[2] / "src"


def test_layout_then_lights(command, tmp_path, panorama, pose):
    low, high = ROOM
    corners = np.array([[low[0], low[1], 0], [high[0], low[1], 0], [high[0], high[1], 0], [low[0], high[1], 0]])
    u, v = pose.to_panorama(corners)
    floor = " ".join(f"{x:.3f},{y:.3f}" for x, y in zip(u * 256, v * 128, strict=True))
    place = ["--position", ",".join(map(str, CAPTURE)), "--rotation", "2,-3,25", "--camera-height", 1.5]
    status, printed, errors = command(
        "reconstruct", "layout", panorama, "--floor", floor, "--ceiling", 2.6, *place, "-o", tmp_path / "meshes",
        "--write", tmp_path / "scene.toml", "--picture", tmp_path / "check.png", "--json",
    )  # fmt: skip
    assert (status, errors.strip()) == (
        0,
        f"{tmp_path}/scene.toml does not exist and will be created with this panorama",
    )
    report = json.loads(printed)
    assert report["coverage"] == {"hit": pytest.approx(1.0), "sky": 0.0, "open": 0.0, "largest_hole": None}
    assert [surface["area"] for surface in report["surfaces"]] == pytest.approx([21.0, 47.84, 21.0], rel=1e-3)
    # Edges are drawn where the room's are: along the upright corners.
    picture = cv2.imread(str(tmp_path / "check.png")).astype(int)
    x, y = (
        int(np.round(c * n))
        for c, n in zip(pose.to_panorama(np.array([high[0], high[1], 1.8])), (512, 256), strict=True)
    )
    around = picture[y, x - 4 : x + 5]
    assert (around[:, 2] - around[:, 0]).max() > 100  # Orange.

    status, printed, _ = command(
        "reconstruct", "lights", tmp_path / "scene.toml", "--json", "--table", tmp_path / "lights.csv"
    )
    assert status == 0
    strongest = json.loads(printed)["lights"][0]
    np.testing.assert_allclose(strongest["position"], [0.9, 1.0, 2.6], atol=0.05)
    assert (tmp_path / "lights.csv").read_text(encoding="utf-8").startswith("position_1,position_2,position_3,")


@pytest.mark.filterwarnings("always")
def test_another_height_or_pose_is_reported(command, tmp_path, panorama):
    scene = tmp_path / "scene.toml"
    scene.write_text(f'[panorama]\nimage = "{panorama}"\nposition = [0.0, 0.0, 1.6]\nrotation = [0.0, 0.0, 20.0]\n')
    outdoor = ["--outdoor", "--radius", 20, "-o", tmp_path / "meshes", "--write", scene]
    status, _, errors = command("reconstruct", "layout", scene, "--camera-height", 1.5, *outdoor)
    assert status == 0
    assert "the pose puts the capture point at height 1.6 m, --camera-height says 1.5 m" in errors
    assert "they do not lie on the picture" not in errors
    status, _, errors = command("reconstruct", "layout", panorama, "--camera-height", 1.5, *outdoor)
    assert status == 0
    assert "position is 0, 0, 1.6, and the surfaces were made for 0, 0, 1.5; its rotation is 0, 0, 20, and" in errors


def test_from_depth(command, tmp_path, panorama, depth):
    np.save(tmp_path / "depth.npy", depth)
    status, printed, errors = command(
        "reconstruct", "from-depth", tmp_path / "depth.npy", "--panorama", panorama, "--position", "0.1,-0.2,1.5",
        "--rotation", "2,-3,25", "-o", tmp_path / "meshes",
    )  # fmt: skip
    assert status == 0, errors
    assert sorted(path.name for path in (tmp_path / "meshes").iterdir()) == [
        "behind.ply", "floor.ply", "place.ply", "shell.ply"
    ]  # fmt: skip
    assert "still open: 0 %" in printed


@pytest.mark.filterwarnings("always")
def test_doubts_about_a_file_are_reported(command, tmp_path, depth):
    """The same room as distances along the viewing axis, from a renderer that writes them without a sign."""
    forward = np.abs(pixel_directions(*depth.shape)[..., 1])
    np.save(tmp_path / "z.npy", depth * forward)
    options = ["--position", "0.1,-0.2,1.5", "--rotation", "2,-3,25", "--no-floor", "-o", tmp_path / "meshes"]
    status, _, errors = command("reconstruct", "from-depth", tmp_path / "z.npy", *options)
    assert status == 0
    assert f"warning: {tmp_path}/z.npy: vanishes beside the viewing axis" in errors
    status, printed, errors = command("reconstruct", "from-depth", tmp_path / "z.npy", "--kind", "z", *options)
    assert (status, errors.strip()) == (0, "")
    assert "still open: 0 %" in printed


def test_from_points(command, tmp_path, panorama):
    """A scan with 1 cm noise of which a fifth is missing in one piece, a corner of the room: unseen, but not lost."""
    toward = np.array([-1.0, -1.0, 0.3])
    scan = scanned(toward, 53.0, count=40_000)
    assert len(scan) < 0.81 * 40_000
    las = laspy.create(point_format=0, file_version="1.2")
    las.header.scales, las.header.offsets = [1e-4] * 3, scan.mean(axis=0)
    las.x, las.y, las.z = scan.T
    las.write(str(tmp_path / "scan.las"))
    status, printed, errors = command(
        "reconstruct", "from-points", tmp_path / "scan.las", "--panorama", panorama, "--position", "0.1,-0.2,1.5",
        "--rotation", "2,-3,25", "--detail", 0.08, "-o", tmp_path / "meshes", "--write", tmp_path / "scene.toml",
        "--picture", tmp_path / "check.png", "--json",
    )  # fmt: skip
    assert status == 0, errors
    report = json.loads(printed)
    assert report["coverage"]["open"] == 0.0
    assert report["floor"]["height"] == pytest.approx(0.0, abs=0.01)
    assert cv2.imread(str(tmp_path / "check.png")) is not None
    meshes = [trimesh.load(tmp_path / "meshes" / f"{name}.ply") for name in ("floor", "place")]
    samples = np.concatenate([trimesh.sample.sample_surface(mesh, 10_000, seed=0)[0] for mesh in meshes])
    assert np.median(distance_to_surface(samples)) < 0.02
    ways = samples - CAPTURE
    unseen = ways @ toward > np.cos(np.radians(45.0)) * np.linalg.norm(ways, axis=1) * np.linalg.norm(toward)
    assert np.median(distance_to_surface(samples[unseen])) < 0.02

    status, printed, _ = command("check", tmp_path / "scene.toml", "--json")
    assert status == 0
    checked = json.loads(printed)
    assert checked["coverage"]["share"] == 1.0
    assert "error" not in {problem["severity"] for problem in checked["problems"]}

    # The lamp on the wall hangs where nothing was measured.
    status, printed, _ = command("reconstruct", "lights", tmp_path / "scene.toml", "--json")
    assert status == 0
    found = np.array([light["position"] for light in json.loads(printed)["lights"]])
    for centre, _, _ in LAMPS.values():
        assert np.linalg.norm(found - centre, axis=1).min() < 0.05


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["layout", "PANORAMA", "--floor", "1,2", "--ceiling", "2", "-o", "X", "--camera-height", "1"], "1 corners"),
        (["layout", "PANORAMA", "-o", "X", "--camera-height", "1"], "either --floor (a room) or --outdoor"),
        (["layout", "none.exr", "--outdoor", "-o", "X", "--camera-height", "1"], "none.exr: no such file"),
        (["from-depth", "none.npy", "-o", "X", "--position", "0,0,1"], "none.npy: no such file"),
        (["from-points", "none.ply", "-o", "X", "--position", "0,0"], "--position '0,0': write three numbers"),
        (["lights", "PANORAMA"], "a light-depth map has the channels R, G, B and Z"),
    ],
)  # fmt: skip
def test_bad_input_ends_in_one_message_and_status_2(command, arguments, message, panorama, tmp_path):
    named = {"PANORAMA": str(panorama), "X": str(tmp_path / "meshes")}
    status, _, errors = command("reconstruct", *(named.get(word, word) for word in arguments))
    assert status == 2
    assert errors.startswith("error: ")
    assert message in errors
    assert list(tmp_path.iterdir()) == []


def test_help_has_an_example_and_loads_nothing_heavy():
    code = """
import sys
from lightdepth.cli.app import main
for command in ("layout", "from-depth", "from-points", "lights"):
    sys.argv = ["lightdepth", "reconstruct", command, "--help"]
    try:
        main()
    except SystemExit:
        pass
print("loaded:", {"mitsuba", "drjit", "cv2", "trimesh", "scipy"} & set(sys.modules))
"""
    environment = {**os.environ, "PYTHONPATH": str(SOURCE), "COLUMNS": "200"}
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, check=True)
    for command in ("layout", "from-depth", "from-points", "lights"):
        assert f"Example: lightdepth reconstruct {command}" in shown.stdout
    assert "loaded: set()" in shown.stdout
