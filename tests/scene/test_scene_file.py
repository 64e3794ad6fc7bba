"""The scene file: what it says, what is taken for granted, and what is said when it is wrong."""

from pathlib import Path

import numpy as np
import pytest

from lightdepth.errors import InputError
from lightdepth.images.exr import ExrPart, write_exr
from lightdepth.scene import load_scene
from lightdepth.scene.materials import Glass, Metal, Principled
from lightdepth.scene.model import AnalyticShape, Gloss, RenderSettings, Role
from lightdepth.toml_file import read_document

FAULTS = Path(__file__).parents[1] / "faults"

WHOLE = """
[[real]]
name = "wall"
mesh = "floor.ply"
role = "environment"
position = [0, 5, 0]
rotation = [90, 0, 0]
scale = [1, 2, 1]

[[synthetic]]
name = "ball"
shape = "sphere"
center = [0.0, 2.0, 0.4]
radius = 0.4
material = { type = "principled", base_color = [0.8, 0.25, 0.2], metallic = 0.0, roughness = 0.4 }

[[synthetic]]
name = "plate"
mesh = "floor.ply"
scale = 0.1
position = [1, 2, 3]
material = { type = "metal", name = "Cu", roughness = 0.3 }

[[synthetic]]
name = "pane"
shape = "rectangle"
rotation = [90, 0, 0]
material = { type = "glass", ior = 1.33 }

[camera.pano]
type = "equirectangular"
width = 64

[camera.view]
type = "perspective"
width = 32
height = 16
position = [0, 0, 1.6]
look_at = [1, 0, 1.6]

[camera.tilted]
type = "fisheye"
width = 16
rotation = [90, 0, 0]

[render]
samples = 7
noise = 0.02
max_bounces = 3
seed = 5
clamp_indirect = 10.0
"""


def test_a_whole_file_becomes_plain_data(write_scene):
    path = write_scene(WHOLE, panorama="position = [0, 0, 1.5]\nrotation = [0, 0, 90]\nscale = 2.0")
    scene = load_scene(path)
    np.testing.assert_array_equal(scene.panorama.radiance, np.float32(1.0))
    np.testing.assert_allclose(scene.panorama.rotation @ [0, 1, 0], [-1, 0, 0], atol=1e-15)
    assert [surface.role for surface in scene.real] == [Role.SUPPORT, Role.ENVIRONMENT]
    wall = scene.real[1].mesh.vertices
    np.testing.assert_allclose([wall.min(0), wall.max(0)], [[-3, 5, -6], [3, 5, 6]], atol=1e-6)
    ball, plate, pane = scene.synthetic
    assert isinstance(ball.parts[0].geometry, AnalyticShape)
    np.testing.assert_allclose(
        ball.parts[0].geometry.to_world, [[0.4, 0, 0, 0], [0, 0.4, 0, 2], [0, 0, 0.4, 0.4], [0, 0, 0, 1]]
    )
    assert isinstance(ball.parts[0].material, Principled)
    np.testing.assert_allclose(plate.parts[0].geometry.vertices.mean(0), [1, 2, 3], atol=1e-6)
    assert isinstance(plate.parts[0].material, Metal)
    assert isinstance(pane.parts[0].material, Glass)
    assert scene.render == RenderSettings(samples=7, noise=0.02, max_bounces=3, seed=5, clamp_indirect=10.0)
    assert scene.path == path


def test_cameras_stand_at_the_capture_pose_unless_they_say_otherwise(write_scene):
    scene = load_scene(write_scene(WHOLE, panorama="position = [0, 0, 1.5]\nrotation = [0, 0, 90]"))
    pano, view, tilted = (scene.cameras[name] for name in ("pano", "view", "tilted"))
    np.testing.assert_allclose(pano.position, [0, 0, 1.5])
    np.testing.assert_allclose(pano.rotation, scene.panorama.rotation)
    np.testing.assert_allclose(view.rotation @ [0, 1, 0], [1, 0, 0], atol=1e-15)
    np.testing.assert_allclose(tilted.position, [0, 0, 1.5])
    np.testing.assert_allclose(tilted.rotation @ [0, 1, 0], [0, 0, 1], atol=1e-15)
    assert view.camera.resolution == (32, 16)


