"""Writes small glTF files."""

import base64
import io
import json
import struct

import numpy as np
import pytest
from PIL import Image


def png(pixels):
    """PNG bytes of an array of 8-bit pixels."""
    stream = io.BytesIO()
    Image.fromarray(np.asarray(pixels, dtype=np.uint8)).save(stream, "png")
    return stream.getvalue()


def data_uri(data):
    return "data:application/octet-stream;base64," + base64.b64encode(data).decode()


QUAD = {
    "POSITION": [[-1, 0, 1], [1, 0, 1], [1, 0, -1], [-1, 0, -1]],  # in the plane y = 0, that is z = 0 after the turn
    "NORMAL": [[0, 1, 0]] * 4,
    "TEXCOORD_0": [[0, 1], [1, 1], [1, 0], [0, 0]],
}
QUAD_FACES = [[0, 1, 2], [0, 2, 3]]


def gltf_document(attributes=QUAD, faces=QUAD_FACES, material=None, images=(), nodes=None, samplers=(), **more):
    """JSON of a glTF file with one mesh; `images` are PNG bytes, texture number i shows image number i."""
    views, accessors, data = [], [], b""

    def accessor(values, kind):
        nonlocal data
        component = {"f": 5126, "I": 5125, "B": 5121}[values.dtype.char]
        entry = {"bufferView": len(views), "componentType": component, "count": len(values), "type": kind}
        if component == 5121:
            entry["normalized"] = True
        accessors.append(entry)
        views.append({"buffer": 0, "byteOffset": len(data), "byteLength": values.nbytes})
        data += values.tobytes() + b"\0" * (-values.nbytes % 4)
        return len(accessors) - 1

    kinds = {1: "SCALAR", 2: "VEC2", 3: "VEC3", 4: "VEC4"}
    primitive = {"attributes": {}, "indices": accessor(np.asarray(faces, np.uint32).reshape(-1), "SCALAR")}
    for name, values in attributes.items():
        array = values if isinstance(values, np.ndarray) else np.asarray(values, np.float32)
        primitive["attributes"][name] = accessor(array, kinds[array.shape[1]])
    if material is not None:
        primitive["material"] = 0
    return {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": nodes or [{"mesh": 0}],
        "meshes": [{"primitives": [primitive]}],
        "materials": [material] if material is not None else [],
        "textures": [{"source": i, **({"sampler": 0} if samplers else {})} for i in range(len(images))],
        "images": [{"uri": data_uri(image)} for image in images],
        "samplers": list(samplers),
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{"byteLength": len(data), "uri": data_uri(data)}],
        **more,
    }


def add_accessor(document, values, kind):
    """Adds numbers to a document, in a buffer of their own; the number of their accessor."""
    array = np.ascontiguousarray(values)
    component = {"f": 5126, "h": 5122, "B": 5121}[array.dtype.char]
    document["buffers"].append({"byteLength": array.nbytes, "uri": data_uri(array.tobytes())})
    document["bufferViews"].append({"buffer": len(document["buffers"]) - 1, "byteLength": array.nbytes})
    count = array.size // {"SCALAR": 1, "VEC3": 3, "VEC4": 4, "MAT4": 16}[kind]
    entry = {"bufferView": len(document["bufferViews"]) - 1, "componentType": component, "count": count, "type": kind}
    if component != 5126:
        entry["normalized"] = True
    document["accessors"].append(entry)
    return len(document["accessors"]) - 1


def add_animation(document, name, *tracks):
    """Adds an animation; a track is (node, path, interpolation, times, values)."""
    animation = {"channels": [], "samplers": []}
    if name:
        animation["name"] = name
    for node, path, interpolation, times, values in tracks:
        values = np.asarray(values)
        values = values if values.dtype == np.int16 else values.astype(np.float32)
        kind = {"rotation": "VEC4", "weights": "SCALAR"}.get(path, "VEC3")
        sampler = {
            "input": add_accessor(document, np.asarray(times, np.float32), "SCALAR"),
            "output": add_accessor(document, values, kind),
            "interpolation": interpolation,
        }
        animation["channels"].append({"sampler": len(animation["samplers"]), "target": {"node": node, "path": path}})
        animation["samplers"].append(sampler)
    document.setdefault("animations", []).append(animation)
    return document


def write_glb(path, document):
    """The document as a .glb with its buffer in the binary chunk."""
    uri = document["buffers"][0].pop("uri")
    binary = base64.b64decode(uri.partition(",")[2])
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


def with_draco(colors=None):
    """The quad of the writer, its primitive compressed, without uncompressed data."""
    draco = pytest.importorskip("DracoPy")
    attributes = QUAD if colors is None else {**QUAD, "COLOR_0": colors}
    document = gltf_document(attributes)
    data = draco.encode(
        np.array(QUAD["POSITION"], np.float32), np.array(QUAD_FACES, np.uint32), quantization_bits=16,
        tex_coord=np.array(QUAD["TEXCOORD_0"], np.float64), normals=np.array(QUAD["NORMAL"], np.float64),
        colors=colors,
    )  # fmt: skip
    kinds = {"NORMAL": 1, "COLOR_0": 2, "TEXCOORD_0": 3, "POSITION": 0}
    ids = {a["attribute_type"]: a["unique_id"] for a in draco.decode(data).attributes}
    primitive = document["meshes"][0]["primitives"][0]
    used = {name: ids[kinds[name]] for name in primitive["attributes"]}
    primitive["extensions"] = {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": used}}
    for accessor in document["accessors"]:
        del accessor["bufferView"]
    document["bufferViews"] = [{"buffer": 0, "byteLength": len(data)}]
    document["buffers"] = [{"byteLength": len(data), "uri": data_uri(data)}]
    document["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    return document


def with_meshopt(extension="EXT_meshopt_compression"):
    """The quad of the writer, its buffer views compressed, without uncompressed data."""
    encoder = pytest.importorskip("meshoptimizer")
    document = gltf_document()
    raw = base64.b64decode(document["buffers"][0]["uri"].partition(",")[2])
    packed = b""
    for number, view in enumerate(document["bufferViews"]):
        data = raw[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
        if number == 0:
            stride, encoded = 4, encoder.encode_index_buffer(np.frombuffer(data, "<u4"), 6, 4)
        else:
            stride = len(data) // 4
            encoded = encoder.encode_vertex_buffer(np.frombuffer(data, "<f4").reshape(4, -1), 4, stride)
        how = {
            "buffer": 1, "byteOffset": len(packed), "byteLength": len(encoded), "byteStride": stride,
            "count": len(data) // stride, "mode": "ATTRIBUTES" if number else "TRIANGLES",
        }  # fmt: skip
        view["extensions"] = {extension: how}
        packed += encoded
    document["buffers"] = [{"byteLength": len(raw)}, {"byteLength": len(packed), "uri": data_uri(packed)}]
    document["extensionsRequired"] = [extension]
    return document
