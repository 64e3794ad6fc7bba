"""glTF files: geometry in its place, and materials as they look under Mitsuba's own path tracer."""

import io
import json
import math

import numpy as np
import pytest
from PIL import Image

from lightdepth.errors import InputError, InputWarning
from lightdepth.images.radiance import write_radiance
from lightdepth.scene.materials import Principled
from lightdepth.scene.meshes import read_mesh_file
from lightdepth.scene.meshes.emissive import split_emissive
from lightdepth.scene.meshes.mirrored import split_mirrored
from lightdepth.scene.model import Scene, SyntheticObject, SyntheticPart
from tests.scene.gltf_writer import QUAD, gltf_document, png, write_glb

MATTE = {"KHR_materials_specular": {"specularFactor": 0.0}}
DOWN = [0.0, 0.0, -1.0]
CORNERS = np.array([[-0.5, 0.5, 2], [0.5, 0.5, 2], [-0.5, -0.5, 2], [0.5, -0.5, 2]])  # of the image: upper left first
RED_GREEN_BLUE_WHITE = [[[255, 0, 0], [0, 255, 0]], [[0, 0, 255], [255, 255, 255]]]


@pytest.fixture
def parts_of(tmp_path):
    """Parts of a glTF document, read from a file."""

    def read(document, materials=True):
        path = tmp_path / "thing.gltf"
        path.write_text(json.dumps(document))
        return read_mesh_file(path, with_materials=materials)

    return read


@pytest.fixture
def look(mi, parts_of):
    """Radiance along rays, with the shapes of a glTF document in a constant environment."""
    from lightdepth.kernel.shapes import synthetic_shapes
    from tests.scene.tracing import radiance

    def trace(document, origins, directions, **settings):
        parts = [
            piece for part in parts_of(document) for piece in split_mirrored(SyntheticPart(part.mesh, part.material))
        ]
        scene = Scene(panorama=None, synthetic=(SyntheticObject("thing", tuple(parts)),))
        shapes = [shape for _, shape in synthetic_shapes(scene).numbered]
        return radiance(shapes, origins, directions, **settings)

    return trace


def surface(**settings):
    """A matte glTF material."""
    matte = {"metallicFactor": 0.0, "roughnessFactor": 1.0}
    extensions = {**MATTE, **settings.pop("extensions", {})}
    return {"pbrMetallicRoughness": {**matte, **settings.pop("pbr", {})}, "extensions": extensions, **settings}


def strided(stride):
    views = gltf_document()["bufferViews"]
    return [{**view, "byteStride": stride} if index == 1 else view for index, view in enumerate(views)]


def test_y_up_becomes_z_up(parts_of):
    triangle = {"POSITION": [[1, 0, 0], [0, 2, 0], [0, 0, 3]]}
    (part,) = parts_of(gltf_document(triangle, [[0, 1, 2]]))
    np.testing.assert_allclose(part.mesh.vertices, [[1, 0, 0], [0, 0, 2], [0, -3, 0]], atol=1e-7)
    assert part.mesh.normals is None


def test_nodes_place_meshes_again_and_again(parts_of):
    nodes = [
        {"children": [1, 2], "translation": [0, 0, 10], "rotation": [0, math.sqrt(0.5), 0, math.sqrt(0.5)]},
        {"mesh": 0, "scale": [2, 2, 2]},
        {"mesh": 0, "matrix": [-1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1]},
    ]
    first, second = sorted(parts_of(gltf_document(nodes=nodes)), key=lambda p: -np.ptp(p.mesh.vertices))
    # Turned by 90 degrees about glTF's y: (x, y, z) goes to (z, y, -x); then (x, y, z) to (x, -z, y).
    corners = np.array(QUAD["POSITION"]) * 2.0
    np.testing.assert_allclose(
        first.mesh.vertices, np.stack([corners[:, 2], corners[:, 0] - 10, corners[:, 1]], 1), atol=1e-5
    )
    np.testing.assert_allclose(second.mesh.vertices.mean(0), [0, -10 + 5, 0], atol=1e-5)
    for part in (first, second):  # The mirrored one, too, shows its outside upward.
        a, b, c = part.mesh.vertices[part.mesh.faces[0]]
        assert np.cross(b - a, c - a)[2] > 0
        np.testing.assert_allclose(part.mesh.normals, [[0, 0, 1]] * 4, atol=1e-6)


