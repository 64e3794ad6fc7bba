"""Layouts that PLY, OBJ, STL and glTF allow beyond what most files use, and how damage is described."""

import json
import warnings

import numpy as np
import pytest
from PIL import Image

from lightdepth.errors import InputError, InputWarning
from lightdepth.scene.materials import Principled, VertexColors
from lightdepth.scene.meshes import read_mesh_file
from lightdepth.scene.meshes.geometry import face_areas, placed, placement
from lightdepth.scene.meshes.gltf_file import GltfFile
from tests.scene.gltf_writer import QUAD, data_uri, gltf_document, png, write_glb


@pytest.fixture
def read(tmp_path):
    """Parts and notes of a file with some content: text, bytes or a glTF document."""

    def write_and_read(name, content, materials=True):
        if isinstance(content, dict):
            content = json.dumps(content)
        (tmp_path / name).write_bytes(content.encode() if isinstance(content, str) else content)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", InputWarning)
            parts = read_mesh_file(tmp_path / name, with_materials=materials)
        return parts, [str(warning.message).removeprefix(f"{tmp_path / name}: ") for warning in caught]

    return write_and_read


def area(part):
    return face_areas(part.mesh.vertices, part.mesh.faces).sum()


# PLY

STRIP = [0, 1, 2, 3, -1, 4, 5, 6]
STRIP_CORNERS = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [5, 0, 0], [6, 0, 0], [5, 1, 0]]


@pytest.mark.parametrize("order", ["<", ">"])
def test_binary_ply_in_both_byte_orders_with_elements_in_any_order(read, order):
    """Strips before vertices, an element that is not known, and properties of many types."""
    name = {"<": "little", ">": "big"}[order]
    header = (
        f"ply\r\nformat binary_{name}_endian 1.0\r\ncomment made by hand\r\nobj_info nothing\r\n"
        "element tristrips 1\r\nproperty list int int vertex_indices\r\n"
        "element odd 2\r\nproperty list ushort double a\r\nproperty short b\r\n"
        "element vertex 7\r\nproperty double x\r\nproperty double y\r\nproperty double z\r\nproperty uint16 q\r\n"
        "end_header\r\n"
    )
    body = np.array([len(STRIP), *STRIP], f"{order}i4").tobytes()
    for values in ([], [1.5, 2.5]):
        body += np.array([len(values)], f"{order}u2").tobytes() + np.array(values, f"{order}f8").tobytes()
        body += np.array([7], f"{order}i2").tobytes()
    rows = np.zeros(7, [("p", f"{order}f8", 3), ("q", f"{order}u2")])
    rows["p"] = STRIP_CORNERS
    (part,), notes = read("a.ply", header.encode() + body + rows.tobytes())
    assert area(part) == pytest.approx(1.5)
    a, b, c = (part.mesh.vertices[part.mesh.faces[:, i]] for i in range(3))
    assert (np.cross(b - a, c - a)[:, 2] > 0).all()
    assert notes == [
        "its 2 elements 'odd' are left out",
        "properties of its elements 'vertex' are left out: q",
    ]
    for cut in (1, 40, 150):
        with pytest.raises(InputError, match="cut off"):
            read("b.ply", (header.encode() + body + rows.tobytes())[:-cut])


def ply(vertex, vertices, face, faces, comments=""):
    """An ASCII PLY."""
    lines = [
        "ply",
        "format ascii 1.0",
        *([f"comment {comments}"] if comments else []),
        f"element vertex {len(vertices)}",
    ]
    lines += [f"property {p}" for p in vertex] + [f"element face {len(faces)}"] + [f"property {p}" for p in face]
    rows = [" ".join(map(str, row)) for row in [*vertices, *faces]]
    return "\n".join([*lines, "end_header", *rows]) + "\n"


XYZ = ("float x", "float y", "float z")
LIST = "list uchar int vertex_indices"
SQUARE = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]


