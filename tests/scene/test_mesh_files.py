"""PLY, OBJ and STL: geometry, rest positions, materials, and files that are broken."""

import numpy as np
import pytest
import trimesh
from PIL import Image

from lightdepth.errors import InputError
from lightdepth.scene import load_scene
from lightdepth.scene.materials import Principled, Texture, VertexColors
from lightdepth.scene.meshes import read_mesh_file
from lightdepth.scene.meshes.geometry import placement, transformed
from lightdepth.scene.model import Mesh

CORNERS = np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0], [0, 1, 0]], np.float32)
HEADER = "ply\nformat {format} 1.0\nelement vertex 4\n{properties}element face {faces}\n{lists}end_header\n"


def write_ply(path, columns, faces=((0, 1, 2), (0, 2, 3)), binary=False):
    """A PLY of four vertices with any properties."""
    kinds = {name: "uchar" if np.asarray(v).dtype == np.uint8 else "float" for name, v in columns.items()}
    header = HEADER.format(
        format="binary_little_endian" if binary else "ascii",
        properties="".join(f"property {kinds[name]} {name}\n" for name in columns),
        faces=len(faces),
        lists="property list uchar int vertex_indices\n",
    )
    if binary:
        rows = np.zeros(4, [(n, "u1" if kinds[n] == "uchar" else "<f4") for n in columns])
        for name, values in columns.items():
            rows[name] = values
        body = rows.tobytes() + b"".join(b"\x03" + np.array(face, "<i4").tobytes() for face in faces)
        path.write_bytes(header.encode() + body)
    else:
        lines = [" ".join(str(v) for v in row) for row in zip(*columns.values(), strict=True)]
        lines += [" ".join(map(str, [len(face), *face])) for face in faces]
        path.write_text(header + "\n".join(lines) + "\n")
    return path


def positions(vertices=CORNERS):
    return dict(zip("xyz", np.asarray(vertices, np.float32).T, strict=True))


@pytest.mark.parametrize("binary", [False, True])
def test_ply_has_positions_normals_texture_coordinates_and_rest(tmp_path, binary):
    rest = CORNERS + np.float32([0, 0, 5])
    columns = {
        **positions(),
        "nx": np.zeros(4), "ny": np.zeros(4), "nz": np.ones(4),
        "s": [0.0, 1.0, 1.0, 0.0], "t": [0.0, 0.0, 1.0, 1.0],
        "rest_x": rest[:, 0], "rest_y": rest[:, 1], "rest_z": rest[:, 2],
    }  # fmt: skip
    (part,) = read_mesh_file(write_ply(tmp_path / "a.ply", columns, binary=binary), with_materials=True)
    np.testing.assert_array_equal(part.mesh.vertices, CORNERS)
    np.testing.assert_array_equal(part.mesh.normals, [[0, 0, 1]] * 4)
    np.testing.assert_array_equal(part.mesh.texture_coordinates, [[0, 0], [1, 0], [1, 1], [0, 1]])
    np.testing.assert_array_equal(part.mesh.rest, rest)
    assert part.material is None


def test_ply_colours_are_a_material(tmp_path):
    columns = {**positions(), **{c: np.full(4, v, np.uint8) for c, v in (("red", 255), ("green", 188), ("blue", 0))}}
    (part,) = read_mesh_file(write_ply(tmp_path / "a.ply", columns), with_materials=True)
    np.testing.assert_allclose(part.mesh.colors, [[1.0, 0.5029, 0.0]] * 4, atol=1e-3)
    assert part.material == Principled(base_color=VertexColors())


def test_quads_become_triangles(tmp_path):
    (part,) = read_mesh_file(write_ply(tmp_path / "a.ply", positions(), [(0, 1, 2, 3)]), with_materials=False)
    assert part.mesh.faces.shape == (2, 3)


