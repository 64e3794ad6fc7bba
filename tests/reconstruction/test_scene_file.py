"""The scene file's [[real]] tables, with the rest as the person wrote it."""

import tomllib

import numpy as np
import pytest
import trimesh

from lightdepth.checks import inspect_file
from lightdepth.errors import InputError
from lightdepth.reconstruction.posed_panorama import parse_three, read_posed_panorama
from lightdepth.reconstruction.result import closed, save
from lightdepth.scene.load import load_scene
from lightdepth.scene.model import Mesh, RealSurface, Role

SCENE = """\
# My lounge.
[panorama]
image = "room.exr"   # shot in May
position = [0.1, -0.2, 1.5]

[[real]]
name = "floor"       # the old one
mesh = "old.ply"
role = "environment"
position = [0.0, 0.0, 1.0]

[render]
samples = 16  # quick
"""


def square(name, height, role):
    vertices = np.array([[-3, -3, height], [3, -3, height], [3, 3, height], [-3, 3, height]], np.float32)
    return RealSurface(name, Mesh(vertices, np.array([[0, 1, 2], [0, 2, 3]], np.int32)), role)


SURFACES = [square("floor", 0.0, Role.SUPPORT), square("ceiling", 2.5, Role.ENVIRONMENT)]


@pytest.fixture
def scene(tmp_path, panorama):
    (tmp_path / "room.exr").write_bytes(panorama.read_bytes())
    path = tmp_path / "scene.toml"
    path.write_text(SCENE, encoding="utf-8")
    return path


def test_tables_are_put_in_and_the_rest_is_kept(scene):
    source = read_posed_panorama(scene)
    save(closed(SURFACES, source, False), source, scene.parent / "meshes", scene, None)
    text = scene.read_text(encoding="utf-8")
    for kept in ("# My lounge.\n", "# shot in May\n", "# the old one\n", "samples = 16  # quick\n"):
        assert kept in text
    loaded = load_scene(scene)
    assert [(s.name, s.role) for s in loaded.real] == [
        ("floor", Role.SUPPORT), ("ceiling", Role.ENVIRONMENT), ("shell", Role.ENVIRONMENT)
    ]  # fmt: skip
    np.testing.assert_allclose(loaded.real[0].mesh.vertices[:, 2], 0.0)  # Its old placement is gone.
    assert trimesh.load(scene.parent / "meshes/ceiling.ply").area == pytest.approx(36.0)


def test_lines_end_as_the_files_own_do(scene):
    scene.write_bytes(SCENE.replace("\n", "\r\n").encode())
    source = read_posed_panorama(scene)
    save(closed(SURFACES, source, False), source, scene.parent / "meshes", scene, None)
    content = scene.read_bytes()
    assert b"ceiling.ply" in content
    assert content.count(b"\n") == content.count(b"\r\n")


def test_a_second_run_changes_nothing(scene):
    source = read_posed_panorama(scene)
    result = closed(SURFACES, source, False)
    save(result, source, scene.parent / "meshes", scene, None)
    first = scene.read_bytes()
    save(result, source, scene.parent / "meshes", scene, None)
    assert scene.read_bytes() == first


def test_a_scene_file_is_begun(tmp_path, panorama):
    source = read_posed_panorama(panorama, (0.1, -0.2, 1.5), (2.0, -3.0, 25.0))
    save(closed(SURFACES, source, False), source, tmp_path / "meshes", tmp_path / "new.toml", tmp_path / "check.png")
    loaded = load_scene(tmp_path / "new.toml")
    np.testing.assert_allclose(loaded.panorama.position, source.pose.position)
    np.testing.assert_allclose(loaded.panorama.rotation, source.pose.rotation)
    assert (tmp_path / "check.png").stat().st_size > 1000


@pytest.mark.parametrize("kept", [SCENE, "render.samples = 3\n"])
def test_sky_is_declared(scene, kept):
    source = read_posed_panorama(scene)
    scene.write_text(kept, encoding="utf-8")
    for _ in range(2):
        save(closed(SURFACES[:1], source, True), source, scene.parent / "meshes", scene, None)
        assert scene.read_text(encoding="utf-8").count("sky = true") == 1
        assert tomllib.loads(scene.read_text(encoding="utf-8"))["panorama"]["sky"] is True
    if kept == SCENE:
        assert inspect_file(scene).problems == ()


def test_nothing_is_written_where_the_scene_file_is_wrong(scene):
    source = read_posed_panorama(scene)
    scene.write_text("real = 3\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"'real' must be an array of tables"):
        save(closed(SURFACES, source, False), source, scene.parent / "meshes", scene, scene.parent / "check.png")
    assert not (scene.parent / "meshes").exists()
    assert not (scene.parent / "check.png").exists()


def test_wrong_places_are_explained(scene, tmp_path):
    with pytest.raises(InputError, match="give a scene file, or --position"):
        read_posed_panorama(None)
    with pytest.raises(InputError, match="write three numbers"):
        parse_three("1,2", "--position")
    scene.write_text('[panorama]\nimage = "none.exr"\n', encoding="utf-8")
    with pytest.raises(InputError, match=r"scene.toml:2: \[panorama\].*none.exr"):
        read_posed_panorama(scene)
    with pytest.raises(InputError, match="no such file"):
        read_posed_panorama(tmp_path / "missing.toml")
