"""Sound files of every format, small, and what reads them."""

import contextlib
import io
import json
import struct
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageCms

from lightdepth.capture.response import save_response, srgb_response
from lightdepth.images.exr import ExrPart, write_exr
from lightdepth.images.radiance import write_radiance
from lightdepth.images.stmap import write_stmap
from tests.scene.gltf_writer import gltf_document, with_draco, with_meshopt
from tests.support.dng import write_dng

FAULTS = Path(__file__).parents[1] / "faults"


@dataclass(frozen=True)
class Seed:
    """A file.

    Attributes:
        name: of the seed.
        kind: what reads it, one of `readers.READERS`.
        file: what it is called.
        content: its bytes.
        beside: files that it names, by name.
    """

    name: str
    kind: str
    file: str
    content: bytes
    beside: dict = field(default_factory=dict)


def seeds():
    """All seeds."""
    return [
        *_meshes(),
        *_usd(),
        *_images(),
        *_depths(),
        *_points(),
        *_instances(),
        *_scenes(),
        *_captures(),
        *_others(),
    ]


MESHES = [
    "x1-quads/quads_uv.obj", "x1-quads/two_materials.obj", "19-vcolor/float.obj", "20-relative/blocks.obj",
    "x9-blender-exports/cube.obj", "04-concave/notch.obj", "31-names/mat_cp1252.obj",
    "08-mixed/quad_tri_little.ply", "x9-blender-exports/sphere.ply", "18-colour/float.ply", "18-colour/ushort_wrap.ply",
    "18-colour/wedge.ply", "x7-stl/tail.stl", "09-specgloss/factor.gltf", "10-sparse/over.gltf", "16-skin/joint_scale.gltf",
    "17-instancing/used.gltf", "11-required/visibility_required.gltf", "21-texture/KHR_texture_basisu_no_fallback.gltf",
    "30-default/unlit.gltf", "x9-blender-exports/cube.glb",
]  # fmt: skip


def _meshes():
    for name in MESHES:
        path = FAULTS / name
        beside = {p.name: p.read_bytes() for p in path.parent.iterdir() if p.suffix in (".mtl", ".png")}
        yield Seed(name, "mesh", "mutant" + path.suffix, path.read_bytes(), beside)
    obj = b"mtllib mutant.mtl\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n"
    mtl = (
        b"newmtl m\nKd 0.8 0.1 0.1\nKs 0.5 0.5 0.5\nNs 100\nd 0.5\nTr 0.5\nKe 0 1 0\nPr 0.5\nPm 0.5\n"
        b"map_Kd -s 1 2 1 -o 0.5 0 0 -mm 0 1 -clamp on t.png\nmap_d t.png\nmap_Bump -bm 0.5 t.png\n"
    )
    yield Seed("mtl", "material", "mutant.mtl", mtl, {"a.obj": obj, "t.png": _encoded("PNG", np.full((4, 4, 4), 99))})
    facet = b"facet normal 0 0 1\n outer loop\n  vertex 0 0 0\n  vertex 1 0 0\n  vertex 0 1 0\n endloop\nendfacet\n"
    for name, make in (("draco", with_draco), ("meshopt", with_meshopt), ("ktx2", _with_ktx2)):
        with contextlib.suppress(pytest.skip.Exception):  # The package that encodes it is not installed.
            yield Seed(f"{name} gltf", "mesh", "mutant.gltf", json.dumps(make()).encode())
    yield Seed("ascii stl", "mesh", "mutant.stl", b"solid a\n" + facet * 2 + b"endsolid a\n")
    strips = b"".join(np.array(v, ">i4").tobytes() for v in ([5, 0, 1, 2, -1, 2],))
    head = (
        b"ply\nformat binary_big_endian 1.0\nelement vertex 3\nproperty double x\nproperty float y\nproperty short z\n"
    )
    head += b"element tristrips 1\nproperty list int int vertex_indices\nend_header\n"
    rows = np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0)], [("x", ">f8"), ("y", ">f4"), ("z", ">i2")])
    yield Seed("big-endian ply", "mesh", "mutant.ply", head + rows.tobytes() + strips)