def test_stl_corners_are_joined(tmp_path):
    for kind in ("stl", "stl_ascii"):
        trimesh.creation.box((1, 2, 3)).export(tmp_path / "a.stl", file_type=kind)
        (part,) = read_mesh_file(tmp_path / "a.stl", with_materials=True)
        assert part.mesh.vertices.shape == (8, 3)
        np.testing.assert_allclose(np.ptp(part.mesh.vertices, axis=0), [1, 2, 3])


OBJ = """mtllib a.mtl
v 0 0 0
v 2 0 0
v 2 1 0
v 0 1 0
vt 0 0
vt 1 0
vt 1 1
vt 0 1
usemtl one
f 1/1 2/2 3/3
usemtl two
f 1/1 3/3 4/4
"""
MTL = """newmtl one
Kd 0.1 0.2 0.3
Ks 0.25 0.25 0.25
Ns 198
d 0.5
newmtl two
map_Kd picture.png
Pr 0.7
Pm 0.9
Ke 2 0 0
"""


def test_obj_materials_are_carried_roughly(tmp_path):
    Image.fromarray(np.full((2, 2, 3), 255, np.uint8)).save(tmp_path / "picture.png")
    (tmp_path / "a.obj").write_text(OBJ)
    (tmp_path / "a.mtl").write_text(MTL)
    one, two = sorted(
        (p.material for p in read_mesh_file(tmp_path / "a.obj", with_materials=True)), key=lambda m: m.metallic
    )
    assert one.base_color == pytest.approx((0.1, 0.2, 0.3))
    assert one.roughness == pytest.approx(0.01**0.25)  # alpha^2 = 2 / (Ns + 2), roughness = sqrt(alpha)
    assert one.opacity == 0.5
    assert one.specular == 0.25
    assert isinstance(two.base_color, Texture)
    assert (two.roughness, two.metallic, two.emission) == (0.7, 0.9, (2.0, 0.0, 0.0))


def test_obj_without_its_materials_is_refused_only_if_they_matter(tmp_path):
    (tmp_path / "a.obj").write_text(OBJ)
    with pytest.raises(InputError, match=r"its material file .*a.mtl does not exist"):
        read_mesh_file(tmp_path / "a.obj", with_materials=True)
    assert sum(len(p.mesh.faces) for p in read_mesh_file(tmp_path / "a.obj", with_materials=False)) == 2


def test_flat_triangles_are_left_out(tmp_path):
    path = write_ply(tmp_path / "a.ply", positions(), [(0, 1, 2), (0, 1, 1)])
    assert len(read_mesh_file(path, with_materials=False)[0].mesh.faces) == 1
    assert len(read_mesh_file(path, with_materials=False, keep_flat=True)[0].mesh.faces) == 2


@pytest.mark.parametrize(
    ("columns", "faces", "message"),
    [
        (positions([[0, 0, 0], [np.nan, 0, 0], [1, 1, 0], [0, 1, 0]]), ((0, 1, 2),),
         "vertices: 1 of 4 are not finite, the first is vertex 1"),
        (positions(), ((0, 1, 9),), r"face 0 refers to vertices \[0, 1, 9\], but there are 4"),
        (positions(), ((0, 1, 1),), r"all 1 triangles are degenerate"),
        (positions(), (), r"the mesh has no triangles"),
        ({**positions(), "rest_x": [0, 0, 0, np.inf], "rest_y": np.zeros(4), "rest_z": np.zeros(4)}, ((0, 1, 2),),
         r"rest: 1 of 4 are not finite"),
    ],
)  # fmt: skip
def test_broken_meshes_say_what_is_wrong(tmp_path, columns, faces, message):
    with pytest.raises(InputError, match=message):
        read_mesh_file(write_ply(tmp_path / "a.ply", columns, faces), with_materials=False)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.fbx", b"", r"'.fbx' is not a mesh format; allowed are .ply, .obj, .stl, .gltf, .glb"),
        ("a.ply", b"nonsense", "not a PLY file"),
        ("a.obj", b"# nothing", "no triangles"),
        ("a.stl", b"", "no triangles"),
        ("a.glb", b"nonsense", "not a readable glTF file"),
        ("a.gltf", b"{", "not a readable glTF file"),
    ],
)
def test_unreadable_files_are_refused(tmp_path, name, content, message):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError, match=message):
        read_mesh_file(tmp_path / name, with_materials=True)