def test_without_cameras_there_is_the_panorama_itself(write_scene):
    scene = load_scene(write_scene(panorama="position = [1, 2, 3]"))
    assert list(scene.cameras) == ["pano"]
    assert scene.cameras["pano"].camera.resolution == (16, 8)
    np.testing.assert_allclose(scene.cameras["pano"].position, [1, 2, 3])


def test_gloss_is_read(write_scene):
    real = '[[real]]\nname = "f"\nmesh = "floor.ply"\nrole = "support"\ngloss = { roughness = 0.2 }\n'
    assert load_scene(write_scene(real=real)).real[0].gloss == Gloss(roughness=0.2, specular=0.5)


@pytest.mark.parametrize("kind", ["exr", "npy"])
def test_depth_may_replace_meshes(write_scene, scene_folder, kind):
    depth = np.full((4, 8), 2.0, np.float32)
    depth[0] = np.inf
    if kind == "exr":
        write_exr(scene_folder / "z.exr", [ExrPart({"Z": depth})])
    else:
        np.save(scene_folder / "z.npy", depth.astype(np.float64))
    scene = load_scene(write_scene(panorama=f'depth = "z.{kind}"', real=""))
    np.testing.assert_array_equal(scene.panorama.depth, depth)
    assert scene.panorama.depth.dtype == np.float32
    assert scene.real == ()


@pytest.mark.parametrize(
    ("depth", "message"),
    [
        (np.ones((4, 4)), "twice as wide as high"),
        (np.full((4, 8), np.nan), r"32 of 32 distances are not positive, the first, nan, in row 0, column 0"),
        (np.zeros((4, 8), "U1"), "numbers"),
    ],
)
def test_wrong_depth_is_refused(write_scene, scene_folder, depth, message):
    np.save(scene_folder / "z.npy", depth)
    with pytest.raises(InputError, match=message):
        load_scene(write_scene(panorama='depth = "z.npy"', real=""))