@pytest.mark.parametrize(
    ("kind", "value", "share", "note"),
    [
        ("uchar", 188, 188 / 255, None),
        ("ushort", 30000, 30000 / 65535, None),
        ("ushort", 188, 188 / 255, "taken as codes from 0 to 255"),
        ("int", 188, 188 / 255, None),
        ("float", 0.25, 0.25, None),
        ("double", 188.0, 188 / 255, "taken as codes from 0 to 255"),
    ],
)
def test_colours_by_type(read, kind, value, share, note):
    vertices = [[*p, value, 0, value] for p in SQUARE]
    properties = (*XYZ, f"{kind} red", f"{kind} green", f"{kind} blue")
    (part,), notes = read("a.ply", ply(properties, vertices, (LIST,), [[4, 0, 1, 2, 3]]))
    linear = ((share + 0.055) / 1.055) ** 2.4
    np.testing.assert_allclose(part.mesh.colors, [[linear, 0, linear]] * 4, rtol=1e-5)
    assert [note in n for n in notes] == ([] if note is None else [True])


def test_colours_of_faces_stay_apart(read):
    properties = (LIST, "uchar red", "uchar green", "uchar blue")
    (part,), notes = read("a.ply", ply(XYZ, SQUARE, properties, [[3, 0, 1, 2, 255, 0, 0], [3, 0, 2, 3, 0, 0, 255]]))
    colors = part.mesh.colors[part.mesh.faces]
    np.testing.assert_array_equal(colors, [[[1, 0, 0]] * 3, [[0, 0, 1]] * 3])
    assert part.material == Principled(base_color=VertexColors())
    assert notes == []


def test_each_texture_has_its_faces(read, tmp_path):
    for name, colour in (("a.png", [255, 0, 0]), ("B.PNG", [0, 255, 0])):
        Image.fromarray(np.full((2, 2, 3), colour, np.uint8)).save(tmp_path / name)
    properties = (LIST, "list uchar float texcoord", "int texnumber")
    faces = [[3, 0, 1, 2, 6, 0, 0, 1, 0, 1, 1, 0], [3, 0, 2, 3, 6, 0, 0, 1, 1, 0, 1, 1]]
    text = ply(XYZ, SQUARE, properties, faces, "TextureFile a.png\ncomment TextureFile b.png")
    parts, notes = read("a.ply", text)
    assert [tuple(p.material.base_color.pixels[0, 0]) for p in parts] == [(1, 0, 0), (0, 1, 0)]
    np.testing.assert_array_equal(parts[1].mesh.texture_coordinates[parts[1].mesh.faces[0]], [[0, 0], [1, 1], [0, 1]])
    assert notes == []


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (ply(XYZ, [[0, 0, 0], [1, 0], [0, 1, 0]], (LIST,), [[3, 0, 1, 2]]), "line 10: 2 values, 3 are needed"),
        (ply(XYZ, [[0, 0, 0], [1, "x", 0], [0, 1, 0]], (LIST,), [[3, 0, 1, 2]]), "line 10: 'x' is not a number"),
        (ply(XYZ, SQUARE, (LIST,), [[3, 0, 1, 2, 3]]), "line 13: more values than the header states"),
        (ply(XYZ, SQUARE, (LIST,), [[4, 0, 1, 2]]), "line 13: fewer values than the header states"),
        (ply(XYZ, SQUARE, (LIST,), [[-3, 0, 1, 2]]), "line 13: -3 is not the length of a list"),
        (ply(XYZ, SQUARE, (LIST,), [[3, 0, 1, 1.5]]), "'vertex_indices' has 1.5, which is not a whole number"),
        (ply(XYZ, SQUARE, (LIST,), [[3, 0, 1, 4]]), r"face 0 refers to vertices \[0, 1, 4\], but there are 4"),
        (ply(XYZ, SQUARE, ("int a",), [[3]]), "its faces have no list 'vertex_indices'"),
        (ply(XYZ, SQUARE, (LIST,), []), "the mesh has no triangles, only 4 points; .* from-points"),
        (ply(("float x", "float y"), [[0, 0]], (LIST,), []), "its vertices have no x, y and z"),
        (ply(("flaot x",), [[0]], (LIST,), []), "line 4 of the header: 'property flaot x' is not understood"),
        ("ply\nformat ascii 1.0\nelement vertex 1\n", r"its header has no end \('end_header'\)"),
        ("ply\nelement vertex 1\nend_header\n", "its header does not state the format"),
        (ply(XYZ, SQUARE, (LIST,), [[3, 0, 1, 2]]).replace("vertex 4", "vertex 9"), "has 5 of 9 elements 'vertex'"),
    ],
)
def test_damaged_ply_is_described(read, content, message):
    with pytest.raises(InputError, match=message):
        read("a.ply", content)


