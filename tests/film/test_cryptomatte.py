"""Mattes: hashes against published values, coverage against closed forms, files against another program's reader."""

import json
from dataclasses import replace

import numpy as np
import OpenEXR
import pytest
import trimesh
from trimesh.visual import TextureVisuals
from trimesh.visual.material import PBRMaterial

from lightdepth.kernel.start import start

start("cpu")

import lightdepth  # noqa: E402
from lightdepth.cameras import Perspective, Viewpoint  # noqa: E402
from lightdepth.film.cryptomatte import Mattes, matte_channels, matte_id, murmur3, shape_names  # noqa: E402
from lightdepth.film.layers import write_frame  # noqa: E402
from lightdepth.images.radiance import write_radiance  # noqa: E402
from lightdepth.scene.materials import Diffuse  # noqa: E402
from lightdepth.scene.model import Role, SyntheticObject, SyntheticPart  # noqa: E402
from tests.film.test_selection import box  # noqa: E402
from tests.support.picture_file import undocumented  # noqa: E402
from tests.transport.places import CAPTURE, GREY, WHITE, ball, room  # noqa: E402

WIDTH, HEIGHT = 90, 60


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("", 0),
        ("a", 0x3C2569B2),
        ("test", 0xBA6BD213),
        ("Hello, world!", 0xC0363E43),
        ("The quick brown fox jumps over the lazy dog", 0x2E4FF723),
    ],
)
def test_murmur_hash(text, value):
    """The values that the reference implementation gives with the seed 0."""
    assert murmur3(text.encode()) == value


def test_ids_are_ordinary_floats():
    ids = np.array([matte_id(f"thing {index}") for index in range(4000)], np.uint32)
    values = ids.view(np.float32)
    assert np.isfinite(values).all()
    assert (np.abs(values) >= np.finfo(np.float32).tiny).all()
    assert any(murmur3(f"thing {index}".encode()) != ids[index] for index in range(4000))


def test_coverage_is_ranked_and_names_count_once():
    mattes = Mattes(
        np.array([3, 3, 3, 7], np.uint32),
        np.array([0, 1, 2, 1], np.uint32),
        np.array([0.25, 0.25, 0.4, 1.0], np.float32),
        ("vase", "vase", "ball"),
        ("vase.glass", "vase.metal", "ball.metal"),
    )
    channels, header = matte_channels(mattes, "CryptoObject", mattes.objects, (2, 5))
    assert list(channels) == [f"CryptoObject00.{letter}" for letter in "RGBA"]
    first, share, second, less = (plane.reshape(-1) for plane in channels.values())
    vase, ball_id = np.array([matte_id("vase"), matte_id("ball")], np.uint32).view(np.float32)
    assert first[[3, 7]].tolist() == [vase, vase]
    np.testing.assert_allclose(share[[3, 7]], [0.5, 1.0])
    assert second[3] == ball_id
    assert less[3] == pytest.approx(0.4)
    assert np.count_nonzero(share) == 2
    (manifest,) = (value for name, value in header.items() if name.endswith("/manifest"))
    assert json.loads(manifest) == {"vase": f"{matte_id('vase'):08x}", "ball": f"{matte_id('ball'):08x}"}
    # The pixel's largest part decides, that of none included.
    assert mattes.dominant(10, [0, 0, 1]).tolist() == [0, 0, 0, 1, 0, 0, 0, 1, 0, 0]
    lone = Mattes(
        np.array([0, 1], np.uint32),
        np.array([2, 2], np.uint32),
        np.float32([0.4, 0.6]),
        mattes.objects,
        mattes.materials,
    )
    assert lone.dominant(2, [0, 0, 1]).tolist() == [0, 2]


def test_materials_are_named_after_their_objects():
    other = Diffuse(type="diffuse", color=(0.1, 0.2, 0.3))
    geometry = ball(GREY).parts[0].geometry
    parts = tuple(SyntheticPart(geometry, material) for material in (GREY, other, GREY))
    names = shape_names([SyntheticObject("lamp", parts), ball(WHITE)])
    assert names == (("lamp",) * 3 + ("ball",), ("lamp.diffuse", "lamp.diffuse.2", "lamp.diffuse", "ball.diffuse"))


