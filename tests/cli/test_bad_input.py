"""Every kind of bad input ends in one message and exit status 2, without a traceback, and nothing is written."""

import numpy as np
import pytest
import trimesh

import lightdepth
from lightdepth.errors import InputError

from .room_folder import edit, make_room, write_panorama


def missing_scene(scene):
    scene.unlink()


def not_toml(scene):
    scene.write_text("[panorama\n")


def missing_panorama(scene):
    (scene.parent / "room.exr").unlink()


def unreadable_panorama(scene):
    (scene.parent / "room.exr").write_bytes(b"this is no picture")


def cut_panorama(scene):
    file = scene.parent / "room.exr"
    file.write_bytes(file.read_bytes()[:400])


def wrong_aspect(scene):
    write_panorama(scene.parent / "room.exr", np.ones((16, 24), np.float32))


def _with_pixel(scene, value):
    radiance = np.full((16, 32), 0.5, np.float32)
    radiance[3, 5] = value
    write_panorama(scene.parent / "room.exr", radiance)


def nan_radiance(scene):
    _with_pixel(scene, np.nan)


def infinite_radiance(scene):
    _with_pixel(scene, np.inf)


def negative_radiance(scene):
    _with_pixel(scene, -3.0)


def unknown_key(scene):
    edit(scene, 'name = "ball"', 'name = "ball"\nradios = 0.3')


def value_out_of_range(scene):
    edit(scene, "radius = 0.3", "radius = -0.3")


def unknown_material(scene):
    edit(scene, '"diffuse"', '"difuse"')


def missing_mesh(scene):
    (scene.parent / "walls.ply").unlink()


def unreadable_mesh(scene):
    (scene.parent / "walls.ply").write_bytes(b"ply\nformat nonsense\n")


def empty_mesh(scene):
    (scene.parent / "walls.ply").write_text(
        "ply\nformat ascii 1.0\nelement vertex 0\nproperty float x\nproperty float y\nproperty float z\n"
        "element face 0\nproperty list uchar int vertex_indices\nend_header\n"
    )


def no_real_geometry(scene):
    text = scene.read_text()
    scene.write_text(text[: text.index("[[real]]")] + text[text.index("[[synthetic]]") :])


def capture_point_in_the_floor(scene):
    edit(scene, "position = [0.0, 0.0, 1.3]", "position = [0.0, 0.0, 0.0]")


def capture_point_outside(scene):
    edit(scene, "position = [0.0, 0.0, 1.3]", "position = [8.0, 0.0, 1.3]")


def object_outside(scene):
    edit(scene, "center = [0.5, 1.0, 0.3]", "center = [8.0, 1.0, 0.3]")


def hole(scene):
    walls = trimesh.load(scene.parent / "walls.ply")
    walls.update_faces(np.arange(len(walls.faces)) != 0)
    walls.export(scene.parent / "walls.ply")


def hidden_support(scene):
    (scene.parent / "under.ply").write_bytes((scene.parent / "floor.ply").read_bytes())
    with scene.open("a") as file:
        file.write('[[real]]\nname = "cellar"\nmesh = "under.ply"\nrole = "support"\nposition = [0, 0, -1]\n')


UNREADABLE = {
    missing_scene: "no such file",
    not_toml: "not valid TOML",
    missing_panorama: "no such file",
    unreadable_panorama: "not a readable OpenEXR file",
    cut_panorama: "room.exr",
    wrong_aspect: "24 x 16 pixels; a panorama must be twice as wide as high",
    nan_radiance: "1 pixel has NaN radiance",
    infinite_radiance: "1 pixel has infinite radiance",
    negative_radiance: "1 pixel has negative radiance",
    unknown_key: "did you mean 'radius'?",
    value_out_of_range: "radius",
    unknown_material: "did you mean 'diffuse'?",
    missing_mesh: "no such file",
    unreadable_mesh: "walls.ply",
    empty_mesh: "walls.ply",
    no_real_geometry: "no real geometry",
}
MEANINGLESS = {
    capture_point_in_the_floor: "from the surface of",
    capture_point_outside: "outside the room",
    hole: "% of all directions hit no real surface; the largest hole",
    object_outside: '"ball": is outside the room',
    hidden_support: '"cellar": the capture point cannot see 100 % of this support',
}
BAD = {**UNREADABLE, **MEANINGLESS}


def _files(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("spoil", BAD, ids=lambda spoil: spoil.__name__)
def test_check_tells(command, tmp_path, spoil):
    scene = make_room(tmp_path)
    spoil(scene)
    before = _files(tmp_path)
    status, output, errors = command("check", scene)
    assert status == 2
    assert BAD[spoil] in output
    assert output.count("error ") == (2 if spoil in (missing_mesh, unreadable_mesh, empty_mesh) else 1)  # and a hole
    assert "Traceback" not in output + errors
    assert _files(tmp_path) == before


@pytest.mark.parametrize("spoil", UNREADABLE, ids=lambda spoil: spoil.__name__)
def test_render_refuses(command, tmp_path, spoil):
    scene = make_room(tmp_path)
    spoil(scene)
    before = _files(tmp_path)
    status, output, errors = command("render", scene, "-o", tmp_path / "out" / "picture.exr", "--samples", "1")
    assert status == 2
    assert UNREADABLE[spoil] in errors
    assert "Traceback" not in output + errors
    assert _files(tmp_path) == before


@pytest.mark.parametrize("spoil", MEANINGLESS, ids=lambda spoil: spoil.__name__)
def test_python_refuses(tmp_path, spoil):
    scene = make_room(tmp_path)
    spoil(scene)
    loaded = lightdepth.load_scene(scene)
    with pytest.raises(InputError) as caught:
        lightdepth.render(loaded, samples=1)
    assert MEANINGLESS[spoil] in str(caught.value)


@pytest.mark.parametrize(
    ("target", "message"),
    [("picture.png", "the output is an .exr file"), ("scene.toml/picture.exr", "cannot be written")],
)
def test_render_refuses_an_output_that_cannot_be(command, tmp_path, target, message):
    scene = make_room(tmp_path)
    before = _files(tmp_path)
    status, _, errors = command("render", scene, "-o", tmp_path / target, "--samples", "1")
    assert status == 2
    assert message in errors
    assert _files(tmp_path) == before


def test_unknown_camera(command, tmp_path):
    status, _, errors = command("render", make_room(tmp_path), "--camera", "veiw", "-o", tmp_path / "out.exr")
    assert status == 2
    assert "veiw" in errors
    assert "view" in errors
    assert not (tmp_path / "out.exr").exists()