def test_placement_scales_then_turns_then_moves():
    mesh = transformed(Mesh(CORNERS, np.array([[0, 1, 2]], np.int32)), placement((1, 2, 3), (0, 0, 90), (2, 1, 1)))
    np.testing.assert_allclose(mesh.vertices, [[1, 2, 3], [1, 6, 3], [0, 6, 3], [0, 2, 3]], atol=1e-6)


@pytest.mark.parametrize("scale", [(1.0, 1.0, 3.0), (1.0, -1.0, 2.0), (-2.0, -1.0, 1.0)])
def test_normals_and_outside_survive_uneven_and_mirroring_scales(scale):
    sphere = trimesh.creation.icosphere(3)
    mesh = Mesh(sphere.vertices.astype(np.float32), sphere.faces.astype(np.int32), sphere.vertices.astype(np.float32))
    moved = transformed(mesh, placement((1, 1, 1), (10, 20, 30), scale))
    corners = moved.vertices[moved.faces].astype(float)
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    assert (np.sum(outward * (corners.mean(1) - 1), axis=1) > 0).all()
    shading = moved.normals[moved.faces].mean(1)
    assert np.sum(outward * shading, axis=1).min() > 0.95


def test_rest_positions_move_with_the_mesh(write_scene, scene_folder):
    write_ply(scene_folder / "flat.ply", positions())
    bulge = CORNERS.copy()
    bulge[2, 2] = 1.0
    write_ply(scene_folder / "bulge.ply", positions(bulge))
    real = '[[real]]\nname = "f"\nmesh = "bulge.ply"\nrest = "flat.ply"\nrole = "support"\nposition = [0, 0, 1]\n'
    mesh = load_scene(write_scene(real=real)).real[0].mesh
    np.testing.assert_allclose(mesh.vertices[2], [2, 1, 2])
    np.testing.assert_allclose(mesh.rest, CORNERS + np.float32([0, 0, 1]))


def test_rest_needs_the_same_topology(write_scene, scene_folder):
    trimesh.creation.box().export(scene_folder / "box.ply")
    real = '[[real]]\nname = "f"\nmesh = "floor.ply"\nrest = "box.ply"\nrole = "support"\n'
    with pytest.raises(InputError, match=r"the rest mesh has 8 vertices, but floor.ply has 4"):
        load_scene(write_scene(real=real))


def test_parts_of_a_real_file_become_one_mesh(write_scene, scene_folder):
    trimesh.Scene([trimesh.creation.box(), trimesh.creation.box().apply_translation([3, 0, 0])]).export(
        scene_folder / "two.glb"
    )
    real = '[[real]]\nname = "f"\nmesh = "two.glb"\nrole = "environment"\n'
    mesh = load_scene(write_scene(real=real)).real[0].mesh
    np.testing.assert_allclose([mesh.vertices.min(0), mesh.vertices.max(0)], [[-0.5] * 3, [3.5, 0.5, 0.5]])
    assert mesh.faces.max() < len(mesh.vertices)


def test_an_image_needs_texture_coordinates(write_scene, scene_folder):
    Image.fromarray(np.zeros((2, 2, 3), np.uint8)).save(scene_folder / "a.png")
    with pytest.raises(
        InputError, match=r'\[\[synthetic\]\] 1 \("a"\): the material has an image, but the mesh has no tex'
    ):
        load_scene(
            write_scene('[[synthetic]]\nname = "a"\nmesh = "floor.ply"\nmaterial = {type="diffuse", color="a.png"}\n')
        )
