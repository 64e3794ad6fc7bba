"""Photographs of a mirror ball to the panorama around it."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from lightdepth.capture.fisheye import Circle
from lightdepth.capture.mirror_ball.geometry import view_from_circle
from lightdepth.capture.mirror_ball.reflectance import metal_reflectance
from lightdepth.capture.mirror_ball.unwrapping import Ball, sample
from lightdepth.directions import pixel_directions, pixel_solid_angles
from lightdepth.errors import InputError
from lightdepth.images.beauty import read_beauty
from lightdepth.parameters import MirrorBallParameters
from lightdepth.toml_file import read_toml
from tests.support.commands import run_command, write_rgb
from tests.support.mirror_ball import ALBEDO, Box, computed_photograph, fresnel
from tests.support.photography import look_up, room_panorama

FOV, WIDTH, RADIUS = 11.0, 400, 0.05
FIRST, SECOND = np.array([0.1, -0.9, 0.12]), np.array([0.85, 0.2, 0.16])
REFLECTANCE = f"{fresnel(np.ones(1))[0]:.4f}"
EXPOSED = ("--fov", FOV, "--reflectance", REFLECTANCE)


def run(*arguments):
    return run_command("capture", "mirror-ball", *arguments)


@pytest.fixture(scope="module")
def place():
    return room_panorama(128)


@dataclass
class Shoot:
    """Two photographs of the ball in a box 3 m wide, the second half a stop darker; what one of a distant place gives."""

    first: Path
    second: Path
    rotation: np.ndarray
    turned: np.ndarray
    box: Box
    circles: tuple[str, str]
    panorama: Path
    figures: dict


@pytest.fixture(scope="module")
def shoot(place, tmp_path_factory):
    folder = tmp_path_factory.mktemp("ball")
    box = Box(place, 1.5)
    first, rotation = computed_photograph(box, FIRST, WIDTH, FOV, RADIUS)
    second, turned = computed_photograph(box, SECOND, WIDTH, FOV, RADIUS)
    paths = write_rgb(folder / "a.exr", first), write_rgb(folder / "b.exr", second * 2**-0.5)
    report = folder / "report.json"
    distant, _ = computed_photograph(Box(place), FIRST, WIDTH, FOV, RADIUS)
    run(write_rgb(folder / "distant.exr", distant), "-o", folder / "out.exr", *EXPOSED, "--report", report)
    circles = [true_circle(np.linalg.norm(position) / RADIUS) for position in (FIRST, SECOND)]
    figures = json.loads(report.read_text())
    return Shoot(*paths, rotation, turned, box, tuple(circles), folder / "out.exr", figures)


def true_circle(distance):
    """Of a ball in the middle of the photograph."""
    radius = WIDTH / 2.0 / np.tan(np.radians(FOV / 2.0)) * np.tan(np.arcsin(1.0 / distance))
    return f"{WIDTH / 2},{WIDTH * 3 / 8},{radius}"


def error(path, place, rotation, degrees=150.0):
    """Relative differences from the true panorama within an angle from the camera, and what is covered."""
    found = read_beauty(path)
    directions = pixel_directions(*found.radiance.shape[:2])
    truth = look_up(place, directions @ rotation.T)
    near = -directions[..., 1] > np.cos(np.radians(degrees))
    return (found.radiance / truth - 1.0)[near & (found.alpha > 0.5)], found


def test_reflected_and_mirrored_are_inverse():
    view = view_from_circle("ball", 800, 600, Circle(450, 310, 200), focal_length=1200.0)
    assert view_from_circle(
        "ball", 800, 600, Circle(450, 310, 200), distance=view.distance
    ).focal_length == pytest.approx(1200.0, rel=1e-6)
    y, x = np.mgrid[130:490:20, 260:640:20] + 0.5
    directions = view.reflected(x, y)
    on_ball = np.isfinite(directions[..., 0])
    normals, _, _ = view.mirror(directions[on_ball])
    assert np.allclose(np.stack(view.seen_at(normals), -1), np.stack([x[on_ball], y[on_ball]], -1), atol=1e-4)
    # The same for points 20 radii along the reflected rays, which are elsewhere seen from the ball's centre.
    points = normals + 20.0 * directions[on_ball]
    length = np.linalg.norm(points, axis=1)
    assert np.allclose(view.mirror(points / length[:, None], length)[0], normals, atol=1e-7)
    # Two pixels inside the outline a photograph counts, or not.
    ball = Ball("ball", np.ones((600, 800, 3), np.float32), np.zeros((600, 800), bool), view, np.full(3, 0.6))
    near = view.reflected(np.array([450.0 + 198.0]), np.array([310.0]))
    assert sample(ball, near).weight > 0.0
    assert sample(ball, near, tuned=MirrorBallParameters(unwrap_none=2.5)).weight == 0.0


def test_metal_reflects_as_fresnel_says():
    cosine = np.cos(np.radians([0.0, 30.0, 60.0, 75.0, 85.0]))
    truth = fresnel(cosine)
    assert np.allclose(metal_reflectance(np.full(3, truth[0]), cosine), truth[:, None], rtol=0.01)


def test_one_photograph(shoot, place):
    found = shoot.figures["photographs"][0]
    differences, panorama = error(shoot.panorama, place, shoot.rotation)
    assert np.median(np.abs(differences)) < 0.05
    assert np.abs(np.median(differences)) < 0.01
    # The outline: a quarter of a pixel, that is a quarter of a degree of what is mirrored.
    truth = [float(value) for value in shoot.circles[0].split(",")]
    assert np.allclose([found["circle"][key] for key in ("x", "y", "radius")], truth, atol=0.25)
    distance = np.linalg.norm(FIRST) / RADIUS
    assert found["distance_radii"] == pytest.approx(distance, rel=0.003)
    # The ball hides as much as it covers itself.
    hidden = 0.5 * (1.0 - np.sqrt(1.0 - 1.0 / distance**2))
    assert 1.0 - shoot.figures["covered"] > hidden
    assert [zone["covered"] > 0.99 for zone in shoot.figures["zones"]] == [True] * 4 + [False, False]
    resolutions = [zone["degrees_per_pixel"] for zone in shoot.figures["zones"][:5]]
    assert resolutions == sorted(resolutions)
    # A surface there, however it faces, is lit as by the true panorama.
    directions = pixel_directions(*panorama.radiance.shape[:2])
    weight = pixel_solid_angles(*panorama.radiance.shape[:2])[:, None, None]
    truth = look_up(place, directions @ shoot.rotation.T)
    normals = pixel_directions(8, 16).reshape(-1, 3)
    cosine = np.maximum(np.tensordot(normals, directions, axes=(1, 2)), 0.0)
    lit = [np.tensordot(cosine, light * weight, axes=((1, 2), (0, 1))) for light in (panorama.radiance, truth)]
    assert np.abs(lit[0] / lit[1] - 1.0).mean() < 0.03


def test_two_photographs_with_the_place(shoot, place, tmp_path):
    scene = box_scene(tmp_path, shoot.rotation, shoot.box.half)
    report = tmp_path / "report.json"
    options = (*EXPOSED, "--photographer", 10, "--width", 256)
    run(shoot.first, shoot.second, "-o", tmp_path / "with.exr", *options, "--scene", scene, "--ball-diameter",
        2 * RADIUS, "--report", report)  # fmt: skip
    circles = [word for circle in shoot.circles for word in ("--circle", circle)]
    run(shoot.first, shoot.second, "-o", tmp_path / "without.exr", *options, *circles, "--turn", 87)
    figures = json.loads(report.read_text())
    found = figures["photographs"][1]
    off = np.array(found["rotation"]) @ (shoot.rotation.T @ shoot.turned).T
    assert np.degrees(np.arccos(np.clip((np.trace(off) - 1.0) / 2.0, -1.0, 1.0))) < 0.15
    assert found["gain_stops"] == pytest.approx(0.5, abs=0.03)
    assert figures["covered"] == 1.0
    corrected, _ = error(tmp_path / "with.exr", place, shoot.rotation, 180.0)
    distant, _ = error(tmp_path / "without.exr", place, shoot.rotation, 180.0)
    assert np.median(np.abs(corrected)) < 0.05
    # Five centimetres beside the middle of a room three metres wide are two degrees.
    assert np.median(np.abs(corrected)) < 0.7 * np.median(np.abs(distant))


def box_scene(folder, rotation, half):
    """A scene file of the box with the ball's panorama."""
    from lightdepth.directions import rotation_to_euler

    corners = np.array([[x, y, z] for z in (-half, half) for y in (-half, half) for x in (-half, half)])
    faces = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]
    lines = [f"v {x} {y} {z}" for x, y, z in corners]
    lines += ["f " + " ".join(str(index + 1) for index in face) for face in faces]
    (folder / "box.obj").write_text("\n".join(lines) + "\n")
    write_rgb(folder / "pano.exr", np.ones((8, 16, 3), np.float32))
    angles = [float(angle) for angle in rotation_to_euler(rotation)]
    (folder / "box.toml").write_text(
        f'[panorama]\nimage = "pano.exr"\nposition = [0.0, 0.0, 0.0]\nrotation = {angles}\n\n'
        '[[real]]\nname = "box"\nmesh = "box.obj"\nrole = "environment"\n'
    )
    return folder / "box.toml"