def test_real_meshes_are_read_without_images(parts_of):
    document = gltf_document(material=surface(pbr={"baseColorTexture": {"index": 0}}), images=[b"not an image"])
    assert parts_of(document, materials=False)[0].material is None
    with pytest.raises(InputError, match=r"thing.gltf: image 0 .* cannot be read"):
        parts_of(document)


def test_glb_and_gltf_are_the_same(parts_of, tmp_path):
    document = gltf_document(material=surface(pbr={"baseColorFactor": [0.1, 0.2, 0.3, 1.0]}))
    (expected,) = parts_of(document)
    write_glb(tmp_path / "thing.glb", document)
    (found,) = read_mesh_file(tmp_path / "thing.glb", with_materials=True)
    np.testing.assert_array_equal(found.mesh.vertices, expected.mesh.vertices)
    np.testing.assert_array_equal(found.mesh.texture_coordinates, expected.mesh.texture_coordinates)
    assert found.material == expected.material
    assert found.material.base_color == (0.1, 0.2, 0.3)


def test_a_texture_shows_the_right_texel_in_the_right_corner(look):
    document = gltf_document(
        material=surface(pbr={"baseColorTexture": {"index": 0}}), images=[png(RED_GREEN_BLUE_WHITE)],
        samplers=[{"magFilter": 9728}],
    )  # fmt: skip
    expected = np.reshape(RED_GREEN_BLUE_WHITE, (4, 3)) / 255
    np.testing.assert_allclose(look(document, CORNERS, DOWN, samples=4000), expected, atol=0.01)


def test_colours_are_decoded_from_srgb_and_multiplied_by_the_factor(look):
    material = surface(pbr={"baseColorTexture": {"index": 0}, "baseColorFactor": [1.0, 0.5, 0.25, 1.0]})
    found = look(gltf_document(material=material, images=[png([[[188, 188, 188]]])]), [0, 0, 2], DOWN, samples=4000)
    linear = ((188 / 255 + 0.055) / 1.055) ** 2.4
    np.testing.assert_allclose(found, [[linear, 0.5 * linear, 0.25 * linear]], rtol=0.01, atol=0.002)


def test_texture_transform_follows_the_specifications_example(look):
    """Lower left quadrant of the image, turned clockwise by 90 degrees."""
    picture = np.zeros((4, 4, 3))
    picture[2:, :2] = RED_GREEN_BLUE_WHITE
    transform = {"offset": [0, 1], "rotation": math.pi / 2, "scale": [0.5, 0.5]}
    info = {"index": 0, "extensions": {"KHR_texture_transform": transform}}
    document = gltf_document(
        material=surface(pbr={"baseColorTexture": info}), images=[png(picture)], samplers=[{"magFilter": 9728}]
    )
    upper_left, upper_right, lower_left, lower_right = np.reshape(RED_GREEN_BLUE_WHITE, (4, 3)) / 255
    expected = [lower_left, upper_left, lower_right, upper_right]
    np.testing.assert_allclose(look(document, CORNERS, DOWN, samples=4000), expected, atol=0.01)


def test_vertex_colours_multiply_the_base_colour(look):
    colors = np.full((4, 3), [128, 255, 0], np.uint8)
    factor = {"baseColorFactor": [1.0, 0.5, 1.0, 1.0]}
    plain = gltf_document({**QUAD, "COLOR_0": np.pad(colors, ((0, 0), (0, 1)))}, material=surface(pbr=factor))
    np.testing.assert_allclose(look(plain, [0, 0, 2], DOWN, samples=4000), [[128 / 255, 0.5, 0]], atol=0.01)
    textured = gltf_document(
        {**QUAD, "COLOR_0": np.pad(colors, ((0, 0), (0, 1)))},
        material=surface(pbr={**factor, "baseColorTexture": {"index": 0}}),
        images=[png(RED_GREEN_BLUE_WHITE)], samplers=[{"magFilter": 9728}],
    )  # fmt: skip
    expected = np.reshape(RED_GREEN_BLUE_WHITE, (4, 3)) / 255 * [128 / 255, 0.5, 0]
    np.testing.assert_allclose(look(textured, CORNERS, DOWN, samples=4000), expected, atol=0.01)