# OBJ and STL


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("v 0 0 0\nv 1 0\nv 0 1 0\nf 1 2 3\n", "line 2: 'v' needs 3 numbers, found '1 0'"),
        ("v 0 0 0\nv 1,5 0 0\nv 0 1 0\nf 1 2 3\n", "line 2: 'v' needs 3 numbers, found '1,5 0 0'"),
        (
            "v 0 0 0\nv 1 0 0\nv 0 1 0\n\nf 1 2 9\n",
            "line 5: the face refers to number 9 of the vertices, but there are 3",
        ),
        (
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1/1 2/1 3/1\n",
            "line 4: the face refers to number 1 of the texture coordinates",
        ),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 0 1 2\n", "line 4: there is no vertex 0"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf -4 -2 -1\n", "line 4: there is no vertex -4"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 x\n", "line 4: 'x' is not a corner of a face"),
        ("v 0 0 0\nsurf 0 1 0 1 1 2\n", "line 2: 'surf' is geometry other than polygons"),
        ("v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "vertices: 1 of 3 are not finite"),
    ],
)
def test_damaged_obj_is_described(read, content, message):
    with pytest.raises(InputError, match=message):
        read("a.obj", content)


def test_obj_layouts_may_mix(read):
    """Corners with and without texture coordinates and normals, comments, continued lines and lines of points."""
    text = (
        "\ufeff# made of C:\\things\\\nv 0 0 0 1 # weight\nv 1 0 0 1\nv 1 1 0 1\nv 0 1 0 1\nvt 0\nvt 1 0 0\nvn 0 0 2\n"
        "f 1/1/1 2/2/1 \\\n 3/1/1\nf 1//1 3//1 4//1\nf 1/1 -2/2 -1/1\nf 1 2 3 4\nl 1 2\np 3\nwhat 1\nf 1 2\n"
    )
    parts, notes = read("a.obj", text)
    kinds = sorted((p.mesh.texture_coordinates is not None, p.mesh.normals is not None, area(p)) for p in parts)
    assert kinds == [(False, False, 1.0), (False, True, 0.5), (True, False, 0.5), (True, True, 0.5)]
    np.testing.assert_array_equal(next(p for p in parts if p.mesh.normals is not None).mesh.normals[0], [0, 0, 1])
    assert notes == [
        "points and lines are left out",
        "statements 'what' are not known and are left out, the first is on line 16",
        "faces of fewer than three corners are left out, the first is on line 17",
    ]


TRIANGLE = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)


def binary_stl(count=1, head=b"solid that is binary"):
    row = np.zeros(3, "<f4").tobytes() + TRIANGLE.tobytes() + b"\0\0"
    return head.ljust(80) + np.uint32(count).tobytes() + row


def test_binary_stl_may_begin_with_solid(read):
    assert area(read("a.stl", binary_stl())[0][0]) == pytest.approx(0.5)
    with pytest.raises(InputError, match="it states 2 triangles, but has 1; it is cut off"):
        read("a.stl", binary_stl(2, b"x"))


