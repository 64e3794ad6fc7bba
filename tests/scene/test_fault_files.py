"""Files of real users, each of a kind that was read wrongly once: geometry, materials, and what is said about them."""

import shutil
import warnings
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lightdepth.checks import Severity, inspect_file
from lightdepth.errors import InputError, InputWarning
from lightdepth.scene import load_scene
from lightdepth.scene.materials import Principled, Texture, VertexColors
from lightdepth.scene.materials.texture import decoded_srgb
from lightdepth.scene.meshes import read_mesh_file
from lightdepth.scene.meshes.geometry import face_areas

FAULTS = Path(__file__).parents[1] / "faults"


def read(name, folder=FAULTS):
    """Parts and notes of a file."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", InputWarning)
        parts = read_mesh_file(folder / name, with_materials=True)
    return parts, [str(warning.message) for warning in caught]


def area(parts):
    return sum(face_areas(part.mesh.vertices, part.mesh.faces).sum() for part in parts)


def bounds(parts):
    vertices = np.concatenate([part.mesh.vertices for part in parts])
    return vertices.min(axis=0).tolist(), vertices.max(axis=0).tolist()


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("x1-quads/quads.obj", 24.0),
        ("x1-quads/quads_uv.obj", 24.0),
        ("x1-quads/two_materials.obj", 24.0),
        ("x1-quads/one_quad_floor.obj", 5.2 * 6.2),
        ("x9-blender-exports/cube.obj", 24.0),
        ("x9-blender-exports/cube.glb", 24.0),
        ("04-concave/lshape.obj", 3.0 + 0.5),
        ("04-concave/notch.obj", 8.0 + 0.5),
        ("10-sparse/grid_like_sample.gltf", 12.0),
        ("x2-obj/tabs.obj", 24.0),
        ("20-relative/blocks.obj", 1.0),
        ("22-utm/utm.obj", 6 * 0.6**2),
        ("x7-stl/tail.stl", 1.0),
        ("16-skin/joint_scale.gltf", 24.0),
        ("16-skin/node_scale100.gltf", 24.0),
        ("17-instancing/used.gltf", 3 * 24.0),
        ("32-camera/same_node_beside.gltf", 2 * 24.0),
        ("x3-gltf/deep1500.gltf", 24.0),
    ],
)
def test_areas_are_those_of_the_file(name, expected):
    assert area(read(name)[0]) == pytest.approx(expected, rel=2e-5)


def polygons_of(path):
    """The polygons of a small binary PLY whose vertices are floats and whose faces are lists after one byte."""
    head, body = path.read_bytes().split(b"end_header\n", 1)
    words = head.split()
    vertices, faces = (int(words[words.index(name) + 1]) for name in (b"vertex", b"face"))
    width = head.split(b"element face")[0].count(b"property")
    points = np.frombuffer(body, "<f4", vertices * width).reshape(-1, width)[:, :3].astype(float)
    offset, found = 4 * width * vertices, []
    for _ in range(faces):
        found.append(points[np.frombuffer(body, "<i4", body[offset], offset + 1)])
        offset += 1 + 4 * body[offset]
    return found


@pytest.mark.parametrize(
    ("name", "about"),
    [("quad_tri_little.ply", 1.5), ("quad_tri_pentagon_3364.ply", 0.021), ("../x9-blender-exports/sphere.ply", 11.9)],
)
def test_polygons_of_binary_ply_may_differ_in_size(name, about):
    polygons = polygons_of(FAULTS / "08-mixed" / name)
    assert len({len(polygon) for polygon in polygons}) > 1
    parts, _ = read(f"08-mixed/{name}")
    # Flat polygons have the length of their vector area as area, however they are cut.
    expected = sum(np.linalg.norm(np.cross(p - p[0], np.roll(p, -1, 0) - p[0]).sum(0)) / 2 for p in polygons)
    assert area(parts) == pytest.approx(expected, rel=2e-5)
    assert expected == pytest.approx(about, rel=0.05)
    assert sum(len(part.mesh.faces) for part in parts) == sum(len(polygon) - 2 for polygon in polygons)


def test_openings_in_walls_stay_open(shared_data):
    parts, _ = read("public/wallhole.obj", shared_data / "faults")
    assert area(parts) == pytest.approx(721.42, abs=0.005)


def test_a_slit_leads_to_a_hole(tmp_path):
    """A wall of 4 by 4 with an opening of 2 by 2, drawn as one polygon that runs to the opening and back."""
    outer, inner = [(0, 0), (4, 0), (4, 4), (0, 4)], [(1, 1), (1, 3), (3, 3), (3, 1)]
    lines = [f"v {x} 0 {z}" for x, z in [*outer, *inner]]
    (tmp_path / "a.obj").write_text("\n".join([*lines, "f 1 2 3 4 1 \\", "  5 6 7 8 5"]))
    parts, notes = read("a.obj", tmp_path)
    assert area(parts) == pytest.approx(12.0)
    centres = parts[0].mesh.vertices[parts[0].mesh.faces].mean(axis=1)
    assert not ((centres[:, [0, 2]] > 1.0) & (centres[:, [0, 2]] < 3.0)).all(axis=1).any()
    assert notes == []


@pytest.mark.parametrize("turned", range(4))
def test_quads_with_a_dent_are_cut_at_the_dent(tmp_path, turned):
    corners = np.roll([[0, 0], [4, 0], [1, 1], [0, 4]], turned, axis=0)
    (tmp_path / "a.obj").write_text("".join(f"v {x} {y} 0\n" for x, y in corners) + "f 1 2 3 4\n")
    (part,), _ = read("a.obj", tmp_path)
    assert area([part]) == pytest.approx(4.0)
    a, b, c = (part.mesh.vertices[part.mesh.faces[:, i]] for i in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()  # All face as the polygon does.


def test_crossing_polygons_are_named(tmp_path):
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 1 0\nv 1 0 0\nv 0 2 0\nv 2 3 0\n\nf 1 2 3 4 5\n")
    _, notes = read("a.obj", tmp_path)
    assert len(notes) == 1
    assert "1 faces cross themselves, the first is on line 7" in notes[0]


def test_far_coordinates_are_placed_before_they_are_rounded(write_scene, scene_folder):
    shutil.copy(FAULTS / "22-utm/utm.obj", scene_folder)
    text = '[[synthetic]]\nname = "a"\nmesh = "utm.obj"\n'
    scene = load_scene(write_scene(text + "position = [-500000, -5600000, -100]\n"))
    vertices = scene.synthetic[0].parts[0].geometry.vertices
    assert vertices.dtype == np.float32
    np.testing.assert_allclose([vertices.min(0), vertices.max(0)], [[-0.3] * 3, [0.3] * 3], atol=1e-3)
    with pytest.raises(InputError, match=r"utm.obj: it reaches 5.6e\+06 m from the world's origin, .* steps of 0.5 m"):
        load_scene(write_scene(text))


def test_relative_indices_mean_the_vertices_before_them():
    assert bounds(read("20-relative/blocks.obj")[0]) == ([0, 0, 0], [6, 1, 0])


def test_a_binary_stl_with_a_tail_is_read():
    parts, notes = read("x7-stl/tail.stl")
    assert len(parts[0].mesh.faces) == 2
    assert "5 bytes behind its 2 triangles are left out" in notes[0]


# Materials of OBJ


@pytest.fixture
def textures(tmp_path):
    """The texture files, with the images that they name."""
    folder = shutil.copytree(FAULTS / "12-texture", tmp_path / "textures")
    (folder / "textures").mkdir()
    for name in ("tex.png", "textures/sub.png"):
        Image.fromarray(np.full((2, 2, 3), 255, np.uint8)).save(folder / name)
    return folder


@pytest.mark.parametrize("name", ["plain", "backslash", "options", "case"])
def test_textures_are_found_and_multiplied_by_kd(textures, name):
    parts, notes = read(f"{name}.obj", textures)
    assert notes == []
    pixels = parts[0].material.base_color.pixels.astype(float)
    image = textures / {"backslash": "textures/sub.png", "case": "Upper.PNG"}.get(name, "tex.png")
    codes = np.asarray(Image.open(image).convert("RGB"))
    np.testing.assert_allclose(pixels, 0.8 * decoded_srgb(codes / 255), rtol=2e-3)


def test_a_missing_texture_is_named():
    parts, notes = read("12-texture/missing.obj")
    assert parts[0].material.base_color == (0.8, 0.8, 0.8)
    assert "missing.mtl: line 3: map_Kd: the image 'gone.png' does not exist" in notes[0]


def test_texture_coordinates_without_a_material_leave_the_default_one(textures):
    parts, notes = read("no_usemtl_tex.obj", textures)
    assert [part.material for part in parts] == [None]
    assert "faces before any 'usemtl'" in notes[0]


@pytest.mark.parametrize(
    ("name", "colours"),
    [
        ("12-texture/comment_mtllib.obj", [(0.8, 0.1, 0.1)]),
        ("12-texture/two_mtllib_lines.obj", [(0.8, 0.1, 0.1), (0.1, 0.8, 0.1)]),
        ("x1-quads/two_materials.obj", [(0.8, 0.1, 0.1), (0.1, 0.8, 0.1)]),
        ("31-names/mat_cp1252.obj", [(0.8, 0.1, 0.1)]),
        ("01-tr/tr1.obj", [(0.8, 0.1, 0.1)]),
    ],
)
def test_materials_are_found(name, colours):
    parts, _ = read(name)
    assert [part.material.base_color for part in parts] == colours
    assert all(part.material.opacity == 1.0 for part in parts)


def test_tr_1_is_opaque_with_a_hint(shared_data):
    for name, folder in (("01-tr/tr1.obj", FAULTS), ("public/fuze.obj", shared_data / "faults")):
        parts, notes = read(name, folder)
        assert [part.material.opacity for part in parts] == [1.0]
        assert any("'Tr 1' of material" in note for note in notes)


def test_check_lists_what_was_taken_otherwise(write_scene, scene_folder):
    for name in ("tr1.obj", "tr1.mtl"):
        shutil.copy(FAULTS / "01-tr" / name, scene_folder)
    twice = '[[synthetic]]\nname = "a"\nmesh = "tr1.obj"\n[[synthetic]]\nname = "b"\nmesh = "tr1.obj"\n'
    problems = inspect_file(write_scene(twice)).problems
    found = [problem.severity for problem in problems if "'Tr 1' of material 'm'" in problem.message]
    assert found == [Severity.WARNING]


@pytest.mark.parametrize(
    ("statements", "opacity"),
    [("Tr 1", 1.0), ("Tr 0.25", 0.75), ("Tr 0", 1.0), ("d 0.5\nTr 1", 0.5), ("d 0.5\nTr 0.5", 0.5), ("d 1\nTr 1", 1.0),
     ("d 0\nTr 0", 1.0), ("d -halo 0.5", 0.5), ("d 0", 0.0)],
)  # fmt: skip
def test_opacity_is_d_before_tr(tmp_path, statements, opacity):
    (tmp_path / "a.mtl").write_text(f"newmtl m\n{statements}\n")
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (part,), notes = read("a.obj", tmp_path)
    assert part.material.opacity == pytest.approx(opacity)
    assert any("invisible" in note for note in notes) == (statements in ("Tr 1", "d 0"))


@pytest.mark.parametrize(
    "statement", ["Kd 2 0 0", "Ks -1", "Ke -1 0 0", "d 1.5", "d -halo 0.5", "Tr -0.1", "Pm 3", "Pr 2", "Pc 2"]
)
def test_what_is_cut_is_named(tmp_path, statement):
    (tmp_path / "a.mtl").write_text(f"newmtl m\n{statement}\n")
    (tmp_path / "a.obj").write_text("mtllib a.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    _, notes = read("a.obj", tmp_path)
    assert len(notes) == 1
    assert "a.mtl: line 2" in notes[0]
    assert statement.split()[0] in notes[0] or "-halo" in notes[0]


def test_16_bit_grey_textures_are_not_white(textures):
    shutil.copy(FAULTS / "x6-textures/grey16.png", textures / "tex.png")
    parts, notes = read("plain.obj", textures)
    codes = np.asarray(Image.open(FAULTS / "x6-textures/grey16.png")).astype(float)
    pixels = parts[0].material.base_color.pixels.astype(float)
    expected = 0.8 * np.repeat(decoded_srgb(codes / 65535)[:, :, None], 3, axis=2)
    np.testing.assert_allclose(pixels, expected, atol=0.01)
    assert expected.max() < 0.7
    assert notes == []


def test_map_options_lay_the_image(textures):
    (textures / "options.mtl").write_text(
        "newmtl m\nmap_Kd -s 2 3 1 -o 0.1 0.2 0 -clamp on -mm 0.1 0.5 -boost 2 my tex.png\n"
    )
    shutil.copy(textures / "tex.png", textures / "my tex.png")
    parts, notes = read("options.obj", textures)
    texture = parts[0].material.base_color
    uv = np.array([0.3, 0.4])
    u, v_down, _ = texture.to_uv @ [uv[0], 1 - uv[1], 1]
    np.testing.assert_allclose([u, 1 - v_down], [2 * 0.3 + 0.1, 3 * 0.4 + 0.2])
    assert texture.wrap == "clamp"
    np.testing.assert_allclose(texture.pixels, 0.8 * (0.1 + 0.5), atol=1e-3)
    assert len(notes) == 1
    assert "option -boost of map_Kd is left out" in notes[0]


def test_statements_without_a_counterpart_are_named(textures):
    (textures / "a.mtl").write_text("newmtl m\nKd .5 .5 .5\nKa 1 1 1\nTf 0.5 1 1\nmap_Ks x.png\nPs 0\nillum 7\n")
    _, notes = read("comment_mtllib.obj", textures)
    assert [word for word in ("Tf", "map_Ks", "Ps", "Ka", "illum 7") if any(word in n for n in notes)] == [
        "Tf", "map_Ks", "illum 7",
    ]  # fmt: skip


@pytest.mark.parametrize("key", ["norm", "map_Bump -bm 1.0"])
def test_normal_maps_are_used_and_bumps_named(textures, key):
    Image.fromarray(np.full((4, 4, 3), [128, 128, 255], np.uint8)).save(textures / "normals.png")
    (textures / "plain.mtl").write_text(f"newmtl m\nKd .5 .5 .5\n{key} normals.png\n")
    parts, notes = read("plain.obj", textures)
    np.testing.assert_allclose(parts[0].material.normal_map.pixels[0, 0], [0.5, 0.5, 1.0], atol=4e-3)
    assert notes == []
    (textures / "plain.mtl").write_text("newmtl m\nKd .5 .5 .5\nmap_Bump tex.png\n")
    parts, notes = read("plain.obj", textures)
    assert parts[0].material.normal_map is None
    assert "only maps of normals are used" in notes[0]


def test_smoothing_groups_are_smooth(tmp_path):
    roof = "v 0 0 0\nv 1 0 1\nv 2 0 0\nv 0 1 0\nv 1 1 1\nv 2 1 0\n"
    (tmp_path / "a.obj").write_text(roof + "s 1\nf 1 2 5 4\nf 2 3 6 5\n")
    (part,), _ = read("a.obj", tmp_path)
    ridge = part.mesh.normals[part.mesh.vertices[:, 0] == 1]
    np.testing.assert_allclose(np.abs(ridge), [[0, 0, 1]] * 2, atol=1e-6)
    (tmp_path / "a.obj").write_text(roof + "s off\nf 1 2 5 4\nf 2 3 6 5\n")
    assert read("a.obj", tmp_path)[0][0].mesh.normals is None


def test_names_in_other_encodings_are_found(tmp_path):
    (tmp_path / "瓶.mtl").write_text("newmtl 玻璃\nKd 0.1 0.2 0.3\n", encoding="gb18030")
    obj = "mtllib 瓶.mtl\nusemtl 玻璃\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"
    for encoding in ("gb18030", "utf-16"):
        (tmp_path / "a.obj").write_text(obj, encoding=encoding)
        if encoding == "utf-16":
            (tmp_path / "瓶.mtl").write_text("newmtl 玻璃\nKd 0.1 0.2 0.3\n", encoding="utf-16")
        assert read("a.obj", tmp_path)[0][0].material.base_color == (0.1, 0.2, 0.3)


# Colours


@pytest.mark.parametrize(
    ("name", "codes"),
    [("18-colour/float.ply", [0.8, 0.1, 0.1]), ("18-colour/ushort_wrap.ply", np.array([40000, 7000, 7000]) / 65535)],
)
def test_colours_are_scaled_by_their_type(name, codes):
    (part,), notes = read(name)
    np.testing.assert_allclose(part.mesh.colors, np.tile(decoded_srgb(np.array(codes)), (3, 1)), rtol=1e-5)
    assert part.material == Principled(base_color=VertexColors())
    assert notes == []


def test_colours_of_obj_vertices_are_used():
    (part,), notes = read("19-vcolor/float.obj")
    np.testing.assert_allclose(part.mesh.colors[:2], [[1, 0, 0], [0, 1, 0]])
    np.testing.assert_allclose(part.mesh.colors[6], decoded_srgb(np.full(3, 0.5)), rtol=1e-6)
    assert part.material == Principled(base_color=VertexColors())
    assert notes == []


def test_texture_coordinates_of_faces_are_used(tmp_path):
    (part,), notes = read("18-colour/wedge.ply")
    np.testing.assert_array_equal(part.mesh.texture_coordinates[part.mesh.faces[0]], [[0, 0], [1, 0], [0, 1]])
    assert isinstance(part.material.base_color, Texture)
    assert notes == []
    shutil.copy(FAULTS / "18-colour/wedge.ply", tmp_path)
    (part,), notes = read("wedge.ply", tmp_path)
    assert part.material is None
    assert "its texture 'tex.png' does not exist" in notes[0]


# glTF


def test_sparse_accessors_replace_elements():
    low, high = bounds(read("10-sparse/over.gltf")[0])
    np.testing.assert_allclose(high[1] - low[1], 4.0)  # z of glTF, from -1 to 3
    low, high = bounds(read("10-sparse/grid_like_sample.gltf")[0])
    np.testing.assert_allclose([low, high], [[0, 0, 0], [6, 0, 4]])


@pytest.mark.parametrize("name", ["joint_scale", "node_scale100"])
def test_joints_alone_place_skinned_meshes(name):
    np.testing.assert_allclose(bounds(read(f"16-skin/{name}.gltf")[0]), [[-1] * 3, [1] * 3], atol=1e-6)


def test_every_instance_is_there():
    np.testing.assert_allclose(bounds(read("17-instancing/used.gltf")[0]), [[-1, -1, -1], [11, 1, 1]], atol=1e-6)


def test_meshes_on_cameras_are_there():
    np.testing.assert_allclose(bounds(read("32-camera/same_node_beside.gltf")[0]), [[-6, -1, -1], [6, 1, 1]])


def test_hidden_nodes_are_hidden():
    np.testing.assert_allclose(bounds(read("11-required/visibility_required.gltf")[0]), [[2, -1, -1], [4, 1, 1]])


def test_long_chains_of_nodes_are_followed():
    np.testing.assert_allclose(bounds(read("x3-gltf/deep1500.gltf")[0]), [[0.5, -1, -1], [2.5, 1, 1]], atol=1e-6)


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("11-required/ACME_hologram.gltf", "needs the extension ACME_hologram, which lightdepth does not support"),
        ("11-required/meshopt_data.gltf", "buffer view 0: its data compressed with meshopt is damaged"),
        ("x5-short/COLOR_0.gltf", "primitives\\[0\\]: COLOR_0 has 2 elements, but POSITION has 24"),
    ],
)
def test_what_cannot_be_shown_is_refused_by_name(name, message):
    with pytest.raises(InputError, match=message):
        read(name)


@pytest.mark.parametrize("name", ["30-default/no_material.gltf", "x9-blender-exports/cube.glb"])
def test_without_material_it_is_the_default_one(name):
    parts, notes = read(name)
    assert [part.material for part in parts] == [Principled()]
    assert notes == []


def test_unlit_materials_are_dielectrics_of_their_colour():
    (part,), notes = read("30-default/unlit.gltf")
    assert (part.material.base_color, part.material.metallic, part.material.roughness) == ((0.8, 0.1, 0.1), 0.0, 0.5)
    assert "unlit" in notes[0]


def test_specular_glossiness_is_a_dielectric_of_the_diffuse_colour():
    (part,), notes = read("09-specgloss/factor.gltf")
    assert (part.material.base_color, part.material.metallic) == ((0.8, 0.1, 0.1), 0.0)
    assert part.material.roughness == pytest.approx(0.7)
    assert part.material.ior == pytest.approx(1.5)  # reflects 4 %
    assert notes == []
    (part,), notes = read("09-specgloss/required.gltf")
    assert (part.material.base_color, part.material.metallic) == ((0.8, 0.1, 0.1), 0.0)
    assert "does not say its specular colour" in notes[0]


def test_an_image_is_read_for_what_it_is():
    """A texture of KHR_texture_basisu whose image is a PNG."""
    (part,), _ = read("21-texture/KHR_texture_basisu_no_fallback.gltf")
    assert isinstance(part.material.base_color, Texture)