def _usd():
    """As text only: of binary files, USD's own library takes as much memory as a damaged array claims to need."""
    try:
        import pxr  # noqa: F401
    except ImportError:
        return
    text = (
        '#usda 1.0\n(\n    upAxis = "Z"\n    metersPerUnit = 0.01\n)\ndef Mesh "a"\n{\n    int[] faceVertexCounts = [4]\n'
        "    int[] faceVertexIndices = [0, 1, 2, 3]\n    point3f[] points = [(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0)]\n"
        '    double3 xformOp:translate = (1, 2, 3)\n    uniform token[] xformOpOrder = ["xformOp:translate"]\n}\n'
    )
    yield Seed("mesh.usda", "mesh", "mutant.usda", text.encode())


def _with_ktx2():
    """A textured quad."""
    data = (Path(__file__).parents[1] / "scene/data/quadrants_etc1s.ktx2").read_bytes()
    document = gltf_document(material={"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}, images=[data])
    document["textures"] = [{"extensions": {"KHR_texture_basisu": {"source": 0}}}]
    # In a buffer, where its bytes are damaged as well.
    document["buffers"].append({"byteLength": len(data), "uri": document["images"][0]["uri"]})
    document["bufferViews"].append({"buffer": 1, "byteLength": len(data)})
    document["images"] = [{"bufferView": len(document["bufferViews"]) - 1, "mimeType": "image/ktx2"}]
    return document


def _encoded(kind, pixels, dtype=np.uint8, **options):
    stream = io.BytesIO()
    Image.fromarray(np.asarray(pixels).astype(dtype)).save(stream, kind, **options)
    return stream.getvalue()


def _written(name, write):
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder) / name)
        return (Path(folder) / name).read_bytes()


def _images():
    radiance = np.linspace(0.0, 4.0, 8 * 16 * 3, dtype=np.float32).reshape(8, 16, 3)
    for suffix in (".exr", ".hdr"):
        yield Seed(
            f"image{suffix}", "image", f"mutant{suffix}",
            _written(f"a{suffix}", lambda path: write_radiance(path, radiance)),
        )  # fmt: skip
    channels = {name: radiance[..., index] for index, name in enumerate("RGB")}
    parts = [
        ExrPart({"Z": radiance[..., 0]}, "depth"),
        ExrPart(channels, "beauty", {"colorInteropID": "lin_ap1_scene"}),
    ]
    yield Seed("parts.exr", "image", "mutant.exr", _written("a.exr", lambda path: write_exr(path, parts)))
    flat = b"#?RADIANCE\nEXPOSURE=2\nCOLORCORR=1 2 1\nPRIMARIES=.64 .33 .29 .60 .15 .06 .3127 .3290\nGAMMA=1\n"
    flat += b"FORMAT=32-bit_rle_rgbe\n\n+X 8 -Y 4\n" + bytes([9, 8, 7, 130] * 30 + [1, 1, 1, 2])
    yield Seed("old.hdr", "image", "mutant.hdr", flat)
    exif = Image.Exif()
    exif[274], exif[34665] = 1, {33434: 0.01}  # Orientation, and exposure among the EXIF tags proper.
    box = b'<rdf:Description xmlns:GPano="http://ns.google.com/photos/1.0/panorama/" GPano:PoseHeadingDegrees="30"/>'
    grey = np.full((16, 32, 3), 120)
    for kind, suffix in (("JPEG", ".jpg"), ("TIFF", ".tif"), ("PNG", ".png")):
        more = {"xmp": box, "exif": exif} if kind == "JPEG" else {}
        yield Seed(f"panorama{suffix}", "panorama", f"mutant{suffix}", _encoded(kind, grey, **more))
    profile = ImageCms.ImageCmsProfile(ImageCms.createProfile("sRGB")).tobytes()
    yield Seed("profile.jpg", "panorama", "mutant.jpg", _encoded("JPEG", grey, icc_profile=profile))
    ramp = np.tile(np.arange(32, dtype=np.uint16) * 2000, (16, 1))
    yield Seed("panorama 16.png", "panorama", "mutant.png", _encoded("PNG", ramp, np.uint16))
    yield Seed("panorama float.tif", "panorama", "mutant.tif", _encoded("TIFF", ramp / 9000, np.float32))
    with contextlib.suppress(ImportError):
        import pillow_heif

        pillow_heif.register_heif_opener()
        yield Seed("panorama.heic", "panorama", "mutant.heic", _encoded("HEIF", np.full((64, 128, 3), 120)))
    yield Seed("texture.png", "texture", "mutant.png", _encoded("PNG", np.arange(256).reshape(16, 16)))
    yield Seed("texture 16.png", "texture", "mutant.png", _encoded("PNG", np.arange(256).reshape(16, 16), np.uint16))
    yield Seed("texture.jpg", "texture", "mutant.jpg", _encoded("JPEG", np.arange(256).reshape(16, 16)))
    yield Seed("texture.tif", "texture", "mutant.tif", _encoded("TIFF", np.arange(256).reshape(16, 16)))