def test_binary_stl_may_have_forgotten_its_count(read):
    (part,), notes = read("a.stl", binary_stl(0))
    assert area(part) == pytest.approx(0.5)
    assert notes == ["says that it has no triangles, but has 1; these are read"]


def test_ascii_stl_in_any_case(read):
    facet = "FACET NORMAL 0 0 1\n OUTER LOOP\n{}  ENDLOOP\n ENDFACET\n"
    vertices = "".join(f"  VERTEX {x} {y} {z}\n" for x, y, z in TRIANGLE)
    text = f"SOLID a vertex of it\n{facet.format(vertices)}ENDSOLID\nsolid b\n{facet.format(vertices)}endsolid b\n"
    assert area(read("a.stl", text)[0][0]) == pytest.approx(1.0)
    with pytest.raises(InputError, match="2 complete facets with 5 vertices, each needs three"):
        read("a.stl", text.replace("  VERTEX 0.0 1.0 0.0\n", "", 1))
    with pytest.raises(InputError, match="line 5: a vertex needs three numbers"):
        read("a.stl", text.replace("1.0 0.0 0.0", "1.0 o.o 0.0", 1))


# glTF

FOUR = {"POSITION": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]}


def test_strips_and_fans_face_one_way(read):
    for mode, order in ((5, [0, 1, 2, 3]), (6, [0, 1, 3, 2])):
        document = gltf_document(FOUR, order)
        document["meshes"][0]["primitives"][0]["mode"] = mode
        (part,), _ = read("a.gltf", document)
        a, b, c = (part.mesh.vertices[part.mesh.faces[:, i]] for i in range(3))
        np.testing.assert_allclose(np.cross(b - a, c - a), [[0, -1, 0]] * 2, atol=1e-7)


def with_accessor(document, values, kind, component=5126, **more):
    """Number of a further accessor."""
    data = np.asarray(values).tobytes()
    document["buffers"].append({"byteLength": len(data), "uri": data_uri(data)})
    document["bufferViews"].append({"buffer": len(document["buffers"]) - 1, "byteLength": len(data)})
    view = len(document["bufferViews"]) - 1
    document["accessors"].append(
        {"bufferView": view, "componentType": component, "type": kind, "count": len(values), **more}
    )
    return len(document["accessors"]) - 1


def test_morph_targets_move_by_their_weights(read):
    document = gltf_document(FOUR, [[0, 1, 2]])
    target = {"POSITION": with_accessor(document, np.full((4, 3), 2, np.float32), "VEC3")}
    document["meshes"][0]["primitives"][0]["targets"] = [target]
    document["meshes"][0]["weights"] = [0.5]
    for weights, moved in ((None, 1.0), ([0.25], 0.5)):
        document["nodes"] = [{"mesh": 0} if weights is None else {"mesh": 0, "weights": weights}]
        (part,), _ = read("a.gltf", document)
        np.testing.assert_allclose(part.mesh.vertices[0], [moved, -moved, moved])


def test_integers_are_shares_where_the_accessor_says_so(read):
    """KHR_mesh_quantization: positions in shorts under a scaled node, texture coordinates in bytes."""
    document = gltf_document(QUAD, nodes=[{"mesh": 0, "scale": [0.001] * 3}])
    attributes = document["meshes"][0]["primitives"][0]["attributes"]
    attributes["POSITION"] = with_accessor(document, np.int16(np.array(QUAD["POSITION"]) * 1000), "VEC3", 5122)
    attributes["NORMAL"] = with_accessor(
        document, np.int8(np.array(QUAD["NORMAL"]) * 127), "VEC3", 5120, normalized=True
    )
    attributes["TEXCOORD_0"] = with_accessor(
        document, np.uint8(np.array(QUAD["TEXCOORD_0"]) * 255), "VEC2", 5121, normalized=True
    )
    document["extensionsRequired"] = ["KHR_mesh_quantization"]
    (part,), notes = read("a.gltf", document)
    (plain,), _ = read("b.gltf", gltf_document(QUAD))
    np.testing.assert_allclose(part.mesh.vertices, plain.mesh.vertices, atol=1e-6)
    np.testing.assert_allclose(part.mesh.normals, plain.mesh.normals)
    np.testing.assert_allclose(part.mesh.texture_coordinates, plain.mesh.texture_coordinates)
    assert notes == []