WRONG = [
    (
        '[[synthetic]]\nname = "a"\nshape = "sphere"\ncenter = [0, 0, 0]\nradius = 1\n'
        'material = { type = "principled", roughnes = 0.5 }',
        r'scene.toml:14: \[\[synthetic\]\] 1 \("a"\): material: unknown key \'roughnes\'; did you mean \'roughness\'\? '
        r"allowed: type, base_color,",
    ),
    (
        '[[synthetic]]\nname = "a"\nshape = "spere"\nmaterial = { type = "diffuse" }',
        r"shape: 'spere' is not known; did you mean 'sphere'\? allowed: sphere, cube, rectangle, disk, cylinder",
    ),
    (
        '[[synthetic]]\nname = "a"\nshape = "cube"\nmaterial = { type = "difuse" }',
        r"material: type: 'difuse' is not known; did you mean 'diffuse'\? allowed: principled, diffuse, metal, glass, ",
    ),
    (
        '[[synthetic]]\nname = "a"\nshape = "cube"\nmaterial = { type = "diffuse", color = [0.5, 1.5, 0] }',
        r"material: color: must be three numbers from 0 to 1 .*, found \[0.5, 1.5, 0\]",
    ),
    (
        '[[synthetic]]\nname = "a"\nshape = "cube"\nmaterial = { type = "emitter", radiance = -1 }',
        r"material: radiance: must be three numbers from 0 to 1e.15 .*, found -1",
    ),
    (
        '[[synthetic]]\nname = "a"\nshape = "cube"\nmaterial = { type = "metal", name = "Ga" }',
        r"material: name: 'Ga' is not known; .*allowed: Ag, Al, Au",
    ),
    (
        '[[synthetic]]\nname = "a"\nshape = "cube"\nmaterial = { type = "glass", ior = 0.5 }',
        r"material: ior: must be greater than 1, found 0.5",
    ),
    ('[[synthetic]]\nname = "a"\nshape = "cube"\nmesh = "floor.ply"', r"either mesh = 'file' or shape = 'sphere'"),
    (
        '[[synthetic]]\nname = "a"\nshape = "sphere"\nradius = 1\nmaterial = { type = "diffuse" }',
        r"the key 'center' is missing",
    ),
    ('[[synthetic]]\nname = "a"\nmesh = "flor.ply"', r"mesh: .*flor.ply: no such file"),
    ('[[synthetic]]\nname = "a"\nmesh = "floor.ply"\nscale = 0', r"scale: must be one number or three, none of them 0"),
    (
        '[[real]]\nname = "floor"\nmesh = "floor.ply"\nrole = "support"',
        r"scene.toml:10: \[\[real\]\] 2 \(\"floor\"\): name: 'floor' is the name of 2 \[\[real\]\] tables",
    ),
    (
        '[[real]]\nname = "b"\nmesh = "floor.ply"\nrole = "environment"\nopening = true\ngloss = { roughness = 0.2 }',
        r"gloss is not for an opening",
    ),
    (
        '[[real]]\nname = "b"\nmesh = "floor.ply"\nrole = "environment"\nremoved = true\nrest = "floor.ply"',
        r"gloss, opening and rest are not for a surface that is removed",
    ),
    (
        '[camera.view]\ntype = "perspectiv"\nwidth = 3',
        r"\[camera.view\]: type: 'perspectiv' is not known; did you mean",
    ),
    (
        '[camera.view]\ntype = "fisheye"\nwidth = 3\nmaping = "equisolid"',
        r"scene.toml:12: \[camera.view\]: unknown key 'maping'; did you mean 'mapping'\?",
    ),
    (
        '[camera.view]\ntype = "perspective"\nwidth = 3\nheight = 3\nlook_at = [0, 0, 0]',
        r"\[camera.view\]: look_at: the target \[0.0, 0.0, 0.0\] is the position itself",
    ),
    ("[render]\nsamples = 0", r"\[render\]: samples: must be greater than or equal to 1, found 0"),
    ("[render]\nseed = true", r"\[render\]: seed: must be a whole number, found True"),
    (
        "[camera.view]\ntype = 'fisheye'\nwidth = 3\nposition = [1, 2]",
        r"position: must be a list of 3 numbers, found \[1, 2\]",
    ),
    ("[render]\nnoise = 'x'", r"noise: must be a number, found 'x'"),
    ("[render.x]", r"unknown key 'x'; allowed: samples"),
    ("[camera]\nview = 3", r"\[camera.view\]: must be a table, found 3"),
    ("[rendr]\nsamples = 3", r"scene.toml: unknown key 'rendr'; did you mean 'render'\? allowed: panorama, real"),
]


@pytest.mark.parametrize(("text", "message"), WRONG)
def test_a_mistake_is_named_with_its_place_and_what_is_allowed(write_scene, text, message):
    with pytest.raises(InputError, match=message) as caught:
        load_scene(write_scene(text))
    assert len(str(caught.value).splitlines()) == 1


def test_a_file_of_a_later_format_is_refused(write_scene):
    path = write_scene("")
    plain = path.read_text()
    path.write_text(f"format = 1\n{plain}")
    load_scene(path)
    path.write_text(f"format = 2\n{plain}")
    with pytest.raises(InputError, match=r"scene.toml:1: format: must be at most 1, .* this version .* reads, found 2"):
        load_scene(path)


def test_all_mistakes_of_a_file_come_at_once(write_scene):
    text = "\n".join(text.replace('"a"', f'"a{i}"') for i, (text, _) in enumerate(WRONG[:9]))
    with pytest.raises(InputError) as caught:
        load_scene(write_scene(text, panorama="scal = 2"))
    assert len(str(caught.value).splitlines()) == 10


def test_all_broken_files_come_at_once(write_scene, scene_folder):
    (scene_folder / "a.ply").write_text("ply nonsense")
    (scene_folder / "b.stl").write_text("solid x\nendsolid x\n")
    write_exr(scene_folder / "p.exr", [ExrPart({c: np.full((8, 8), 0.5, np.float32) for c in "RGB"})])
    with pytest.raises(InputError) as caught:
        load_scene(write_scene('[[synthetic]]\nname = "a"\nmesh = "a.ply"\n[[synthetic]]\nname = "b"\nmesh = "b.stl"'))
    lines = str(caught.value).splitlines()
    assert len(lines) == 3
    assert "p.exr" in lines[0]
    assert "a.ply" in lines[1]
    assert "b.stl" in lines[2]


