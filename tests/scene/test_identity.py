"""What a scene's digest depends on: what the files hold, not where they lie or when they were written."""

import os
from dataclasses import replace

import numpy as np
import pytest
from PIL import Image

from lightdepth.scene.identity import place_digest, scene_digest
from lightdepth.scene.load import load_scene

SCENE = """
[panorama]
image = "room.png"
position = [0, 0, 1.5]

[[real]]
name = "floor"
mesh = "floor.obj"
role = "support"

[[synthetic]]
name = "ball"
shape = "sphere"
center = [0, 1, 1]
radius = 0.2
material = {{ {material} }}

[camera.view]
type = "equirectangular"
width = 8
"""
MATERIALS = {
    "texture": 'type = "principled", base_color = "paint.png"',
    "bitmap of Mitsuba": 'mitsuba = { type = "diffuse", reflectance = { type = "bitmap", filename = "paint.png" } }',
}


def folder(parent, name, material, colour=128, time=1):
    """A scene folder; the panorama has clipped pixels, of which a note names the file."""
    path = parent / name
    path.mkdir()
    image = np.full((8, 16, 3), 100, np.uint8)
    image[1, 3:5] = 255
    Image.fromarray(image).save(path / "room.png")
    (path / "floor.obj").write_text("v -2 -2 0\nv 2 -2 0\nv 2 2 0\nv -2 2 0\nf 1 2 3 4\n")
    Image.fromarray(np.full((4, 4, 3), colour, np.uint8)).save(path / "paint.png")
    (path / "scene.toml").write_text(SCENE.format(material=material))
    for file in path.iterdir():
        os.utime(file, (time, time))
    return path / "scene.toml"


@pytest.mark.parametrize("material", MATERIALS.values(), ids=MATERIALS)
def test_a_copy_elsewhere_with_other_times_is_the_same_scene(tmp_path, material):
    here, there = (load_scene(folder(tmp_path, name, material, time=time)) for name, time in (("a", 10), ("b", 2000)))
    assert scene_digest(here) == scene_digest(there)
    assert place_digest(here) == place_digest(there)
    other = load_scene(folder(tmp_path, "c", material, colour=127, time=10))
    assert scene_digest(other) != scene_digest(here)
    assert place_digest(other) == place_digest(here)


def test_a_file_written_again_within_a_process_is_noticed(tmp_path):
    file = folder(tmp_path, "a", MATERIALS["bitmap of Mitsuba"])
    before = scene_digest(load_scene(file))
    Image.fromarray(np.full((4, 4, 3), 5, np.uint8)).save(file.parent / "paint.png")
    assert scene_digest(load_scene(file)) != before


def test_a_note_on_the_panorama_changes_no_digest(tmp_path):
    scene = load_scene(folder(tmp_path, "a", MATERIALS["texture"]))
    other = replace(scene, panorama=replace(scene.panorama, notes=("/elsewhere/room.png: is clipped",)))
    assert place_digest(other) == place_digest(scene)
    assert scene_digest(other) == scene_digest(scene)