def test_skins_with_several_joints_blend(read):
    """Two vertices on either joint, and one in between."""
    document = gltf_document({"POSITION": [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]]}, [[0, 1, 2], [2, 1, 3]])
    attributes = document["meshes"][0]["primitives"][0]["attributes"]
    attributes["JOINTS_0"] = with_accessor(document, np.uint8([[0, 1, 0, 0]] * 4), "VEC4", 5121)
    weights = np.float32([[1, 0, 0, 0], [0, 1, 0, 0], [0.5, 0.5, 0, 0], [0.25, 0.25, 0, 0]])
    attributes["WEIGHTS_0"] = with_accessor(document, weights, "VEC4")
    document["nodes"] = [{"mesh": 0, "skin": 0, "translation": [7, 7, 7]}, {"translation": [0, 0, 4]}, {}]
    document["skins"] = [{"joints": [1, 2]}]
    (part,), _ = read("a.gltf", document)
    np.testing.assert_allclose(part.mesh.vertices[:, 1], [-4, 0, -2, -2])  # z of glTF is -y here


def test_far_nodes_keep_the_shape_of_their_mesh(read):
    """A map's coordinates in the nodes, as photogrammetry has them."""
    document = gltf_document(
        nodes=[{"children": [1], "translation": [5e5, 100, -5.6e6]}, {"mesh": 0, "scale": [0.3] * 3}]
    )
    (part,), _ = read("a.gltf", document)
    mesh = placed(part.mesh, placement((-5e5, -5.6e6, -100), (0, 0, 0), (1, 1, 1)))
    np.testing.assert_allclose(mesh.vertices, np.array(QUAD["POSITION"])[:, [0, 2, 1]] * [0.3, -0.3, 0.3], atol=1e-6)


GLOSS = {"diffuseFactor": [0.5, 0.5, 0.5, 0.5], "specularFactor": [0.5, 0.5, 0.5], "glossinessFactor": 0.5}


def spec_gloss(**settings):
    return {"extensions": {"KHR_materials_pbrSpecularGlossiness": settings}, "alphaMode": "BLEND"}


def test_specular_glossiness_has_its_textures(read):
    """The diffuse texture with its alpha; glossiness in the other's alpha, its colour as reflection."""
    gold = png(np.full((2, 2, 4), [188, 188, 188, 128]))
    textures = {"diffuseTexture": {"index": 0}, "specularGlossinessTexture": {"index": 1}}
    images = [png(np.full((2, 2, 4), [255, 188, 0, 51])), gold]
    (part,), notes = read("a.gltf", gltf_document(material=spec_gloss(**GLOSS, **textures), images=images))
    material = part.material
    np.testing.assert_allclose(material.base_color.pixels[0, 0], [0.5, 0.5 * 0.503, 0], atol=1e-3)
    assert material.opacity == pytest.approx(0.5 * 51 / 255, abs=1e-3)
    assert material.roughness == pytest.approx(1 - 0.5 * 128 / 255, abs=1e-3)
    assert ((material.ior - 1) / (material.ior + 1)) ** 2 == pytest.approx(0.5 * 0.503, abs=1e-3)
    assert material.metallic == 0.0
    assert len(notes) == 1
    assert "reflects 25 % at normal incidence" in notes[0]


def test_specular_glossiness_without_a_diffuse_colour_is_a_metal(read):
    gold = {"diffuseFactor": [0, 0, 0, 1], "specularFactor": [1.0, 0.77, 0.34], "glossinessFactor": 0.8}
    (part,), notes = read("a.gltf", gltf_document(material=spec_gloss(**gold)))
    assert part.material.base_color == pytest.approx((1.0, 0.77, 0.34))
    assert (part.material.metallic, part.material.roughness) == (1.0, pytest.approx(0.2))
    assert notes == []