def test_syntax_errors_have_their_line(write_scene):
    with pytest.raises(InputError, match=r"scene.toml: not valid TOML: .*line 9"):
        load_scene(write_scene("[[synthetic]\n"))


def test_a_byte_order_mark_is_no_fault(write_scene):
    path = write_scene()
    path.write_bytes(b"\xef\xbb\xbf" + path.read_text().replace("\n", "\r\n").encode())
    assert [surface.name for surface in load_scene(path).real] == ["floor"]
    assert read_document(path)["panorama"]["image"] == "p.exr"


@pytest.mark.parametrize("read", [load_scene, read_document])
@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"a = " + b"[" * 5000 + b"]" * 5000, "tables and lists are nested more than 32 levels deep"),
        (b"a = 1" + b"0" * 5000, "not valid TOML: .* beyond 64 bits|not valid TOML: .* too many digits"),
        (b"a = 1\nb = '\xff'\n", "line 2: not UTF-8 text"),
    ],
)
def test_files_that_no_person_writes_are_refused_in_words(tmp_path, read, content, message):
    (tmp_path / "a.toml").write_bytes(content)
    with pytest.raises(InputError, match=message):
        read(tmp_path / "a.toml")


def test_a_panorama_in_place_of_a_scene_file_names_the_command_that_begins_one(tmp_path):
    (tmp_path / "room.hdr").write_bytes(b"#?RADIANCE\n\xff\xfe")
    with pytest.raises(InputError, match="a picture, and not a scene file.*lightdepth new room.hdr"):
        load_scene(tmp_path / "room.hdr")


@pytest.mark.parametrize(
    "content",
    [b"a = " + b"[" * 40 + b"]" * 40, b".".join([b"a"] * 2000) + b" = 1", b"a = " + str(2**63).encode(),
     (FAULTS / "x8-toml/deep.toml").read_bytes()],
)  # fmt: skip
def test_values_that_nothing_reads_are_refused(tmp_path, content):
    (tmp_path / "a.toml").write_bytes(content)
    with pytest.raises(InputError, match="more than 32 levels deep|beyond 64 bits"):
        load_scene(tmp_path / "a.toml")


def test_names_too_long_for_a_file_are_missing_files(write_scene):
    long = "n" * 300
    material = f'material = {{ type = "diffuse", color = "{long}.png" }}'
    text = f'[[synthetic]]\nname = "a"\nmesh = "{long}.ply"\n[[synthetic]]\nname = "b"\nshape = "cube"\n{material}\n'
    with pytest.raises(InputError) as caught:
        load_scene(write_scene(text))
    assert str(caught.value).count("no such file") == 2
    with pytest.raises(InputError, match=r"n\.toml: cannot be read \(File name too long\)"):
        load_scene(f"{long}.toml")


def test_long_values_are_shortened(write_scene):
    with pytest.raises(InputError) as caught:
        load_scene(write_scene(f"[render]\nsamples = '{'x' * 100000}'\n{'k' * 100000} = 1\n"))
    assert len(str(caught.value)) < 1000


def test_a_place_must_have_geometry(write_scene):
    with pytest.raises(InputError, match=r"no real geometry: give \[\[real\]\] meshes of the place, or the depth"):
        load_scene(write_scene(real=""))


def test_no_file_no_scene(tmp_path):
    with pytest.raises(InputError, match=r"none\.toml: no such file"):
        load_scene(tmp_path / "none.toml")


def test_bad_radiance_is_refused_and_repaired(write_scene, scene_folder):
    radiance = np.full((8, 16), 0.5, np.float32)
    radiance[3, 4] = np.nan
    write_exr(scene_folder / "p.exr", [ExrPart(dict.fromkeys("RGB", radiance))])
    with pytest.raises(InputError, match="NaN"):
        load_scene(write_scene())
    assert np.isfinite(load_scene(write_scene(), repair=True).panorama.radiance).all()