def test_grey_ball_solves_a_clipped_sun(place, tmp_path):
    box = Box(np.minimum(place, 3.0), sun=400.0)
    beside = 2.5 * RADIUS
    picture, rotation = computed_photograph(box, FIRST, WIDTH, 26.0, RADIUS, grey_beside=beside)
    level = 0.55 * 8.0
    clipped = np.minimum(picture, level).astype(np.float32)
    reach = WIDTH / 2.0 / np.tan(np.radians(13.0))
    scale = reach / np.linalg.norm(FIRST)
    circle = f"{WIDTH / 2 + beside * scale},{WIDTH * 3 / 8},{RADIUS * scale}"
    scene = tmp_path / "room.toml"
    run(write_rgb(tmp_path / "a.exr", clipped), "-o", tmp_path / "out.exr", "--fov", 26, "--reflectance", REFLECTANCE,
        "--circle", f"{WIDTH / 2},{WIDTH * 3 / 8},{RADIUS * scale}",
        "--grey-circle", circle, "--grey-albedo", ALBEDO, "--sun-diameter", 6, "--write", scene,
        "--report", tmp_path / "report.json")  # fmt: skip
    figures = json.loads((tmp_path / "report.json").read_text())
    source = figures["grey_ball"]["sources"][0]
    truth = np.array(box.sun_direction) @ rotation
    assert np.degrees(np.arccos(np.dot(source["direction"], truth))) < 0.5
    sun = 400.0 * np.pi * np.sin(np.radians(box.sun_radius)) ** 2
    assert np.allclose(source["irradiance"], sun, rtol=0.05)
    assert min(source["gain"]) > 20.0
    light = read_toml(scene)[1]["light"][0]
    assert light["type"] == "clipped"
    assert light["diameter"] == 6.0
    assert np.allclose(light["radiance"], 400.0, rtol=0.06)


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--circle", "30,150,60"), "cut off by the frame: it reaches 3"),
        (("--circle", "30,150"), "--circle is '30,150'"),
        (("--circle", "200,150,60", "--circle", "200,150,60"), "--circle is given 2 times"),
        (("--distance", 2.0), "give either --fov or --distance"),
        (("--write", "x.toml"), "--grey-circle"),
        (("--reflectance", "1.2"), "--reflectance is '1.2'"),
        (("--turn", 90), "--turn is given 1 times"),
        (("--scene", "x.toml"), "--ball-diameter"),
    ],
)
def test_wrong_options(shoot, tmp_path, arguments, words):
    with pytest.raises(InputError, match=words):
        run(shoot.first, "-o", tmp_path / "out.exr", "--fov", FOV, *arguments)


def test_a_photograph_that_shows_no_ball(place, tmp_path):
    with pytest.raises(InputError, match="no mirror ball was found"):
        run(write_rgb(tmp_path / "wall.exr", np.roll(place, 40, axis=1)), "-o", tmp_path / "out.exr", "--fov", 40)


def test_a_ball_that_the_frame_cuts_off(place, tmp_path):
    picture, _ = computed_photograph(Box(place, 1.5), FIRST, 240, 20.0, 0.1, aside=0.1)
    with pytest.raises(InputError, match="cut off by the frame"):
        run(write_rgb(tmp_path / "cut.exr", picture), "-o", tmp_path / "out.exr", "--fov", 20)


def test_photographs_that_differ_by_more_than_a_gain(shoot, place, tmp_path):
    picture, _ = computed_photograph(Box(np.flip(place, (0, 1)) ** 2.2, 1.5), SECOND, WIDTH, FOV, RADIUS)
    circles = [word for circle in shoot.circles for word in ("--circle", circle)]
    with pytest.raises(InputError, match="with any gain"):
        run(shoot.first, write_rgb(tmp_path / "b.exr", picture), "-o", tmp_path / "out.exr", "--fov", FOV, "--turn", 87,
            *circles)  # fmt: skip
