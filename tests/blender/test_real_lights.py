"""Light of the real place that the photograph lacks: lamps marked real, and clipped sources, to the scene file and back."""

import tomllib

import numpy as np
import pytest

from lightdepth.images.radiance import write_radiance
from lightdepth.scene.lights.frame import sun_direction
from lightdepth.scene.load import load_scene

HAND = """# the flat, by hand
[panorama]
image = "panorama.exr"  # twice as wide
position = [0.0, 0.0, 1.6]

[[light]]
type = "sun"
name = "window sun"
azimuth = 120.0
elevation = 35.0
irradiance = [120.0, 90.0, 60.0]
mask = "mask.exr"
mask_extent = [-1.0, -0.5, 1.0, 1.5]

[[light]]
type = "sun"
name = "door sun"
azimuth = 100.0
elevation = 30.0
irradiance = [10.0, 8.0, 6.0]
mask = "recover"

[[light]]
type = "clipped"
name = "lamp"
pixel = [20.5, 4.5]
radiance = [40.0, 35.0, 30.0]

# the floor is oak
[[real]]
name = "floor"
mesh = "lights_meshes/Floor.ply"
role = "support"
"""


@pytest.fixture(scope="module")
def found(blender, tmp_path_factory):
    folder = tmp_path_factory.mktemp("lights")
    write_radiance(folder / "mask.exr", np.full((2, 2, 3), 0.5, np.float32))
    (folder / "hand.toml").write_text(HAND)
    (folder / "inline.toml").write_text('light = [{ type = "clipped", pixel = [1, 1], radiance = [1, 1, 1] }]\n')
    return folder, blender.run("real_lights", folder)


def test_a_sun_marked_real_is_a_light_of_the_place_and_no_object(found):
    folder, said = found
    scene = load_scene(folder / "lights.toml")
    (sun,) = scene.lights
    assert sun.name == "Low sun"
    np.testing.assert_allclose(sun.direction, said["toward"], atol=1e-6)
    np.testing.assert_allclose(sun.irradiance, [200.0, 150.0, 100.0], rtol=1e-5)
    assert sun.diameter == pytest.approx(0.6, abs=1e-5)
    np.testing.assert_allclose(sun.mask_extent, [-1.0, -0.5, 1.0, 1.5], atol=1e-6)
    assert not scene.synthetic
    assert {surface.name for surface in scene.real if surface.opening} == {"Pane"}
    assert any("'Strip': only suns and point lamps can be marked real" in note for note in said["notes"])


def test_point_lamps_marked_real_are_clipped_sources_and_light_the_map(found):
    folder, _ = found
    tables = tomllib.loads((folder / "lights.toml").read_text())["light"]
    clipped = [table for table in tables if table["type"] == "clipped"]
    assert [table["name"] for table in clipped] == ["Ceiling lamp"]
    assert clipped[0]["diameter"] == pytest.approx(12.0, abs=1e-4)
    np.testing.assert_allclose(clipped[0]["pixel"], [20.5, 4.5], atol=0.002)
    panorama = load_scene(folder / "lights.toml").panorama
    np.testing.assert_allclose(panorama.light_radiance[4, 20], [40.0, 35.0, 30.0], rtol=1e-5)


def test_a_mask_stays_with_its_direction(found):
    folder, said = found
    (sun,) = load_scene(folder / "turned.toml").lights
    assert sun.mask is None
    assert any("no longer fits" in note for note in said["turned"])


def test_lights_of_a_scene_file_become_lamps(found):
    folder, said = found
    sun, door = (said["imported"][name] for name in ("window sun", "door sun"))
    np.testing.assert_allclose(sun["toward"], sun_direction(120.0, 35.0), atol=1e-6)
    np.testing.assert_allclose(sun["irradiance"], [120.0, 90.0, 60.0], rtol=1e-6)
    assert sun["diameter"] == pytest.approx(0.53, abs=1e-5)
    assert sun["real"]
    assert sun["mask"] == str(folder / "mask.exr")
    assert (sun["recover"], door["recover"], door["mask"]) == (False, True, "")
    lamp = said["clipped"]
    np.testing.assert_allclose(np.multiply(lamp["uv"], lamp["size"]), [20.5, 4.5], atol=1e-3)
    np.testing.assert_allclose(lamp["radiance"], [40.0, 35.0, 30.0], rtol=1e-5)
    assert lamp["real"]
    assert lamp["before"] == pytest.approx(0.98, abs=1e-4)
    assert said["again"] == ["POINT", "SUN", "SUN"]


def test_edited_lights_go_back_and_the_rest_of_the_file_stays(found):
    folder, _ = found
    text = (folder / "hand.toml").read_text()
    before, rest = HAND.split("[[light]]")[0], HAND[HAND.index("[[real]]") :]
    assert text.startswith(before)
    assert text.endswith("\n# the floor is oak\n" + rest)
    sun, door = (table for table in tomllib.loads(text)["light"] if table["type"] == "sun")
    assert (door["name"], door["mask"], "mask_extent" in door) == ("door sun", "recover", False)
    np.testing.assert_allclose(door["irradiance"], [10.0, 8.0, 6.0], rtol=1e-5)
    np.testing.assert_allclose(sun["irradiance"], [240.0, 180.0, 120.0], rtol=1e-5)
    np.testing.assert_allclose(sun["direction"], sun_direction(120.0, 35.0), atol=1e-6)
    np.testing.assert_allclose(sun["mask_extent"], [-1.0, -0.5, 1.0, 1.5], atol=1e-6)
    (lamp,) = (table for table in tomllib.loads(text)["light"] if table["type"] == "clipped")
    assert (lamp["name"], lamp["pixel"]) == ("lamp", [20.5, 4.5])
    np.testing.assert_allclose(lamp["radiance"], [60.0, 52.5, 45.0], rtol=1e-5)


def test_what_cannot_be_is_refused_in_words(found):
    _, said = found
    missing, mesh, inline, no_sun = said["refused"]
    assert "missing.toml cannot be read" in missing
    assert "is not a scene file" in mesh
    assert "cannot be replaced" in inline
    assert "no direction of the sky explains" in no_sun or "the sun reaches nothing" in no_sun
    assert said["said"]