def _depths():
    depth = np.linspace(1.0, 4.0, 8 * 16, dtype=np.float32).reshape(8, 16)
    yield Seed("depth.exr", "depth", "mutant.exr", _written("a.exr", lambda p: write_exr(p, [ExrPart({"Z": depth})])))
    yield Seed("depth.npy", "depth", "mutant.npy", _written("a.npy", lambda path: np.save(path, depth)))
    yield Seed("depth.png", "depth", "mutant.png", _encoded("PNG", depth * 1000, np.uint16))


def _points():
    points = np.random.default_rng(1).uniform(-1.0, 1.0, (120, 3))
    text = "\n".join(" ".join(f"{v:.4f}" for v in row) for row in points)
    yield Seed("points.xyz", "points", "mutant.xyz", text.encode())
    yield Seed("points.csv", "points", "mutant.csv", ("x,y,z\n" + text.replace(" ", ",")).encode())
    yield Seed("points.pts", "points", "mutant.pts", (f"{len(points)}\n" + text).encode())
    head = (
        f"ply\nformat ascii 1.0\nelement vertex {len(points)}\nproperty float x\nproperty float y\nproperty float z\n"
    )
    yield Seed("points.ply", "points", "mutant.ply", (head + "end_header\n" + text + "\n").encode())
    try:
        import laspy
    except ImportError:
        return
    cloud = laspy.LasData(laspy.LasHeader(point_format=0, version="1.2"))
    cloud.x, cloud.y, cloud.z = points.T
    yield Seed("points.las", "points", "mutant.las", _written("a.las", lambda path: cloud.write(path)))
    if laspy.LazBackend.detect_available():
        yield Seed("points.laz", "points", "mutant.laz", _written("a.laz", lambda path: cloud.write(path)))
    with contextlib.suppress(ImportError):
        import pye57

        def write(path):
            file = pye57.E57(str(path), mode="w")
            file.write_scan_raw({f"cartesian{axis}": points[:, i] for i, axis in enumerate("XYZ")})
            file.close()

        yield Seed("points.e57", "points", "mutant.e57", _written("a.e57", write))


def _instances():
    stream = io.BytesIO()
    np.save(stream, np.tile(np.eye(4, dtype=np.float32)[:3], (3, 1, 1)))
    yield Seed("instances", "instances", "mutant.npy", stream.getvalue())


def _scenes():
    text = (
        '[panorama]\nimage = "p.exr"\nposition = [0, 0, 1.5]\nrotation = [0.0, 0.0, 12.5]\nscale = 1.0\n'
        '[[real]]\nname = "floor"\nmesh = "f.ply"\nrole = "support"\ngloss = { roughness = 0.2, specular = 0.5 }\n'
        '[[synthetic]]\nname = "ball"\nshape = "sphere"\ncenter = [0, 2, 0.4]\nradius = 0.4\n'
        'material = { type = "principled", base_color = [0.8, 0.2, 0.2], roughness = 0.4 }\n'
        '[[synthetic]]\nname = "a"\nmesh = "f.ply"\nscale = [1, 2, 3]\nmaterial = { type = "metal", name = "Ag" }\n'
        '[[synthetic]]\nname = "b"\nshape = "cube"\nmaterial = { mitsuba = { type = "diffuse" } }\n'
        '[camera.view]\ntype = "perspective"\nwidth = 32\nheight = 16\nfov = 60\nlook_at = [0.3, 1.5, 0.5]\n'
        '[camera.dome]\ntype = "fisheye"\nwidth = 16\nmapping = "equisolid"\n[render]\nsamples = 4\nnoise = 0.02\n'
    )
    picture = np.full((4, 8, 3), 0.5, np.float32)
    floor = (FAULTS / "18-colour/float.ply").read_bytes()
    beside = {"p.exr": _written("p.exr", lambda path: write_radiance(path, picture)), "f.ply": floor}
    yield Seed("scene.toml", "scene", "mutant.toml", text.encode(), beside)
    yield Seed("changed.toml", "document", "mutant.toml", text.encode())


