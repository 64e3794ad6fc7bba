"""A second panorama related to the first: clicked and found points in a box whose walls carry a known picture."""

import json

import numpy as np
import pytest

from lightdepth.calibration.relative_pose import SharedPoints, relate
from lightdepth.calibration.scene_file import write_further_pose
from lightdepth.directions import direction_to_latlong, euler_rotation, pixel_directions, rotation_to_euler
from lightdepth.errors import InputError
from lightdepth.images.picture_file import read_picture
from lightdepth.parameters import CalibrationParameters
from lightdepth.scene.load import load_scene
from lightdepth.toml_file import read_toml
from tests.support.commands import run_command, write_rgb
from tests.support.mirror_ball import Box
from tests.support.photography import room_panorama

HALF, WIDTH = 1.5, 1024
FIRST, SECOND = np.array([-0.5, -0.4, 0.1]), np.array([0.5, 0.5, 0.0])
BASELINE = float(np.linalg.norm(SECOND - FIRST))
TURNED, OTHER = euler_rotation([1.0, -2.0, 20.0]), euler_rotation([-3.0, 2.0, 130.0])
LAMPS = np.array(
    [[-0.9, -0.2, -1.5], [1.5, 0.3, 0.8], [0.2, 1.5, -0.4], [-1.5, 0.4, 0.2], [0.6, -1.5, 0.9], [0.1, 0.9, 1.5]]
)
"""Points on the walls,"""
WINDOW = [0.5625, 1.5, 0.9375]
"""and one in the middle of a window that is white all over."""


def run(*arguments):
    return run_command("calibrate", "second", *arguments)