def test_a_texture_falls_back_to_an_image_that_can_be_read(read):
    material = {"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}
    document = gltf_document(material=material, images=[b"\xabKTX 20\xbb\r\n\x1a\n", png([[[255, 255, 255]]])])
    document["textures"] = [{"source": 1, "extensions": {"KHR_texture_basisu": {"source": 0}}}]
    (part,), _ = read("a.gltf", document)
    assert part.material.base_color.pixels.shape == (1, 1, 3)
    del document["textures"][0]["source"]
    with pytest.raises(InputError, match="image 0 .* cannot be read"):
        read("a.gltf", document)
    document["textures"] = [{}]
    with pytest.raises(InputError, match="texture 0 has no image"):
        read("a.gltf", document)


def test_what_gltf_says_and_is_not_carried_is_named(read):
    material = {
        "pbrMetallicRoughness": {
            "baseColorTexture": {"index": 0},
            "metallicRoughnessTexture": {"index": 0, "texCoord": 1},
        },
        "extensions": {"KHR_materials_sheen": {}, "KHR_materials_specular": {"specularColorFactor": [1, 0, 0]}},
    }
    document = gltf_document(
        {**QUAD, "COLOR_0": np.full((4, 4), 128, np.uint8)}, material={**material, "alphaMode": "BLEND", "name": "cloth"},
        images=[png([[[255, 255, 255]]])], samplers=[{"wrapS": 33071}],
        extensionsUsed=["KHR_materials_sheen", "KHR_materials_specular", "ACME_x"], animations=[{}],
    )  # fmt: skip
    document["scenes"].append({"nodes": []})
    document["meshes"][0]["primitives"].append({"mode": 1, "attributes": {}})
    _, notes = read("a.gltf", document)
    assert notes == [
        "KHR_materials_sheen is left out (sheen)",
        "the extension ACME_x is not known and is left out",
        "its animation is left out; the pose is the one without it",
        "has 2 scenes, of which number 0 is shown",
        "material 0 ('cloth') uses several sets of texture coordinates; all its textures are laid by TEXCOORD_0",
        "the alpha of its vertex colours is left out",
        "material 0 ('cloth'): of KHR_materials_specular only the strength is used",
        "texture 0 is wrapped differently along its axes; both are as wrapS says",
        "points and lines are left out",
    ]
    assert read("a.gltf", document, materials=False)[1] == [notes[2], notes[3], notes[8]]


def test_common_liberties_of_gltf_files_are_taken(read, tmp_path):
    """Zeros behind the JSON of a .glb, bytes behind its end, names in another case, strides of 0, names of no kind."""
    document = gltf_document(nodes=[{"mesh": 0, "name": None}])
    for view in document["bufferViews"]:
        view["byteStride"] = 0
    document["buffers"].append({"byteLength": 3, "uri": "More%20Data.BIN"})
    document["bufferViews"].append({"buffer": 1, "byteLength": 3})
    (tmp_path / "more data.bin").write_bytes(b"abc")
    write_glb(tmp_path / "thing.glb", document)
    content = (tmp_path / "thing.glb").read_bytes()
    end = 20 + int.from_bytes(content[12:16], "little")
    (part,), notes = read("a.glb", content[:end].rstrip(b" ").ljust(end, b"\0") + content[end:] + b"tail of it")
    assert area(part) == pytest.approx(4.0)
    assert notes == []
    assert GltfFile(tmp_path / "a.glb").view(len(document["bufferViews"]) - 1) == b"abc"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"nodes": [{"children": [0]}]}, "node 0 is the child of two nodes, or its own ancestor"),
        ({"nodes": [{"mesh": 5}]}, "refers to mesh 5, but the file has 1 of them"),
        ({"nodes": [{"mesh": "x"}]}, r"nodes\[0\].mesh: must be a valid integer"),
        ({"nodes": [{"mesh": 0, "skin": 0}], "skins": [{"joints": [0]}]}, "with skin 0 has no JOINTS_0 and WEIGHTS_0"),
        ({"meshes": 3}, "meshes: must be a valid list"),
        ({"buffers": [{"byteLength": 3}]}, "buffer 0 has no data"),
        ({"buffers": [{"byteLength": 3, "uri": "data:;base64,AAAA"}]}, "buffer view 1 ends at byte .* has 3"),
        ({"scene": 4}, "refers to scene 4, but the file has 1"),
    ],
)
def test_damaged_gltf_is_described(read, change, message):
    with pytest.raises(InputError, match=message):
        read("a.gltf", {**gltf_document(), **change})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"count": 7}, "7 indices, which is not|accessor 0 reads 28 bytes of buffer view 0, which has 24"),
        ({"count": 5}, "5 indices, which is not a multiple of three"),
        ({"componentType": 5126}, "accessor 0 is SCALAR of type 5126; whole numbers, 1 in each element are needed"),
        ({"type": "VEC9"}, "accessor 0 is VEC9 of type 5125; allowed are SCALAR, "),
        ({"bufferView": 9}, "refers to buffer view 9"),
        ({"sparse": {"count": 1, "indices": {"bufferView": 0, "componentType": 5125, "byteOffset": 20},
                     "values": {"bufferView": 0}}, "count": 3}, "accessor 0 replaces element 3, but has 3"),
    ],
)  # fmt: skip
def test_damaged_accessors_are_described(read, change, message):
    document = gltf_document()
    document["accessors"][0] |= change
    with pytest.raises(InputError, match=message):
        read("a.gltf", document)