def test_materials_of_a_mesh_file_keep_its_names(tmp_path):
    floor = trimesh.creation.box((1, 1, 0.1))
    named, unnamed = (PBRMaterial(name=name, baseColorFactor=[80, 90, 99, 255]) for name in ("Leather", None))
    parts = [trimesh.Trimesh(floor.vertices, floor.faces, visual=TextureVisuals(material=m)) for m in (named, unnamed)]
    trimesh.Scene(parts).export(tmp_path / "hat.glb")
    (tmp_path / "hat.obj").write_text("mtllib hat.mtl\nusemtl Felt\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (tmp_path / "hat.mtl").write_text("newmtl Felt\nKd 0.5 0.5 0.5\n")
    write_radiance(tmp_path / "p.exr", np.ones((8, 16, 3), np.float32))
    text = '[panorama]\nimage = "p.exr"\nsky = true\n[[real]]\nname = "floor"\nmesh = "hat.glb"\nrole = "support"\n'
    for name, keys in (
        ("glb", ""),
        ("obj", ""),
        ("grey", 'material = { type = "diffuse", color = [0.5, 0.5, 0.5] }'),
    ):
        mesh = "hat.obj" if name == "obj" else "hat.glb"
        text += f'[[synthetic]]\nname = "{name}"\nmesh = "{mesh}"\n{keys}\n'
    (tmp_path / "s.toml").write_text(text + '[camera.c]\ntype = "equirectangular"\nwidth = 16\n')
    materials = shape_names(lightdepth.load_scene(tmp_path / "s.toml").synthetic)[1]
    assert materials == ("glb.Leather", "glb.material_1", "obj.Felt", "grey.diffuse", "grey.diffuse")


@pytest.fixture(scope="module")
def frame():
    """A card whose left edge is slanted over the picture, with a ball before it, and a wire thinner than pixels."""
    card = replace(box((0.5, 2.0, 0.0), (1.0, 0.002, 8.0), turn=(0, 7, 0)), name="card")
    near = replace(ball(WHITE, (0.2, 1.0, 0.05), 0.15), name="Kugel groß")
    wire = replace(box((-0.5, 1.5, 0.0), (0.004, 0.004, 8.0)), name="wire")
    moved = [_moved(thing) for thing in (card, near, wire)]
    scene = room(1.0, moved, role=Role.ENVIRONMENT)
    scene.cameras["front"] = Viewpoint(
        Perspective(type="perspective", width=WIDTH, height=HEIGHT, fov=50), CAPTURE, np.eye(3)
    )
    return lightdepth.render(scene, "front", samples=64, seed=2)


def _moved(thing):
    (part,) = thing.parts
    to_world = part.geometry.to_world.copy()
    to_world[:3, 3] += CAPTURE
    return replace(thing, parts=(replace(part, geometry=replace(part.geometry, to_world=to_world)),))


def test_coverage_is_that_of_the_picture(frame):
    mattes = frame.mattes
    total = np.bincount(mattes.pixels, mattes.shares, frame.coverage.size).reshape(frame.coverage.shape)
    assert np.abs(total - frame.coverage).max() < 0.25  # 64 random samples a pixel there, 32 even ones here.
    assert np.sqrt(np.mean((total - frame.coverage)[(total > 0) & (total < 1)] ** 2)) < 0.06
    assert total.mean() == pytest.approx(frame.coverage.mean(), rel=0.005)


def test_object_id_is_what_covers_most_of_a_pixel(frame):
    assert ((frame.object_id > 0) == (frame.coverage > 0.5))[np.abs(frame.coverage - 0.5) > 0.12].all()
    assert set(np.unique(frame.object_id)) == {0, 1, 2}  # The wire covers no pixel by half.
    assert set(np.unique(frame.mattes.shapes)) == {0, 1, 2}


def test_another_program_reads_the_mattes(frame, tmp_path):
    cryptomatte = pytest.importorskip("cryptomatte_api", reason="cryptomatte-api is not installed")
    path = tmp_path / "picture.exr"
    write_frame(path, frame)
    found = {str(matte.metadata().name()): matte for matte in cryptomatte.Cryptomatte.load(str(path))}
    assert set(found) == {"CryptoObject", "CryptoMaterial"}
    for layer, names in (("CryptoObject", frame.mattes.objects), ("CryptoMaterial", frame.mattes.materials)):
        masks = found[layer].masks()
        assert set(masks) == set(names)
        for shape, name in enumerate(names):
            chosen = frame.mattes.shapes == shape
            expected = np.bincount(frame.mattes.pixels[chosen], frame.mattes.shares[chosen], frame.coverage.size)
            np.testing.assert_allclose(np.reshape(masks[name], -1), expected, atol=1e-6)


def test_the_header_says_how_to_read_them(frame, tmp_path):
    write_frame(tmp_path / "picture.exr", frame, layers=["cryptomatte"])
    assert undocumented(tmp_path / "picture.exr") == set()
    with OpenEXR.File(str(tmp_path / "picture.exr"), separate_channels=True) as file:
        assert [part.name() for part in file.parts] == ["beauty"]
        header, channels = dict(file.parts[0].header), list(file.parts[0].channels)
    key = f"cryptomatte/{murmur3(b'CryptoObject'):08x}"[: len("cryptomatte/") + 7]
    assert header[f"{key}/name"] == "CryptoObject"
    assert header[f"{key}/conversion"] == "uint32_to_float32"
    assert header[f"{key}/hash"] == "MurmurHash3_32"
    assert set(json.loads(header[f"{key}/manifest"])) == {"card", "Kugel groß", "wire"}
    assert {f"{layer}00.{letter}" for layer in ("CryptoObject", "CryptoMaterial") for letter in "RGBA"} <= set(channels)
    assert {"R", "G", "B", "A"} <= set(channels)


def test_nothing_is_written_of_a_picture_without_objects(tmp_path):
    frame = lightdepth.render(room(1.0, [], role=Role.ENVIRONMENT), "view", samples=1)
    write_frame(tmp_path / "picture.exr", frame)
    with OpenEXR.File(str(tmp_path / "picture.exr"), separate_channels=True) as file:
        assert sorted(file.parts[0].channels) == ["A", "B", "G", "R"]
        assert not [name for name in file.parts[0].header if name.startswith("cryptomatte")]
