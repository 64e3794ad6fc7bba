"""What is exported is what the renderer loads."""

import math
import tomllib

import numpy as np
import pytest
from pydantic import TypeAdapter

from lightdepth.cameras import CameraSettings
from lightdepth.scene.load import load_scene

NAME = 'Würfel "A"'


@pytest.fixture(scope="module")
def exported(blender, tmp_path_factory):
    folder = tmp_path_factory.mktemp("export")
    return folder, blender.run("export", folder)


def test_the_renderer_loads_the_scene(exported):
    folder, _ = exported
    scene = load_scene(folder / "scene.toml")
    roles = {surface.name: str(surface.role) for surface in scene.real}
    assert roles == {"Walls": "environment", "Floor": "support"}
    floor, walls = (next(surface for surface in scene.real if surface.name == name) for name in ("Floor", "Walls"))
    assert floor.gloss.roughness == pytest.approx(0.2)
    assert walls.mesh.rest[:, 2].max() == pytest.approx(2.5)
    assert walls.mesh.vertices[:, 2].max() == pytest.approx(2.75)
    assert scene.render.samples == 3
    assert math.degrees(math.atan2(scene.panorama.rotation[1, 0], scene.panorama.rotation[0, 0])) == pytest.approx(
        math.degrees(0.5), abs=1e-4
    )
    camera = scene.cameras["Camera"].camera
    assert (camera.width, camera.height) == (64, 48)
    assert camera.aperture == pytest.approx(0.01)
    assert camera.focus_distance == pytest.approx(2.0)
    names = {thing.name for thing in scene.synthetic}
    copies = {"Ball copy 0", "Ball copy 1", "Ball copy 2"}
    assert {NAME, "Twin", "Tile", "Neon", "Plank", "Sheared", "Slanted", "Words", "Piece", "Panel"} | copies <= names
    assert not names & {"Hidden", "Holder", "Words 1", "Floor grid"}


def test_objects_stand_where_they_stand_in_blender(exported):
    folder, found = exported
    things = {thing.name: thing for thing in load_scene(folder / "scene.toml").synthetic}
    for name, (low, high) in found["bounds"].items():
        vertices = np.concatenate([part.geometry.vertices for part in things[name].parts])
        assert vertices.min(axis=0) == pytest.approx(low, abs=1e-5), name
        assert vertices.max(axis=0) == pytest.approx(high, abs=1e-5), name


def test_modifiers_are_applied_as_for_rendering_and_instances_kept(exported):
    folder, _ = exported
    tables = {table["name"]: table for table in tomllib.loads((folder / "scene.toml").read_text())["synthetic"]}
    balls = {tables[name]["mesh"] for name in ("Sphere", "Ball copy 0", "Ball copy 1", "Ball copy 2", "Piece")}
    assert len(balls) == 1
    assert tables["Piece"]["scale"] == pytest.approx([0.5] * 3)
    things = {thing.name: thing for thing in load_scene(folder / "scene.toml").synthetic}
    assert sum(len(part.geometry.faces) for part in things[NAME].parts) == 6 * 4**2 * 2


def test_instances_stand_in_the_file_once(exported):
    folder, _ = exported
    tables = {table["name"]: table for table in tomllib.loads((folder / "scene.toml").read_text())["synthetic"]}
    things = {thing.name: thing for thing in load_scene(folder / "scene.toml").synthetic}
    for name in ("Left", "Right"):
        (part,) = things[name].parts
        assert tables[name]["instances"].endswith(".npy")
        assert sorted(part.places[:, 0, 3]) == pytest.approx([0.02 * index - 0.4 for index in range(40)], abs=1e-6)
        assert (np.linalg.det(part.places[:, :3, :3]) > 0.0).all()
        placed = part.places[0, :3, :3] @ part.geometry.vertices.T
        assert np.ptp(placed, axis=1) == pytest.approx([0.02] * 3, rel=1e-4)
    # They share a mesh, and not their materials.
    assert things["Left"].parts[0].material.transmission == pytest.approx(1.0)
    assert things["Right"].parts[0].material.base_color == pytest.approx((0.8, 0.1, 0.05), abs=1e-3)


