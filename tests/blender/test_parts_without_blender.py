"""The extension's parts that need no Blender: processes, OpenEXR, TOML."""

import importlib
import os
import signal
import subprocess
import sys
import tomllib
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from lightdepth.images.exr import ExrPart, write_exr

EXTENSION = Path(__file__).parents[2] / "blender/extension"


PACKAGE = ModuleType("lightdepth_extension")
PACKAGE.__path__ = [str(EXTENSION)]
"""The extension without its ``__init__``, which imports Blender."""


def _load(name: str):
    sys.modules[PACKAGE.__name__] = PACKAGE
    return importlib.import_module(f"{PACKAGE.__name__}.{name}")


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


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    folder = tmp_path_factory.mktemp("scene")
    write_exr(folder / "grey.exr", [ExrPart({name: np.ones((8, 16), np.float32) for name in "RGB"})])
    (folder / "floor.stl").write_text(
        "solid floor\nfacet normal 0 0 1\nouter loop\nvertex -9 -9 0\nvertex 9 -9 0\nvertex 0 9 0\n"
        "endloop\nendfacet\nendsolid\n"
    )
    (folder / "scene.toml").write_text(
        '[panorama]\nimage = "grey.exr"\nposition = [0.0, 0.0, 1.6]\nsky = true\n'
        '[[real]]\nname = "floor"\nmesh = "floor.stl"\nrole = "support"\n'
        '[[synthetic]]\nname = "ball"\nshape = "sphere"\ncenter = [0.0, 2.0, 0.4]\nradius = 0.4\n'
        'material = { type = "diffuse", color = [0.5, 0.5, 0.5] }\n'
        '[camera.pano]\ntype = "equirectangular"\nwidth = 64\n'
    )
    return folder / "scene.toml"


@pytest.fixture
def worker():
    """The module, without a process; what a test starts is ended."""
    module = _load("worker")
    yield module
    _load("process").end_all()


def _rendered(worker, renderer, scene, output, until=None, warned=None, **options):
    """Events of a rendering that is cancelled at the first event of a kind, or when a stage begins."""
    events = []

    def cancelled():
        return until is not None and any(until in (event["event"], event.get("stage")) for event in events)

    request = {"scene": str(scene), "output": str(output), "samples": 1, "layers": [], **options}
    for event in worker.render(str(renderer), request, cancelled, [].append if warned is None else warned.append):
        events.append(event)
    return events


def _processes(renderer):
    """Process ids of the renderers that a command started, as it was asked to note them."""
    return [int(line) for line in Path(f"{renderer}.pids").read_text().split()]


@pytest.fixture
def noted(renderer, tmp_path):
    """The renderer, which notes its process id when it starts."""
    path = tmp_path / "lightdepth"
    path.write_text(f"#!/bin/sh\necho $$ >> '{path}.pids'\nexec '{renderer}' \"$@\"\n")
    path.chmod(0o755)
    return path


def test_one_renderer_goes_through_everything(worker, noted, scene, tmp_path):
    read = _load("exr").read
    kept = []
    for number, options in enumerate(({"seed": 1}, {"seed": 2}, {"seed": 1})):
        told = _rendered(worker, noted, scene, tmp_path / f"{number}.exr", **options)
        assert (told[-1]["event"], told[-1]["interrupted"]) == ("done", False)
        kept.append(read(tmp_path / f"{number}.exr")["beauty"]["R"])
    np.testing.assert_array_equal(kept[0], kept[2])
    assert not np.array_equal(kept[0], kept[1])
    # Cancelled while it loads, prepares and renders: what there is is written, and it goes on.
    other = scene.with_name("other.toml")
    slow = f"\n[render]\nirradiance_samples = {1 << 20}\n"  # The place is not ready before it is cancelled.
    other.write_text(scene.read_text().replace("[0.0, 0.0, 1.6]", "[0.0, 0.1, 1.6]") + slow)
    for stage in ("loading", "preparing"):
        told = _rendered(worker, noted, other, tmp_path / "3.exr", stage, samples=1_000_000)
        assert (told[-1]["event"], told[-1]["interrupted"], told[-1]["file"]) == ("done", True, None)
    told = _rendered(worker, noted, scene, tmp_path / "4.exr", "progress", samples=1_000_000)
    assert (told[-1]["event"], told[-1]["interrupted"]) == ("done", True)
    assert read(tmp_path / "4.exr")["beauty"]["R"].shape == (32, 64)
    # What it refuses is no reason to end it.
    with pytest.raises(worker.RendererError, match="no camera 'veiw'"):
        _rendered(worker, noted, scene, tmp_path / "5.exr", camera="veiw")
    assert _rendered(worker, noted, scene, tmp_path / "6.exr")[-1]["event"] == "done"
    assert len(_processes(noted)) == 1