def test_metalness_is_blue_and_roughness_green(parts_of):
    info = {"metallicRoughnessTexture": {"index": 0}, "metallicFactor": 0.5, "roughnessFactor": 1.0}
    (part,) = parts_of(gltf_document(material={"pbrMetallicRoughness": info}, images=[png([[[9, 51, 102]]])]))
    assert part.material.roughness == pytest.approx(51 / 255, abs=1e-3)
    assert part.material.metallic == pytest.approx(0.5 * 102 / 255, abs=1e-3)


def tilted(x, y):
    """Pixels of a normal map whose normals lean toward +x and +y of the image."""
    normal = np.array([x, y, math.sqrt(1 - x * x - y * y)])
    return png(np.full((2, 2, 3), np.round((normal * 0.5 + 0.5) * 255)))


@pytest.mark.parametrize("mirrored", [False, True])
@pytest.mark.parametrize(("x", "y"), [(0.5, 0.0), (-0.5, 0.0), (0.0, 0.5), (0.0, -0.5)])
def test_normal_maps_lean_the_right_way(look, mirrored, x, y):
    quad = dict(QUAD)
    if mirrored:
        quad["TEXCOORD_0"] = [[1 - u, v] for u, v in QUAD["TEXCOORD_0"]]
    document = gltf_document(quad, material=surface(normalTexture={"index": 0}), images=[tilted(x, y)])
    toward = np.array([-x if mirrored else x, y, math.sqrt(0.75)])  # where the normal leans in world space
    for light in ([0.6, 0.0, 0.8], [0.0, 0.6, 0.8]):
        lamp = {"type": "directional", "direction": [-c for c in light], "irradiance": 1.0}
        found = look(document, [0, 0, 2], DOWN, environment=0.0, samples=4, more={"lamp": lamp})
        # The little that Fresnel reflects at slanted angles is not there for the diffuse lobe.
        assert found[0, 0] == pytest.approx(np.dot(toward, light) / math.pi, rel=0.02)


def test_normal_scale_flattens(parts_of):
    document = gltf_document(material=surface(normalTexture={"index": 0, "scale": 0.5}), images=[tilted(0.5, 0.0)])
    normal = parts_of(document)[0].material.normal_map.pixels[0, 0].astype(float) * 2 - 1
    np.testing.assert_allclose(normal, [0.25, 0.0, math.sqrt(0.75)], atol=0.01)


def test_emission_has_its_texture_factor_and_strength(look):
    material = surface(
        pbr={"baseColorFactor": [0, 0, 0, 1]}, emissiveFactor=[1.0, 0.5, 0.25], emissiveTexture={"index": 0},
        extensions={"KHR_materials_emissive_strength": {"emissiveStrength": 8.0}},
    )  # fmt: skip
    document = gltf_document(material=material, images=[png(RED_GREEN_BLUE_WHITE)], samplers=[{"magFilter": 9728}])
    expected = np.reshape(RED_GREEN_BLUE_WHITE, (4, 3)) / 255 * [8, 4, 2]
    np.testing.assert_allclose(look(document, CORNERS, DOWN, environment=0.0), expected, atol=0.02)


@pytest.mark.parametrize("suffix", [".hdr", ".exr"])
def test_emission_of_high_range_comes_from_a_file_beside(parts_of, tmp_path, suffix):
    radiance = np.array([[[16.0, 2.0, 0.5], [0.0, 0.0, 0.0]], [[1.0, 1.0, 1.0], [0.25, 8.0, 0.125]]], np.float32)
    write_radiance(tmp_path / f"glow{suffix}", radiance)
    material = surface(emissiveFactor=[1.0, 0.5, 0.25], emissiveTexture={"index": 0})
    document = gltf_document(
        material=material, images=[b""], samplers=[{"wrapS": 33071, "wrapT": 33071, "magFilter": 9728}]
    )
    document["images"] = [{"uri": f"glow{suffix}"}]
    texture = parts_of(document)[0].material.emission
    np.testing.assert_allclose(texture.pixels, radiance * [1.0, 0.5, 0.25], rtol=0.01)
    assert (texture.wrap, texture.nearest) == ("clamp", True)
    (tmp_path / f"glow{suffix}").unlink()
    with pytest.raises(InputError, match=f"glow{suffix}, which does not exist"):
        parts_of(document)


