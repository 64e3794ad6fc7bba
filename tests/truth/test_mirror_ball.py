"""A chrome ball in a path-traced room: the panorama from one and two photographs against the true one at its centre."""

import json

import numpy as np
import pytest
from bench.places.objects import Matte

from lightdepth.api import render
from lightdepth.cameras import Perspective
from lightdepth.directions import look_at_rotation, pixel_directions, rotation_to_euler
from lightdepth.images.beauty import read_beauty
from lightdepth.scene.model import CameraView, Panorama, RenderSettings, Scene
from tests.support import mirror_ball as support
from tests.support import textured_room as room
from tests.support.commands import run_command, write_rgb

pytestmark = pytest.mark.truth
WIDTH, FOV, PANORAMA = 560, 8.0, 256
"""The ball has a radius of 170 pixels."""


@pytest.fixture(scope="module")
def shoot(tmp_path_factory):
    """Two photographs, a scene file of the room, and the true panorama."""
    folder = tmp_path_factory.mktemp("ball")
    views = [support.camera(position, WIDTH, FOV) for position in (support.FIRST, support.SECOND)]
    for name, view, seed in zip("ab", views, (1, 2), strict=True):
        write_rgb(folder / f"{name}.exr", support.photograph(view, 64, seed=seed).mean)
    write_rgb(folder / "pano.exr", np.ones((8, 16, 3)))
    lines = [
        f'[panorama]\nimage = "pano.exr"\nposition = {support.CENTRE.tolist()}\n'
        f"rotation = {[float(angle) for angle in rotation_to_euler(views[0].rotation)]}\n"
    ]
    for surface in room.true_surfaces([]):
        vertices = "".join(f"v {x} {y} {z}\n" for x, y, z in surface.mesh.vertices)
        faces = "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in surface.mesh.faces)
        (folder / f"{surface.name}.obj").write_text(vertices + faces)
        lines.append(f'[[real]]\nname = "{surface.name}"\nmesh = "{surface.name}.obj"\nrole = "environment"\n')
    (folder / "room.toml").write_text("\n".join(lines))
    return folder, views, support.panorama(views[0].rotation, PANORAMA, 256).mean


@pytest.mark.parametrize("names", ["a", "ab"])
def test_panorama(shoot, names):
    folder, views, truth = shoot
    report = folder / f"{names}.json"
    photographs = [str(folder / f"{name}.exr") for name in names]
    arguments = ["capture", "mirror-ball", *photographs, "-o", str(folder / f"out-{names}.exr"), "--fov", str(FOV)]
    arguments += ["--reflectance", support.REFLECTANCE, "--width", str(PANORAMA), "--report", str(report)]
    arguments += ["--scene", str(folder / "room.toml"), "--ball-diameter", str(2 * support.RADIUS)]
    assert run_command(*arguments).exit_code == 0
    figures = json.loads(report.read_text())
    found = read_beauty(folder / f"out-{names}.exr").radiance
    # Directions: the axis and the distance give all of them.
    for each, view in zip(figures["photographs"], views, strict=False):
        distance = float(np.linalg.norm(support.CENTRE - view.position)) / support.RADIUS
        size = 1.0 / distance * each["focal_length_pixels"]
        print(each["circle"], each["distance_radii"], distance, size)
        off = abs(each["distance_radii"] / distance - 1.0)
        assert np.degrees(2.0 * off) < 0.3  # At 90 degrees from the camera.
    if len(names) > 1:
        turned = np.array(figures["photographs"][1]["rotation"]) @ (views[0].rotation.T @ views[1].rotation).T
        assert np.degrees(np.arccos(np.clip((np.trace(turned) - 1.0) / 2.0, -1.0, 1.0))) < 0.3
    angle = np.degrees(np.arccos(np.clip(-pixel_directions(*found.shape[:2])[..., 1], -1.0, 1.0)))
    error = np.abs(found / truth - 1.0)
    print(names, "median error", np.median(error[angle < 150.0]))
    assert np.median(error[angle < 150.0]) < 0.05
    lit = [lit_objects(light, views[0].rotation) for light in (found, truth)]
    print("objects", lit[0] / lit[1])
    assert np.allclose(lit[0], lit[1], rtol=0.03)


def lit_objects(radiance, rotation):
    """Mean radiance of a matte ball in the room where the mirror ball was, lit by a panorama, for each channel."""
    matte = support.sphere("ball", support.CENTRE, 0.15, Matte(color=(0.5, 0.5, 0.5)))
    position = support.FIRST
    camera = Perspective(type="perspective", width=48, height=48, fov=25.0)
    view = CameraView(camera, position, look_at_rotation(position, support.CENTRE))
    scene = Scene(
        panorama=Panorama(radiance.astype(np.float32), support.CENTRE, rotation),
        real=room.true_surfaces([]),
        synthetic=(matte,),
        cameras={"view": view},
        render=RenderSettings(samples=256),
    )
    frame = render(scene, "view")
    inside = frame.coverage > 0.99
    return frame.synthetic[inside].mean(axis=0)
