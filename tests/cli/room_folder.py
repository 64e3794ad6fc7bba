"""A scene file with everything that it names, for commands to read."""

import numpy as np
import trimesh

from lightdepth.images.exr import ExrPart, write_exr

SCENE = """
[panorama]
image = "room.exr"
position = [0.0, 0.0, 1.3]

[[real]]
name = "floor"
mesh = "floor.ply"
role = "support"

[[real]]
name = "walls"
mesh = "walls.ply"
role = "environment"

[[synthetic]]
name = "ball"
shape = "sphere"
center = [0.5, 1.0, 0.3]
radius = 0.3
material = { type = "diffuse", color = [0.5, 0.5, 0.5] }

[camera.view]
type = "perspective"
width = 16
height = 9
"""


def make_room(folder):
    """Write a good scene into a folder; the file `scene.toml` is returned."""
    radiance = np.full((16, 32), 0.5, np.float32)
    radiance[4, 7] = 20.0
    write_panorama(folder / "room.exr", radiance)
    box = trimesh.creation.box(bounds=[[-2, -3, 0], [2, 3, 2.5]])
    box.invert()
    on_floor = np.all(box.triangles_center[:, 2:] < 0.1, axis=1)
    for name, faces in (("floor", on_floor), ("walls", ~on_floor)):
        trimesh.Trimesh(box.vertices, box.faces[faces]).export(folder / f"{name}.ply")
    (folder / "scene.toml").write_text(SCENE)
    return folder / "scene.toml"


def write_panorama(path, radiance):
    write_exr(path, [ExrPart(dict.fromkeys("RGB", radiance))])


def edit(scene, old, new):
    """Replace a piece of a scene file."""
    text = scene.read_text()
    assert old in text
    scene.write_text(text.replace(old, new, 1))