def test_alpha_mask_cuts_out_and_blend_covers_in_part(look):
    picture = png([[[0, 0, 0, 255], [0, 0, 0, 100]]])
    pbr = {"baseColorTexture": {"index": 0}, "baseColorFactor": [1, 1, 1, 0.8]}
    left_and_right = np.array([[-0.5, 0, 2], [0.5, 0, 2]])
    nearest = [{"magFilter": 9728}]
    for mode, expected in [
        ({"alphaMode": "OPAQUE"}, [0, 0]),
        ({"alphaMode": "MASK", "alphaCutoff": 0.5}, [0, 1]),
        ({"alphaMode": "MASK", "alphaCutoff": 0.9}, [1, 1]),
        ({"alphaMode": "BLEND"}, [0.2, 1 - 0.8 * 100 / 255]),
    ]:
        document = gltf_document(material=surface(pbr=pbr, **mode), images=[picture], samplers=nearest)
        found = look(document, left_and_right, DOWN, samples=4000)[:, 1]
        np.testing.assert_allclose(found, expected, atol=0.03, err_msg=str(mode))


def slab(thickness=0.5):
    """A closed box around the origin in glTF's coordinates, with normals for each face."""
    positions, normals, faces = [], [], []
    half = np.array([4.0, 0.5 * thickness, 4.0])
    for axis in range(3):
        for sign in (-1.0, 1.0):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            for su, sv in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
                corner = np.zeros(3)
                corner[axis], corner[u], corner[v] = sign, su, sv
                positions.append(corner * half)
                normals.append(np.eye(3)[axis] * sign)
            n = len(positions) - 4
            faces += [[n, n + 1, n + 2], [n, n + 2, n + 3]] if sign > 0 else [[n, n + 2, n + 1], [n, n + 3, n + 2]]
    return {"POSITION": np.float32(positions), "NORMAL": np.float32(normals)}, faces


