"""glTF with compressed meshes and images: what the encoders were given comes back."""

import json
from pathlib import Path

import numpy as np
import pytest

from lightdepth.errors import InputError
from lightdepth.scene.meshes import read_mesh_file
from tests.scene.gltf_writer import QUAD, data_uri, gltf_document, with_draco, with_meshopt

DATA = Path(__file__).parent / "data"


def read(tmp_path, document):
    (tmp_path / "a.gltf").write_text(json.dumps(document))
    return read_mesh_file(tmp_path / "a.gltf", with_materials=True)


def rows(mesh):
    """Corners of the faces with all that they have, sorted: compression may put vertices in another order."""
    table = np.concatenate([mesh.vertices, mesh.normals, mesh.texture_coordinates], axis=1)
    return sorted(np.round(table[mesh.faces].reshape(-1, 8), 3).tolist())


def test_draco(tmp_path):
    (plain,) = read(tmp_path, gltf_document())
    (part,) = read(tmp_path, with_draco())
    np.testing.assert_allclose(rows(part.mesh), rows(plain.mesh), atol=2e-3)
    colors = np.array([[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255], [51, 51, 51, 255]], np.uint8)
    (part,) = read(tmp_path, with_draco(colors))
    found = {tuple(np.round(c, 2)) for c in part.mesh.colors.tolist()}
    assert found == {(1, 0, 0), (0, 1, 0), (0, 0, 1), (0.2, 0.2, 0.2)}


def test_damaged_draco_is_named(tmp_path):
    document = with_draco()
    document["buffers"][0]["uri"] = data_uri(b"DRACO" + b"\xff" * (document["bufferViews"][0]["byteLength"] - 5))
    with pytest.raises(InputError, match=r"a.gltf: meshes\[0\].primitives\[0\]: its data compressed with Draco is dam"):
        read(tmp_path, document)


@pytest.mark.parametrize("extension", ["EXT_meshopt_compression", "KHR_meshopt_compression"])
def test_meshopt(tmp_path, extension):
    document = with_meshopt(extension)
    (plain,) = read(tmp_path, gltf_document())
    (part,) = read(tmp_path, document)
    assert rows(part.mesh) == rows(plain.mesh)


def test_meshopt_filters(tmp_path):
    """Octahedral normals and exponents, encoded by hand as the specification has them."""
    encoder = pytest.importorskip("meshoptimizer")
    document = gltf_document()
    # Exponent 2^-1 in the top byte, 24-bit mantissas: (-2, 0, 2) and so on are halves of the positions.
    exponents = (np.full((4, 3), -1, np.int32) << 24) | (np.array(QUAD["POSITION"], np.int32) * 2 & 0xFFFFFF)
    normals = np.tile(np.array([0, 127, 127, 0], np.int8), (4, 1))  # (x, y) of the octahedron, and its one
    packed = b""
    views = []
    for data, stride, filtering in ((exponents, 12, "EXPONENTIAL"), (normals, 4, "OCTAHEDRAL")):
        encoded = encoder.encode_vertex_buffer(np.ascontiguousarray(data), 4, stride)
        views.append(
            {
                "buffer": 0, "byteLength": 4 * stride, "byteStride": stride,
                "extensions": {"EXT_meshopt_compression": {
                    "buffer": 1, "byteOffset": len(packed), "byteLength": len(encoded), "byteStride": stride,
                    "count": 4, "mode": "ATTRIBUTES", "filter": filtering,
                }},
            }
        )  # fmt: skip
        packed += encoded
    attributes = document["meshes"][0]["primitives"][0]["attributes"]
    first = len(document["bufferViews"])
    document["bufferViews"] += views
    document["accessors"][attributes["POSITION"]]["bufferView"] = first
    document["accessors"][attributes["NORMAL"]] |= {"bufferView": first + 1, "componentType": 5120, "normalized": True}
    document["buffers"].append({"byteLength": len(packed), "uri": data_uri(packed)})
    (part,) = read(tmp_path, document)
    (plain,) = read(tmp_path, gltf_document())
    np.testing.assert_allclose(part.mesh.vertices, plain.mesh.vertices, atol=1e-6)
    np.testing.assert_allclose(part.mesh.normals, plain.mesh.normals, atol=0.01)


@pytest.mark.parametrize("bits", [8, 16])
def test_the_filter_of_colours(tmp_path, bits):
    """Luma, chroma and alpha as KHR_meshopt_compression stores them, of the colour (200, 100, 0) in 255ths."""
    encoder = pytest.importorskip("meshoptimizer")
    largest = 2**bits - 1
    red, green = round(200 / 255 * largest), round(100 / 255 * largest)
    row = [(red + 2 * green) // 4, red // 2, (2 * green - red) // 4, largest]
    stored = np.tile(np.array(row, f"<u{bits // 8}"), (4, 1))
    document = gltf_document({**QUAD, "COLOR_0": np.full((4, 4), 255, np.uint8)})
    packed = encoder.encode_vertex_buffer(stored.view(np.uint8).reshape(4, -1).copy(), 4, bits // 2)
    how = {
        "buffer": 1, "byteLength": len(packed), "byteStride": bits // 2, "count": 4, "mode": "ATTRIBUTES",
        "filter": "COLOR",
    }  # fmt: skip
    accessor = document["accessors"][document["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"]]
    accessor |= {"bufferView": len(document["bufferViews"]), "componentType": {8: 5121, 16: 5123}[bits]}
    view = {"buffer": 0, "byteLength": 4 * bits // 2, "byteStride": bits // 2}
    document["bufferViews"].append({**view, "extensions": {"KHR_meshopt_compression": how}})
    document["buffers"].append({"byteLength": len(packed), "uri": data_uri(packed)})
    (part,) = read(tmp_path, document)
    np.testing.assert_allclose(part.mesh.colors, [[200 / 255, 100 / 255, 0]] * 4, atol=2 / largest)


@pytest.mark.parametrize("codec", ["uastc", "etc1s"])
def test_ktx2_images(tmp_path, codec):
    pytest.importorskip("opengl_basisu")
    data = (DATA / f"quadrants_{codec}.ktx2").read_bytes()
    document = gltf_document(material={"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}, images=[data])
    document["textures"] = [{"extensions": {"KHR_texture_basisu": {"source": 0}}}]
    document["extensionsRequired"] = ["KHR_texture_basisu"]
    pixels = read(tmp_path, document)[0].material.base_color.pixels
    corners = [pixels[4, 4], pixels[4, 12], pixels[12, 4], pixels[12, 12]]
    np.testing.assert_allclose(corners, [[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]], atol=0.03)
    document["images"] = [{"uri": data_uri(data[:150])}]
    with pytest.raises(InputError, match=r"image 0 .* cannot be read: its KTX2 data is damaged"):
        read(tmp_path, document)


def test_packages_that_are_not_there_are_named(tmp_path, monkeypatch):
    import sys

    document = with_draco()
    monkeypatch.setitem(sys.modules, "DracoPy", None)
    with pytest.raises(InputError, match=r"compressed with Draco; the Python package 'DracoPy' is needed .*\[gltf\]"):
        read(tmp_path, document)