def test_requests_reach_the_renderer_by_every_descriptor(tmp_path):
    program = tmp_path / "echoing"
    hello = f'{{"event": "hello", "version": "{_load("worker").VERSION}", "schema": 1}}'
    program.write_text(
        f"#!/bin/sh\necho '{hello}'\nread hello\nread request\n"
        'echo "{\\"event\\": \\"done\\", \\"asked\\": $request}"\n'
    )
    program.chmod(0o755)
    code = (
        "import os, sys; from types import ModuleType\n"
        f"os.closerange(3, 40); package = ModuleType('extension'); package.__path__ = [{str(EXTENSION)!r}]\n"
        "sys.modules['extension'] = package; from extension import worker\n"
        f"kept = worker.Worker({str(program)!r}); kept.greet(lambda: False)\n"
        "print(next(kept.render({'scene': 'room.toml'}, lambda: False))['asked']['scene'])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout == "room.toml\n"


def test_a_renderer_that_was_killed_is_started_again(worker, noted, scene, tmp_path):
    _rendered(worker, noted, scene, tmp_path / "1.exr")
    os.kill(_processes(noted)[-1], signal.SIGKILL)
    warned = []
    assert _rendered(worker, noted, scene, tmp_path / "2.exr", warned=warned)[-1]["event"] == "done"
    assert len(warned) == 1
    assert "started again" in warned[0]
    assert "SIGKILL" in warned[0]
    # In the middle of a picture it is an error, and the next picture is rendered.
    request = {"scene": str(scene), "output": str(tmp_path / "3.exr"), "samples": 1_000_000}
    events = worker.render(str(noted), request, lambda: False, warned.append)
    while next(events)["event"] != "progress":
        pass
    os.kill(_processes(noted)[-1], signal.SIGKILL)
    with pytest.raises(worker.RendererError, match="SIGKILL"):
        list(events)
    assert _rendered(worker, noted, scene, tmp_path / "4.exr", warned=warned)[-1]["event"] == "done"
    assert len(warned) == 1
    assert len(_processes(noted)) == 3


def test_a_renderer_whose_picture_is_given_up_is_ended(worker, noted, scene, tmp_path):
    request = {"scene": str(scene), "output": str(tmp_path / "1.exr"), "samples": 1_000_000}
    events = worker.render(str(noted), request, lambda: False, [].append)
    next(events)
    events.close()
    with pytest.raises(ProcessLookupError):
        os.kill(_processes(noted)[0], 0)


def test_a_renderer_that_does_not_stop_is_killed(worker, tmp_path, monkeypatch):
    monkeypatch.setattr(worker, "CANCEL_PATIENCE", 0.3)
    hello = f'{{"event": "hello", "version": "{worker.VERSION}", "schema": {worker.SCHEMA}}}'
    stubborn = tmp_path / "stubborn"
    stubborn.write_text(f"#!/bin/sh\necho $$ > $0.pids\necho '{hello}'\ntrap '' INT TERM\nsleep 600\n")
    stubborn.chmod(0o755)
    assert list(worker.render(str(stubborn), {}, lambda: True, [].append)) == []
    with pytest.raises(ProcessLookupError):
        os.kill(_processes(stubborn)[0], 0)


@pytest.mark.parametrize(
    ("program", "message"),
    [
        (
            """echo '{"event": "hello", "version": "9.8.7", "schema": SCHEMA}'; sleep 600""",
            "is version 9.8.7 .*needs version",
        ),
        ("""echo '{"event": "hello", "version": "VERSION", "schema": 99}'; sleep 600""", "protocol 99.*needs version"),
        ("""echo "No such command 'serve'." >&2; exit 2""", "without the command 'serve'.*needs version"),
        ("""echo '{"event": "done"}'; sleep 600""", "Is this the right program and version"),
        ("exit 0", "exited with status"),
    ],
)
def test_another_version_is_known_before_it_is_used(worker, tmp_path, program, message):
    stranger = tmp_path / "stranger"
    program = program.replace("SCHEMA", str(worker.SCHEMA)).replace("VERSION", worker.VERSION)
    # What is asked of it before it has said what it is would be written to a file.
    stranger.write_text(f"#!/bin/sh\nexec 4<&0; cat <&4 > $0.asked & sleep 0.2\n{program}\n")
    stranger.chmod(0o755)
    with pytest.raises(worker.RendererError, match=message):
        list(worker.render(str(stranger), {"scene": "room.toml"}, lambda: False, [].append))
    assert Path(f"{stranger}.asked").read_text() == ""


def test_a_folder_by_content_writes_once_and_forgets_what_is_not_used(tmp_path):
    meshfolder = _load("meshfolder")
    folder = meshfolder.MeshFolder(tmp_path / "meshes", by_content=True)
    folder.begin()
    once, again = folder.write("Ball", ".glb", b"ball"), folder.write("Other ball", ".glb", b"ball")
    image = folder.write("", ".png", b"image")
    assert once == again
    folder.keep(b"key", meshfolder.Made((once, image), ("a note",)))
    inode = (folder.path / once).stat().st_ino
    for _ in range(2 * meshfolder.KEPT):
        folder.begin()
        assert folder.found(b"key").notes == ("a note",)
        folder.write("Ball", ".glb", b"ball")
    assert (folder.path / once).stat().st_ino == inode
    (folder.path / image).unlink()  # by whoever tidies temporary files
    assert folder.found(b"key") is None
    for _ in range(meshfolder.KEPT):
        assert (folder.path / once).is_file()
        folder.begin()
    folder.begin()
    assert list(folder.path.iterdir()) == []
    assert folder.found(b"key") is None
    assert folder.write("Ball", ".glb", b"ball") == once
    assert (folder.path / once).read_bytes() == b"ball"


def test_a_folder_for_people_has_the_objects_names(tmp_path):
    folder = _load("meshfolder").MeshFolder(tmp_path)
    folder.begin()
    contents = {"Tür 1/2": b"a", "tür 1/2": b"b", "x" * 250: b"c", "": b"d"}
    names = [folder.write(name, ".glb", data) for name, data in contents.items()]
    assert len({name.lower() for name in names}) == 4
    assert names[0] == "T_r_1_2.glb"
    assert max(map(len, names)) < 80
    assert [(tmp_path / name).read_bytes() for name in names] == list(contents.values())
    assert folder.write("again", ".glb", b"a") == names[0]


def test_digests_follow_arrays_contents():
    digest_of = _load("meshfolder").digest_of
    values = np.arange(1000.0).reshape(100, 10)
    same, other = values.copy(), values.copy()
    other[50, 5] += 1e-9
    assert digest_of(values, "a") == digest_of(same, "a")
    assert digest_of(values[:, ::2]) == digest_of(same[:, ::2])
    assert len({digest_of(values, "a"), digest_of(other, "a"), digest_of(values, "b"), digest_of(values.T, "a")}) == 4
