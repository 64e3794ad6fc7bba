"""A small scene folder, a glTF writer, and radiance along rays by Mitsuba's own path tracer."""

import base64
import io
import json
import os
import struct
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from lightdepth.images.exr import ExrPart, write_exr
from lightdepth.kernel.start import start

TRIANGLE_PLY = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 2
property list uchar int vertex_indices
end_header
-3 -3 0
3 -3 0
3 3 0
-3 3 0
3 0 1 2
3 0 2 3
"""


@pytest.fixture(scope="session")
def mi():
    start("cpu")
    import mitsuba

    return mitsuba


@pytest.fixture
def scene_folder(tmp_path):
    """A folder with a grey panorama `p.exr` and a floor `floor.ply`."""
    write_exr(tmp_path / "p.exr", [ExrPart({c: np.full((8, 16), 0.5, np.float32) for c in "RGB"})])
    (tmp_path / "floor.ply").write_text(TRIANGLE_PLY)
    return tmp_path


@pytest.fixture
def write_scene(scene_folder):
    """Writes `scene.toml`: panorama, floor, and the text given."""

    def write(text="", panorama="", real='[[real]]\nname = "floor"\nmesh = "floor.ply"\nrole = "support"\n'):
        path = scene_folder / "scene.toml"
        path.write_text(f'[panorama]\nimage = "p.exr"\n{panorama}\n{real}\n{text}\n')
        return path

    return write


@pytest.fixture(scope="session")
def shared_objects():
    """The folder of real glTF assets."""
    chosen = os.environ.get("LIGHTDEPTH_SHARED_DATA")
    folder = Path(chosen) if chosen else Path(__file__).parents[2] / "../shared/data"
    if not (folder / "objects").is_dir():
        pytest.skip(f"the shared test data is not at {folder}; set LIGHTDEPTH_SHARED_DATA")
    return folder / "objects"


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


def write_glb(path, document):
    """The document as a .glb with its buffer in the binary chunk."""
    uri = document["buffers"][0].pop("uri")
    binary = base64.b64decode(uri.partition(",")[2])
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary
    path.write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)


def radiance(mi, shapes, origins, directions, *, environment=1.0, samples=256, depth=12, more=None):
    """Mean radiance along rays, shape (n, 3), by Mitsuba's `path` in a constant environment."""
    scene = mi.load_dict(
        {
            "type": "scene",
            "environment": {"type": "constant", "radiance": {"type": "rgb", "value": [environment] * 3}},
            **(more or {}),
            **{f"shape{i}": shape for i, shape in enumerate(shapes)},
        },
        optimize=False,
    )
    integrator = mi.load_dict({"type": "path", "max_depth": depth, "rr_depth": 1000})
    origins, directions = np.broadcast_arrays(np.atleast_2d(origins), np.atleast_2d(directions))
    directions = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    ray = mi.RayDifferential3f(
        *(
            mi.Ray3f(
                *(
                    type_(np.repeat(v, samples, axis=0).T.astype(np.float32))
                    for type_, v in ((mi.Point3f, origins), (mi.Vector3f, directions))
                )
            ),
        )
    )
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(7, len(origins) * samples)
    found = integrator.sample(scene, sampler, ray)[0]
    return np.array(found).T.reshape(len(origins), samples, 3).mean(axis=1)