def seen(box, position, rotation):
    """The box as a panorama."""
    directions = pixel_directions(WIDTH // 2, WIDTH) @ rotation.T
    return box.look(np.broadcast_to(position, directions.shape), directions).astype(np.float32)


@pytest.fixture(scope="module")
def place(tmp_path_factory):
    """Folder with two panoramas of a box, one of another place, and a scene file with the first one's pose."""
    folder = tmp_path_factory.mktemp("place")
    box = Box(np.minimum(room_panorama(512), 4.0), HALF)
    write_rgb(folder / "hall.exr", seen(box, FIRST, TURNED))
    write_rgb(folder / "kitchen.exr", 0.5 * seen(box, SECOND, OTHER))
    write_rgb(folder / "elsewhere.exr", seen(Box(room_panorama(256, seed=9), HALF), SECOND, OTHER))
    corners = np.array([[x, y, z] for z in (-HALF, HALF) for y in (-HALF, HALF) for x in (-HALF, HALF)])
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    lines = [f"v {x} {y} {z}" for x, y, z in corners]
    lines += ["f " + " ".join(str(index + 1) for index in face) for face in faces]
    (folder / "box.obj").write_text("\n".join(lines) + "\n")
    (folder / "box.toml").write_text(
        f'[panorama]\nimage = "hall.exr"   # from the door\nposition = {FIRST.tolist()}\n'
        f"rotation = {[float(angle) for angle in rotation_to_euler(TURNED)]}\n\n"
        '[[real]]\nname = "box"\nmesh = "box.obj"\nrole = "environment"\n'
    )
    return folder


def pixels(points, position, rotation):
    u, v = direction_to_latlong((points - position) @ rotation)
    return np.stack([u * WIDTH, v * WIDTH / 2], axis=-1)


def clicks(points=LAMPS, noise=0.0, seed=0):
    """Options for clicks that are off by so many pixels."""
    rng = np.random.default_rng(seed)
    both = (pixels(points, FIRST, TURNED), pixels(points, SECOND, OTHER))
    pairs = zip(*(each + noise * rng.normal(size=each.shape) for each in both), strict=True)
    return [word for one, other in pairs for word in ("--match", f"{one[0]},{one[1]} = {other[0]},{other[1]}")]


def angle(one, other):
    return np.degrees(np.arccos(np.clip((np.trace(one @ other.T) - 1.0) / 2.0, -1.0, 1.0)))


def errors(report):
    rotation, position = euler_rotation(report["rotation"]), np.array(report["position"])
    return angle(rotation, OTHER), np.linalg.norm(position - SECOND) / BASELINE


def test_clicks_give_the_pose(place, tmp_path):
    scene = place / "clicked.toml"
    scene.write_text((place / "box.toml").read_text())
    picture = tmp_path / "check.png"
    arguments = (place / "kitchen.exr", "--scene", scene, *clicks(), "--write", scene, "--picture", picture, "--json")
    report = json.loads(run(*arguments).stdout)
    assert errors(report)[0] < 0.01
    assert errors(report)[1] < 1e-3
    assert report["on_surfaces"] == len(LAMPS)
    assert report["residual_centimetres"] < 0.1
    assert "# from the door" in scene.read_text()
    # Written once, and replaced when written again.
    run(*arguments)
    loaded = load_scene(scene)
    assert len(loaded.panoramas) == 2
    assert np.allclose(loaded.panorama.position, FIRST)
    assert np.allclose(loaded.further[0].position, SECOND, atol=1e-3)
    assert angle(loaded.further[0].rotation, OTHER) < 0.01
    assert read_picture(picture).pixels.shape[1] == 1600


@pytest.mark.parametrize("placed", [True, False])
def test_imprecise_clicks(placed):
    """Clicks of 3 pixels at 2048: the position within 5 % of the baseline; of unmodelled points by the known baseline."""
    rng = np.random.default_rng(5)
    misses = []
    for _ in range(4):
        points = rng.uniform(-HALF, HALF, (12, 3))
        points[np.arange(12), rng.integers(0, 3, 12)] = HALF * rng.choice([-1.0, 1.0], 12)
        noise = np.radians(3.0 * 360.0 / 2048.0)
        one, other = (way / np.linalg.norm(way, axis=1, keepdims=True) for way in (points - FIRST, points - SECOND))
        one, other = (way + noise * rng.normal(size=way.shape) for way in (one, other))
        one, other = (way / np.linalg.norm(way, axis=1, keepdims=True) for way in (one, other))
        reach = np.min((np.sign(one) * HALF - FIRST) / one, axis=1)
        places = FIRST + one * reach[:, None] if placed else np.full_like(one, np.nan)
        names = tuple(str(number) for number in range(12))
        baseline = None if placed else BASELINE
        shared = SharedPoints(names, one, other @ OTHER, places, FIRST, np.full(12, noise), baseline)
        pose = relate(shared)
        misses.append((np.linalg.norm(pose.position - SECOND) / BASELINE, angle(pose.rotation, OTHER)))
        assert angle(pose.rotation, OTHER) < 4.0 * pose.direction_error
    assert np.median([miss for miss, _ in misses]) < 0.05
    if placed:
        with pytest.raises(InputError, match="contradict each other"):
            relate(shared.some(np.arange(4)), CalibrationParameters(second_contradiction=1e-6))


@pytest.mark.parametrize("seed", range(3))
def test_imprecise_clicks_are_moved_by_the_picture(place, seed):
    """Six clicks of 3 pixels at 2048, which alone leave the rotation 0.5 to 0.7 degrees off, and one on a white window."""
    noise = 3.0 * WIDTH / 2048.0
    words = clicks([*LAMPS, WINDOW], noise, seed)
    arguments = (place / "kitchen.exr", "--scene", place / "box.toml", *words, "--snap", "--json")
    report = json.loads(run(*arguments, "--click-error", f"{noise}").stdout)
    assert errors(report)[0] < 0.1
    assert errors(report)[1] < 0.01
    assert errors(report)[1] < 3.0 * report["position_error"] / BASELINE
    assert sum(report["snapped"].values()) >= 4
    assert not report["snapped"]["--match 7"]
    assert "--match 7 where clicked" in report["warnings"][0]


def test_how_many_points_are_enough_is_said(place):
    """Four clicks of 4 pixels: not enough, and the number that is asked for is."""
    four = LAMPS[[0, 1, 2, 3]]
    text = run(
        place / "kitchen.exr", "--scene", place / "box.toml", *clicks(four), "--click-error", "4", "--json"
    ).stdout
    warning = json.loads(text)["warnings"][-1]
    assert "% of the baseline" in warning
    enough = int(warning.split("about ")[-1].split()[0])
    rng = np.random.default_rng(0)
    faces = rng.integers(0, 3, enough)
    more = rng.uniform(-HALF, HALF, (enough, 3))
    more[np.arange(enough), faces] = HALF * rng.choice([-1.0, 1.0], enough)
    report = json.loads(
        run(place / "kitchen.exr", "--scene", place / "box.toml", *clicks(more), "--click-error", "4", "--json").stdout
    )
    assert 2.0 * report["position_error"] < 1.5 * 0.05 * BASELINE


def test_features_give_the_pose(place):
    report = json.loads(run(place / "kitchen.exr", "--scene", place / "box.toml", "--auto", "--json").stdout)
    assert errors(report)[0] < 0.1
    assert errors(report)[1] < 0.01
    assert report["points"] > 100


@pytest.mark.parametrize(
    ("panorama", "arguments", "words"),
    [
        ("kitchen.exr", ("--auto", "--match", "1,1 = 2,2"), "give either"),
        ("kitchen.exr", ("--auto", "--snap"), "--snap moves clicked points"),
        ("kitchen.exr", ("--match", "1,1"), "--match 1: '1,1' is not understood"),
        ("kitchen.exr", clicks(LAMPS[:3]), "3 shared points, 3 of them on modelled surfaces; 4 on modelled surfaces"),
        ("kitchen.exr", (*clicks(), "--match", "100,250 = 900,100"), "without --match 7 they agree to 0.0"),
        ("kitchen.exr", ("--floor-match", "100,100 = 5,5"), "not below the horizon"),
        ("elsewhere.exr", ("--auto",), "look alike"),
        ("hall.exr", (*clicks(), "--write", "SCENE"), "first panorama"),
    ],
)
def test_bad_input(place, panorama, arguments, words):
    arguments = [str(place / "box.toml") if word == "SCENE" else word for word in arguments]
    with pytest.raises(InputError, match=words):
        run(place / panorama, "--scene", place / "box.toml", *arguments)


@pytest.mark.parametrize(
    "text", ["panorama.image = 'x.exr'\n# end\n", "panorama = { image = 'x.exr' }\n", "[panorama]\nimage = 'x.exr'\n"]
)
def test_every_way_to_write_the_first_panorama(tmp_path, text):
    scene = tmp_path / "scene.toml"
    scene.write_text(text + "[render]\nsamples = 4\n")
    write_further_pose(scene, tmp_path / "y.exr", [1, 2, 3], [0, 0, 1])
    tables = read_toml(scene)[1]
    assert tables["panorama"] == [{"image": "x.exr"}, {"image": "y.exr", "position": [0, 0, 1], "rotation": [1, 2, 3]}]
    assert tables["render"] == {"samples": 4}
