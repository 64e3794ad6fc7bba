"""Numbers that no place has: each is refused by its key, before single precision makes infinity of it."""

import copy
from collections.abc import Iterator

import numpy as np
import pytest
import tomlkit

from lightdepth.errors import InputError
from lightdepth.images.exr import ExrPart, write_exr
from lightdepth.scene import load_scene
from lightdepth.scene.materials import Principled, Texture

POSE = {"position": [0.0, 0.0, 0.0], "rotation": [0.0, 0.0, 0.0]}
EMISSION = {"emission": [1.0, 2.0, 3.0], "emission_strength": 2.0}
DOCUMENT = {
    "panorama": {"image": "p.exr", "scale": 1.0, "gain": [1.0] * 3, "position": [0.0, 0.0, 1.5], "rotation": [0.0] * 3},
    "real": [{"name": "floor", "mesh": "floor.ply", "role": "support", **POSE, "scale": [1.0, 1.0, 1.0]}],
    "synthetic": [
        {"name": "ball", "shape": "sphere", "center": [0.3, 0.8, 0.4], "radius": 0.2,
         "material": {"type": "principled", "ior": 1.4, **EMISSION}},
        {"name": "cube", "shape": "cube", **POSE, "scale": 0.2, "material": {"type": "emitter", "radiance": [1.0] * 3}},
        {"name": "plate", "mesh": "floor.ply", **POSE, "scale": [0.1] * 3, "material": {"type": "glass", "ior": 1.5}},
        {"name": "coat", "mesh": "floor.ply", "at_angles": [0.0, -60.0], "scale": 0.1,
         "material": {"mitsuba": {"type": "roughplastic", "alpha": 0.1, "diffuse_reflectance": [0.1, 0.2, 0.3]}}},
    ],
    "light": [
        {"type": "sun", "name": "a", "azimuth": 30.0, "elevation": 40.0, "irradiance": [1.0] * 3, "diameter": 0.53},
        {"type": "sun", "name": "b", "direction": [0.3, 0.2, 1.0], "irradiance": [1.0] * 3},
        {"type": "clipped", "pixel": [3.0, 4.0], "radiance": [9.0] * 3, "diameter": 3.0},
    ],
    "camera": {
        "view": {"type": "perspective", "width": 16, "height": 9, "fov": 60.0, "position": [0.0, -0.5, 1.2],
                 "look_at": [0.0, 1.0, 0.5], "aperture": 0.01, "focus_distance": 1.0, "shift": [0.1, 0.1],
                 "distortion": [0.01, 0.001]},
        "eyes": {"type": "ods", "width": 16, **POSE, "interocular_distance": 0.06, "convergence_distance": 2.0},
    },
    "render": {"samples": 1, "irradiance_samples": 16, "clamp_indirect": 10.0, "max_bounces": 3, "seed": 1},
}  # fmt: skip
"""Every key that is a number with a unit."""


def numbers(table, path=()) -> Iterator[tuple]:
    """Where numbers are in a document, of lists the first."""
    if isinstance(table, dict):
        for key, value in table.items():
            yield from numbers(value, (*path, key))
    elif isinstance(table, list):
        for index, value in enumerate(table):
            if index == 0 or isinstance(value, dict):
                yield from numbers(value, (*path, index))
    elif isinstance(table, int | float):
        yield path


@pytest.mark.parametrize("value", [1e308, -1e39])
def test_every_number_is_refused_by_its_key(scene_folder, value):
    places = list(numbers(DOCUMENT))
    assert len(places) > 50
    for path in places:
        document = copy.deepcopy(DOCUMENT)
        table = document
        for key in path[:-1]:
            table = table[key]
        table[path[-1]] = value
        file = scene_folder / "scene.toml"
        file.write_text(tomlkit.dumps(document))
        with pytest.raises(InputError) as caught:
            load_scene(file)
        key = next(key for key in reversed(path) if isinstance(key, str))
        lines = [line for line in str(caught.value).splitlines() if key in line]
        assert lines, f"{path}: {caught.value}"
        assert "Unable" not in lines[0]


def test_the_document_is_right_otherwise(scene_folder):
    file = scene_folder / "scene.toml"
    file.write_text(tomlkit.dumps(DOCUMENT))
    assert len(load_scene(file).synthetic) == 4


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"emission_strength": 1e14, "emission": [20.0, 0.0, 0.0]},
            "emission_strength 1e.14 times emission, up to 20, is",
        ),
        ({"emission_strength": 1e-300, "emission": [1e15] * 3}, None),
    ],
)
def test_it_is_the_product_of_emission_and_strength_that_counts(change, message):
    if message is None:
        assert Principled(**change).plugins()
    else:
        with pytest.raises(ValueError, match=message):
            Principled(**change)
        texture = Texture(np.full((2, 2, 3), change["emission"][0], np.float32))
        with pytest.raises(ValueError, match=message):
            Principled(**{**change, "emission": texture})


def test_a_suns_radiance_counts_and_a_panoramas(scene_folder, write_scene):
    sun = '[[light]]\ntype = "sun"\nazimuth = 0\nelevation = 40\nirradiance = [1e9, 1e9, 1e9]\ndiameter = 0.001\n'
    with pytest.raises(InputError, match="irradiance 1e.09 from a diameter of 0.001 degrees is a radiance of 4.18e.18"):
        load_scene(write_scene(sun))
    radiance = np.full((8, 16), 0.5, np.float32)
    radiance[3, 4] = 3e20
    write_exr(scene_folder / "p.exr", [ExrPart(dict.fromkeys("RGB", radiance))])
    with pytest.raises(InputError, match="scale = 1: the radiance of p.exr becomes 3e.20; allowed are up to 1e.15"):
        load_scene(write_scene())
    assert load_scene(write_scene(panorama="scale = 1e-10")).panorama.radiance.max() == np.float32(3e10)


def test_a_mesh_that_is_scaled_flat_is_refused(write_scene):
    plate = '[[synthetic]]\nname = "plate"\nmesh = "floor.ply"\nscale = [1e12, 0.1, 0.1]\nrotation = [0, 0, 10]\n'
    with pytest.raises(InputError, match="no triangle of it has an area where it stands; mind its scale"):
        load_scene(write_scene(plate))