@pytest.mark.parametrize(
    ("more", "bends"),
    [
        ({}, True),  # The file does not say, but the box is closed.
        ({"KHR_materials_volume": {"thicknessFactor": 0.5}}, True),
        ({"KHR_materials_volume": {"thicknessFactor": 0.0}}, False),
    ],
)
def test_transmission_bends_by_the_index_of_refraction(look, mi, more, bends):
    """A slab moves a slanted ray sideways by a known length, which a ramp below shows."""
    extensions = {"KHR_materials_transmission": {"transmissionFactor": 1.0}, "KHR_materials_ior": {"ior": 1.4}, **more}
    material = {"pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.0}, "extensions": extensions}
    attributes, faces = slab()
    ramp = np.zeros((1, 512, 3), np.float32)
    ramp[..., 0] = (np.arange(512) + 0.5) / 512
    ramp[..., 1] = 1.0
    bitmap = {"type": "bitmap", "bitmap": mi.Bitmap(ramp), "raw": True, "wrap_mode": "clamp"}
    below = mi.ScalarTransform4f().translate([0, 0, -1]).scale(4)
    screen = {"type": "rectangle", "to_world": below, "light": {"type": "area", "radiance": bitmap}}
    slant = math.radians(50)
    direction = np.array([math.sin(slant), 0.0, -math.cos(slant)])
    found = look(
        gltf_document(attributes, faces, material), -1.2 * direction, direction, environment=0.0, samples=20000,
        depth=4, more={"screen": screen},
    )[0]  # fmt: skip
    inside = math.asin(math.sin(slant) / 1.4)
    hit = math.tan(slant) - (0.5 * (math.tan(slant) - math.tan(inside)) if bends else 0.0)
    assert found[0] / found[1] * 8 - 4 == pytest.approx(hit, abs=0.02)


def test_an_open_pane_without_volume_is_thin(parts_of):
    material = {"extensions": {"KHR_materials_transmission": {"transmissionFactor": 1.0}}}
    assert parts_of(gltf_document(material=material))[0].material.thin


def test_clearcoat_adds_its_reflection(look):
    black = {"pbr": {"baseColorFactor": [0, 0, 0, 1]}}
    found = [
        look(
            gltf_document(material=surface(**black, extensions={"KHR_materials_clearcoat": coat})), [0, 0, 2], DOWN,
            samples=2000,
        )[0, 0]
        for coat in ({}, {"clearcoatFactor": 1.0}, {"clearcoatFactor": 0.5, "clearcoatRoughnessFactor": 0.2})
    ]  # fmt: skip
    np.testing.assert_allclose(found, [0.0, 0.04, 0.02], atol=0.002)


def test_index_of_refraction_sets_the_reflection(look):
    black = {"baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0.0, "roughnessFactor": 0.1}
    material = {"pbrMetallicRoughness": black, "extensions": {"KHR_materials_ior": {"ior": 2.0}}}
    found = look(gltf_document(material=material), [0, 0, 2], DOWN, samples=2000)
    np.testing.assert_allclose(found, 1 / 9, atol=0.002)


def test_back_faces_are_seen(look):
    found = look(gltf_document(material=surface()), [0, 0, -2], [0, 0, 1], samples=4000)
    np.testing.assert_allclose(found, 1.0, atol=0.01)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"asset": {"version": "1.0"}}, "is glTF of version 1.0; 2.0 is needed"),
        ({"extensionsRequired": ["ACME_hologram"]}, "needs the extension ACME_hologram, which lightdepth does not"),
        ({"buffers": [{"byteLength": 3, "uri": "gone.bin"}]}, "refers to the file gone.bin, which does not exist"),
        ({"nodes": [{}]}, "has no triangles"),
        ({"accessors": []}, "refers to accessor 1, but the file has 0 of them"),
        ({"asset": {"version": "2.1", "minVersion": "2.1"}}, "needs a reader of glTF 2.1"),
        (
            {"nodes": [{"mesh": 0, "matrix": [1, 0, 0, 0.1, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}]},
            "it must be 0, 0, 0, 1",
        ),
        ({"bufferViews": strided(8)}, r"has elements every 8 bytes \(byteStride\), but those of accessor 1 have 12"),
    ],
)
def test_broken_files_say_what_is_wrong(parts_of, change, message):
    with pytest.raises(InputError, match=message):
        parts_of({**gltf_document(), **change})


def test_what_is_not_declared_or_has_no_counterpart_is_named(parts_of):
    def morphed(weights, *targets):
        document = gltf_document(nodes=[{"mesh": 0, "weights": weights}])
        accessor = document["meshes"][0]["primitives"][0]["attributes"]["POSITION"]
        document["meshes"][0]["primitives"][0]["targets"] = [dict.fromkeys(names, accessor) for names in targets]
        return document

    sheen = surface(extensions={"KHR_materials_sheen": {"sheenColorFactor": [1, 0, 0]}})
    bright = gltf_document({**QUAD, "COLOR_0": np.full((4, 3), 2.0, np.float32)})
    for document, message in (
        (gltf_document(material=sheen), r"KHR_materials_sheen is left out \(sheen\)"),
        (
            gltf_document(nodes=[{"mesh": 0, "matrix": np.eye(4).ravel().tolist(), "scale": [2, 2, 2]}]),
            "only the matrix counts",
        ),
        (morphed([1.0, 1.0], ["POSITION"]), "has 2 weights and 1 morph targets"),
        (morphed([1.0], ["POSITION", "COLOR_0"]), "its morph targets of COLOR_0 are left out"),
        (bright, "vertex colours above 1 are cut off"),
    ):
        with pytest.warns(InputWarning, match=message):
            parts_of(document)


def test_colours_in_whole_numbers_are_shares(parts_of):
    document = gltf_document({**QUAD, "COLOR_0": np.full((4, 3), 51, np.uint8)})
    for accessor in document["accessors"]:
        accessor.pop("normalized", None)
    np.testing.assert_allclose(parts_of(document)[0].mesh.colors, 0.2, rtol=1e-6)