def test_materials_arrive_and_what_cannot_is_named(exported):
    folder, found = exported
    things = {thing.name: thing for thing in load_scene(folder / "scene.toml").synthetic}
    plastic = things[NAME].parts[0].material
    assert plastic.base_color == pytest.approx((0.8, 0.1, 0.05), abs=1e-3)
    assert plastic.roughness == pytest.approx(0.25)
    glass = things["Sphere"].parts[0].material
    assert glass.transmission == pytest.approx(1.0)
    assert glass.ior == pytest.approx(1.4)
    glow = things["Neon"].parts[0].material
    assert np.array(glow.emission) * glow.emission_strength == pytest.approx([3.0, 1.5, 0.75], rel=1e-3)
    assert np.asarray(things["Tile"].parts[0].material.base_color.pixels)[..., :3].reshape(-1, 3)[0] == pytest.approx(
        [0.0, 1.0, 0.0], abs=1e-2
    )
    notes = found["notes"]
    assert any("'Wood'" in note and "Noise Texture" in note for note in notes)
    assert any("Flat camera" in note for note in notes)
    assert any("'Panel'" in note and "shadows" in note for note in notes)
    assert any("'Panel'" in note and "specular" in note for note in notes)
    assert not any("Plastic" in note or "Textured" in note or "Glass" in note for note in notes)


def test_a_material_override_is_worn_by_every_new_object(exported):
    folder, _ = exported
    things = {thing.name: thing for thing in load_scene(folder / "override.toml").synthetic}
    for name in ("Sphere", "Neon", "Tile"):
        assert things[name].parts[0].material.base_color == pytest.approx((0.8, 0.1, 0.05), abs=1e-3)


def test_colours_of_another_working_space_are_the_same_colours(exported):
    folder, found = exported
    if not found["working space"]:
        pytest.skip("before Blender 5.0 there is only linear Rec.709")
    first, second = (
        {thing.name: thing.parts[0].material for thing in load_scene(folder / f"{name}.toml").synthetic}
        for name in ("scene", "acescg")
    )
    assert second[NAME].base_color == pytest.approx(first[NAME].base_color, abs=1e-3)
    glow = [np.array(things["Neon"].emission) * things["Neon"].emission_strength for things in (first, second)]
    assert glow[1] == pytest.approx(glow[0], rel=2e-3)
    lamp = [np.array(things["Panel"].emission) * things["Panel"].emission_strength for things in (first, second)]
    assert lamp[1] == pytest.approx(lamp[0], rel=2e-3)


def test_exporting_leaves_the_file_as_it_was(exported):
    _, found = exported
    assert found["left as it was"] == [True] * 4
    assert "There is no panorama" in found["no panorama"]
    assert "orthographic" in found["orthographic"]


def test_cameras_of_a_scene_file_come_back_as_they_were(exported):
    folder, found = exported
    given, again = (load_scene(folder / f"{name}.toml").cameras for name in ("given", "again"))
    assert found["resolution"] == [96, 64, "lens"]
    for name in ("lens", "looking", "cube", "youtube"):
        before, after = given[name], again[name]
        assert after.camera.type == before.camera.type
        assert after.resolution == before.resolution
        np.testing.assert_allclose(after.position, before.position, atol=2e-6, err_msg=name)
        np.testing.assert_allclose(after.rotation, before.rotation, atol=2e-6, err_msg=name)
    before, after = given["lens"].camera, again["lens"].camera
    assert after.distortion == pytest.approx((-0.08, 0.012), rel=1e-6)
    assert after.centre == pytest.approx((0.47, 0.56), abs=1e-6)
    points = np.random.default_rng(0).uniform((-1, 2, -0.6), (1, 3, 0.6), (50, 3))
    np.testing.assert_allclose(after.film_of(points)[0], before.film_of(points)[0], atol=1e-6)
    assert again["looking"].camera.aperture == pytest.approx(0.01, rel=1e-5)
    assert "a camera of type 'dome_master' has no counterpart in Blender" in found["said"]


def test_every_projection_that_blender_lacks_is_a_camera_of_the_renderer(exported):
    found = exported[1]
    assert found["offered"]
    for each in found["projections"]:
        table = {"type": each["kind"], "width": 12 * each["across"]}
        camera = TypeAdapter(CameraSettings).validate_python(table)
        assert camera.resolution == (12 * each["across"], 12 * each["down"])
        assert getattr(camera, "layout", None) == (each["layout"] or getattr(camera, "layout", None))
        assert hasattr(camera, "interocular_distance") == each["two_eyes"]


def test_a_panorama_type_that_is_not_rendered_is_named(exported):
    assert "the panorama type Mirror Ball is not rendered" in exported[1]["mirror ball"]