BRACKETS = {"raw": "02-rawmax/080_*.dng", "jpeg": "24-orient/o2_*.jpg"}
"""Exposures of one view, by EXIF."""


def _captures():
    """Photographs alone, one of a bracket whose others are sound, a table of exposures, and a camera's response."""
    raw = FAULTS / "02-rawmax/080_middle.dng"
    photograph = FAULTS / "24-orient/o2_1.jpg"
    try:
        import exifread  # noqa: F401
        import rawpy  # noqa: F401
    except ImportError:
        pass
    else:
        yield Seed("photograph.dng", "photograph", "mutant.dng", raw.read_bytes())
        linear = np.full((32, 48, 3), 3000)
        colours = np.array([[0.6, 0.3, 0.1], [0.2, 0.7, 0.1], [0.1, 0.2, 0.7]])
        content = _written(
            "a.dng", lambda path: write_dng(path, linear, [64] * 3, 16000, (0.5, 1, 0.7), colours=colours)
        )
        yield Seed("linear.dng", "photograph", "mutant.dng", content)
        yield Seed("photograph.jpg", "photograph", "mutant.jpg", photograph.read_bytes())
        for name, pattern in BRACKETS.items():
            first, *others = sorted(FAULTS.glob(pattern))
            beside = {path.name: path.read_bytes() for path in others}
            yield Seed(f"bracket {name}", "bracket", "mutant" + first.suffix, first.read_bytes(), beside)
    table = b"file,time,aperture,iso\na.jpg,1/60,8,100\nb.jpg,0.25,8,100\nc.jpg,2,5.6,200\n"
    yield Seed("exposures.csv", "exposures", "mutant.csv", table)
    response = _written("a.json", lambda path: save_response(path, srgb_response()))
    yield Seed("response.json", "response", "mutant.json", response)


def _others():
    """A tripod head's orientations, a lens's ST map, and a project of fSpy."""
    yield Seed("rig.txt", "rig", "mutant.txt", b"0,0 72,0 144,0 216,0\n288,0 0,90 0,-90,5\n")
    film = np.stack(np.meshgrid(np.linspace(0.02, 0.98, 16), np.linspace(0.02, 0.98, 8)), axis=-1)
    yield Seed("stmap.exr", "stmap", "mutant.exr", _written("a.exr", lambda path: write_stmap(path, film)))
    state = json.dumps(_fspy_state()).encode()
    yield Seed("view.fspy", "fspy", "mutant.fspy", struct.pack("<4sIII", b"fspy", 1, len(state), 2) + state + b"xx")


def _fspy_state():
    """A picture with two vanishing points and a known length."""

    def segments(*ends):
        return {"lineSegments": [[{"x": x, "y": y} for x, y in pair] for pair in ends]}

    return {
        "globalSettings": {"calibrationMode": "TwoVanishingPoints"},
        "calibrationSettingsBase": {
            "firstVanishingPointAxis": "xPositive", "secondVanishingPointAxis": "yPositive",
            "referenceDistanceAxis": "xPositive", "referenceDistance": 2, "referenceDistanceUnit": "Meters",
        },
        "calibrationSettings2VP": {"quadModeEnabled": False, "principalPointMode": "Manual"},
        "controlPointsStateBase": {
            "principalPoint": {"x": 0.5, "y": 0.5}, "origin": {"x": 0.5, "y": 0.7},
            "referenceDistanceHandleOffsets": [0.1, 0.3],
            "firstVanishingPoint": segments(((0.2, 0.2), (0.4, 0.3)), ((0.2, 0.8), (0.4, 0.7))),
        },
        "controlPointsState2VP": {
            "secondVanishingPoint": segments(((0.8, 0.2), (0.6, 0.3)), ((0.8, 0.8), (0.6, 0.7))),
        },
    }  # fmt: skip