def test_cut_off_glb(tmp_path):
    write_glb(tmp_path / "thing.glb", gltf_document())
    (tmp_path / "cut.glb").write_bytes((tmp_path / "thing.glb").read_bytes()[:-100])
    with pytest.raises(InputError, match=r"cut.glb: the file is cut off"):
        read_mesh_file(tmp_path / "cut.glb", with_materials=True)


def test_only_the_faces_that_shine_are_lamps(parts_of):
    """Two quads side by side in the texture, the right half of which shines, and the same repeated to the right."""
    quads = {
        "POSITION": [[x + dx, 0, y] for x in (0, 1, 2, 3) for dx in (0, 1) for y in (0, 1)],
        "TEXCOORD_0": [[(x + dx) / 2, y] for x in (0, 1, 2, 3) for dx in (0.2, 0.8) for y in (0.2, 0.8)],
    }
    faces = [[4 * q + i for i in triangle] for q in range(4) for triangle in ((0, 1, 2), (2, 1, 3))]
    picture = np.zeros((16, 32, 3))
    picture[:, 16:] = 255
    document = gltf_document(
        quads, faces, surface(emissiveFactor=[1, 1, 1], emissiveTexture={"index": 0}), [png(picture)]
    )
    (part,) = parts_of(document)
    bright, dark = split_emissive(SyntheticPart(part.mesh, part.material))
    assert sorted(set(bright.geometry.faces.ravel() // 4)) == [1, 3]
    assert sorted(set(dark.geometry.faces.ravel() // 4)) == [0, 2]
    assert "emitter" in bright.material.plugins()
    assert "emitter" not in dark.material.plugins()


def test_grey_images_of_16_bits_keep_their_values(parts_of):
    stream = io.BytesIO()
    Image.fromarray(np.full((2, 2), 0x8000, np.uint16)).save(stream, "png")
    info = {"metallicRoughnessTexture": {"index": 0}}
    (part,) = parts_of(gltf_document(material={"pbrMetallicRoughness": info}, images=[stream.getvalue()]))
    assert part.material.roughness == pytest.approx(0.5, abs=0.005)


@pytest.fixture(scope="module", params=["WaterBottle", "Avocado", "FlightHelmet"])
def real_asset(request, shared_data):
    path = shared_data / "objects" / request.param / f"{request.param}.gltf"
    return request.param, read_mesh_file(path, with_materials=True)


def test_real_assets_have_their_size_and_materials(real_asset):
    name, found = real_asset
    size, parts = {
        "WaterBottle": ((0.1089, 0.1089, 0.2604), 1),
        "Avocado": ((0.0426, 0.0276, 0.0629), 1),
        "FlightHelmet": ((0.3666, 0.3715, 0.7160), 6),
    }[name]
    vertices = np.concatenate([part.mesh.vertices for part in found])
    np.testing.assert_allclose(np.ptp(vertices, axis=0), size, atol=2e-4)
    assert len(found) == parts
    assert all(isinstance(part.material, Principled) and part.material.normal_map is not None for part in found)


def test_real_assets_render(mi, real_asset):
    """In a white room each reflects less than arrives, and no point of it is black or broken."""
    from lightdepth.kernel.shapes import synthetic_shapes
    from tests.scene.tracing import radiance

    name, found = real_asset
    parts = tuple(piece for part in found for piece in split_mirrored(SyntheticPart(part.mesh, part.material)))
    shapes = [s for _, s in synthetic_shapes(Scene(panorama=None, synthetic=(SyntheticObject(name, parts),))).numbered]
    vertices = np.concatenate([part.mesh.vertices for part in found])
    centre, reach = vertices.mean(0), np.ptp(vertices, axis=0).max()
    angles = np.linspace(0, 2 * np.pi, 32, endpoint=False)
    around = np.stack([np.cos(angles), np.sin(angles), 0.3 * np.sin(3 * angles)], 1)
    colours = radiance(shapes, centre + 3 * reach * around, -around, samples=64, depth=4)
    assert np.isfinite(colours).all()
    assert (colours.mean(axis=1) < 1.02).all()
    assert np.median(colours) > 0.02