def test_what_ply_and_stl_hold_beside_is_named(read):
    header = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n"
    header += "property float quality\nelement face 1\nproperty list uchar int vertex_indices\n"
    rows = "0 0 0 1\n1 0 0 1\n0 1 0 1\n"
    facet = "facet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\n"
    edge = "element edge 1\nproperty int vertex1\nproperty int vertex2\n"
    for name, content, expected in (
        ("a.ply", f"{header}end_header\n{rows}3 0 1 2\n", []),
        (
            "a.ply",
            f"{header}property int material_index\nend_header\n{rows}3 0 1 2 5\n",
            ["'face' are left out: material_index"],
        ),
        ("a.ply", f"{header}{edge}end_header\n{rows}3 0 1 2\n0 1\nmore\n", ["its 1 elements 'edge'", "1 lines behind"]),
        ("a.stl", f"solid a\n{facet}endfacet\nendsolid a\n", []),
        ("a.stl", f"solid a\n{facet}color 1 0 0\nendfacet\nendsolid a\n", ["lines that begin with color are left out"]),
        ("a.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\n#MRGB ff0000ffff00ff00ff0000ff\nf 1 2 3\n", ["ZBrush"]),
    ):
        _, notes = read(name, content)
        assert len(notes) == len(expected)
        assert all(words in note for words, note in zip(expected, notes, strict=True)), notes


@pytest.mark.parametrize(("name", "encoding"), [("\u8868", "shift_jis"), ("\u529f", "big5"), ("\u4e9d", "gb18030")])
def test_letters_whose_bytes_mean_other_things_alone_are_names(read, tmp_path, name, encoding):
    """Their second bytes are a backslash, or end a line by Unicode's rules."""
    (tmp_path / "m.mtl").write_bytes(f"newmtl {name}\nKd 0.5 0.25 0.125\n".encode(encoding))
    obj = f"mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl {name}\nf 1 2 3\n".encode(encoding)
    (part,), notes = read("a.obj", obj)
    assert notes == []
    assert part.material.base_color == (0.5, 0.25, 0.125)
