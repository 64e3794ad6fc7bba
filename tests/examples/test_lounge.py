"""The example's room is closed and its objects stand on the floor; its meshes are what their scripts make."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest
import trimesh

from lightdepth.checks import Severity, inspect_scene
from lightdepth.scene.load import load_scene

LOUNGE = Path(__file__).parents[2] / "examples/lounge"


@pytest.fixture(scope="module")
def scene():
    return load_scene(LOUNGE / "scene.toml")


def script(name):
    specification = importlib.util.spec_from_file_location(name, LOUNGE / f"{name}.py")
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def test_room_is_closed_and_everything_stands_right(scene):
    inspection = inspect_scene(scene)
    assert inspection.coverage.share == 1.0
    assert [p.message for p in inspection.problems if p.severity is not Severity.HINT] == []
    assert not any("[[synthetic]]" in p.message for p in inspection.problems)


def test_panorama_holds_the_full_range_of_light(scene):
    radiance = scene.panorama.radiance
    assert radiance.shape == (512, 1024, 3)
    assert radiance.max() > 30_000
    assert np.median(radiance) < 1


def test_one_object_is_textured(scene):
    vase = next(thing for thing in scene.synthetic if thing.name == "vase")
    assert len(vase.parts) == 3
    assert all(part.geometry.vertices[:, 2].min() > -1e-6 for part in vase.parts)
    materials = [part.material for part in vase.parts]
    assert any(material.normal_map is not None for material in materials)


def test_files_are_small():
    for path in LOUNGE.rglob("*"):
        assert path.stat().st_size < 2 * 2**20, path


def test_room_is_what_its_script_makes():
    for name, build in script("model_room").THINGS.items():
        made = trimesh.util.concatenate(build())
        kept = trimesh.load(LOUNGE / "room" / f"{name}.ply", process=False)
        np.testing.assert_allclose(kept.vertices, made.vertices, atol=1e-6)
        np.testing.assert_array_equal(kept.faces, made.faces)
