"""The extension's parts that need no Blender: processes, OpenEXR, TOML."""

import importlib.util
import tomllib
from pathlib import Path

import numpy as np
import pytest

from lightdepth.images.exr import ExrPart, write_exr

EXTENSION = Path(__file__).parents[2] / "blender/extension"


def _load(name: str):
    specification = importlib.util.spec_from_file_location(f"lightdepth_extension_{name}", EXTENSION / f"{name}.py")
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


@pytest.mark.parametrize("shape", [(40, 23), (1, 1), (16, 64), (17, 3)])
def test_the_renderers_files_are_read(tmp_path, shape):
    random = np.random.default_rng(3)
    noise = random.random(shape, dtype=np.float32)
    smooth = np.broadcast_to(np.linspace(0, 1, shape[1], dtype=np.float32), shape)
    first = {"R": noise, "G": smooth, "B": np.full(shape, np.inf, np.float32), "A": np.ones(shape, np.float32)}
    numbers = random.integers(0, 2**32, shape, dtype=np.uint32)
    parts = [
        ExrPart(first, "beauty"),
        ExrPart({"X": smooth.astype(np.float16)}, "normal"),
        ExrPart({"id": numbers}, "object_id"),
    ]
    exr = _load("exr")
    write_exr(tmp_path / "several.exr", parts)
    write_exr(tmp_path / "single.exr", parts[:1])
    for file, expected in (("several.exr", parts), ("single.exr", parts[:1])):
        read = exr.read(tmp_path / file)
        assert list(read) == [part.name for part in expected]
        for part in expected:
            for name, pixels in part.channels.items():
                np.testing.assert_array_equal(read[part.name][name], pixels)


def test_a_damaged_file_is_refused(tmp_path):
    exr = _load("exr")
    write_exr(tmp_path / "whole.exr", [ExrPart({"Y": np.random.default_rng(1).random((32, 32), np.float32)})])
    data = (tmp_path / "whole.exr").read_bytes()
    for length in (0, 3, 40, len(data) // 2):
        (tmp_path / "cut.exr").write_bytes(data[:length])
        with pytest.raises(exr.ExrError, match=r"cut\.exr"):
            exr.read(tmp_path / "cut.exr")


def test_scene_files_are_toml():
    document = {
        "panorama": {"image": 'a "b" \\ \x7f\n.exr', "position": [0.1, -0.0, 1e-9], "scale": 1.0},
        "real": [{"name": "Boden ü", "gloss": {"roughness": 0.5}}, {"name": "walls", "flag": True}],
        "camera": {"Camera.001": {"width": 64, "type": "equirectangular"}},
        "render": {"samples": 3},
    }
    assert tomllib.loads(_load("toml").dumps(document)) == document


def test_an_interrupted_renderer_writes_what_it_has(renderer, tmp_path):
    process = _load("process")
    write_exr(tmp_path / "grey.exr", [ExrPart({name: np.ones((8, 16), np.float32) for name in "RGB"})])
    (tmp_path / "floor.stl").write_text(
        "solid floor\nfacet normal 0 0 1\nouter loop\nvertex -9 -9 0\nvertex 9 -9 0\nvertex 0 9 0\n"
        "endloop\nendfacet\nendsolid\n"
    )
    (tmp_path / "scene.toml").write_text(
        '[panorama]\nimage = "grey.exr"\nposition = [0.0, 0.0, 1.6]\nsky = true\n'
        '[[real]]\nname = "floor"\nmesh = "floor.stl"\nrole = "support"\n'
        '[[synthetic]]\nname = "ball"\nshape = "sphere"\ncenter = [0.0, 2.0, 0.4]\nradius = 0.4\n'
        'material = { type = "diffuse", color = [0.5, 0.5, 0.5] }\n'
        '[camera.pano]\ntype = "equirectangular"\nwidth = 64\n'
    )
    output = tmp_path / "picture.exr"
    arguments = [
        "render",
        str(tmp_path / "scene.toml"),
        "-o",
        str(output),
        "--samples",
        "1000000",
        "--progress",
        "json",
    ]
    told = []
    with process.Rendering(str(renderer), arguments) as rendering:
        for event in rendering.events():
            if event is not None:
                told.append(event)
                if event["event"] == "progress":
                    rendering.interrupt()
    assert (told[-1]["event"], told[-1]["interrupted"]) == ("done", True)
    assert _load("exr").read(output)["beauty"]["R"].shape == (32, 64)
