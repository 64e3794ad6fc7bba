"""Where a package of an extra is missing, the command says which extra to install."""

import subprocess
import sys
from pathlib import Path

import laspy
import numpy as np
import pytest

from lightdepth.images.png import write_png
from tests.cli.room_folder import make_room

SOURCE = Path(__file__).parents[2] / "src"


def write_scan(path):
    points = np.random.default_rng(0).uniform(-1, 1, (200, 3))
    las = laspy.create(point_format=0, file_version="1.2")
    las.header.scales = [1e-4] * 3
    las.x, las.y, las.z = points.T
    las.write(str(path))


@pytest.fixture
def folder(tmp_path):
    """A photograph, a RAW file with its exposures in a table, scans, and a scene."""
    write_png(tmp_path / "a.png", np.full((16, 16, 3), 99, np.uint8))
    (tmp_path / "a.dng").write_bytes(b"II*")
    (tmp_path / "table.csv").write_text("file,time\na.dng,0.5\n")
    write_scan(tmp_path / "scan.las")
    write_scan(tmp_path / "scan.laz")
    (tmp_path / "scan.e57").write_bytes(b"ASTM-E57")
    text = make_room(tmp_path).read_text()
    ball = 'shape = "sphere"\ncenter = [0.5, 1.0, 0.3]\nradius = 0.3'
    (tmp_path / "usd.toml").write_text(text.replace(ball, 'mesh = "thing.usdc"'))
    (tmp_path / "thing.usdc").write_bytes(b"PXR-USDC")
    return tmp_path


POINTS = ["--position", "0,0,1", "-o", "meshes"]


@pytest.mark.parametrize(
    ("missing", "extra", "arguments"),
    [
        ("exifread", "capture", ["capture", "merge", "a.png", "-o", "x.exr"]),
        ("rawpy", "capture", ["capture", "merge", "a.dng", "--exposures", "table.csv", "-o", "x.exr"]),
        ("laspy", "points", ["reconstruct", "from-points", "scan.las", *POINTS]),
        ("pye57", "points", ["reconstruct", "from-points", "scan.e57", *POINTS]),
        ("pymeshlab", "points", ["reconstruct", "from-points", "scan.las", *POINTS]),
        ("av", "video", ["deliver", "a.####.exr", "--as", "360", "-o", "x.mp4"]),
        ("PyOpenColorIO", "colour", ["deliver", "a.exr", "--as", "stills", "-o", "x.png", "--ocio", "ocio://default"]),
        ("pxr", "usd", ["check", "usd.toml"]),
        (
            "distributed",
            "farm",
            ["farm", "dask", "scene.toml", "--scheduler", "x", "--frames", "1", "-o", "x.####.exr"],
        ),
        ("mitsuba_oidn", "denoise", ["render", "scene.toml", "--denoise", "-o", "x.exr"]),
    ],
)
def test_the_extra_is_named(missing, extra, arguments, folder, command, monkeypatch):
    before = sorted(folder.iterdir())
    monkeypatch.chdir(folder)
    monkeypatch.setitem(sys.modules, missing, None)  # Cannot be imported then, as if it were not installed.
    status, _, errors = command(*arguments)
    assert status == 2, errors
    check_message(errors, missing, extra)
    assert sorted(folder.iterdir()) == before


def check_message(errors, missing, extra):
    assert errors.lstrip().startswith(f"error: the Python package '{missing}' is needed for this")
    assert errors.endswith(f": pip install 'lightdepth[{extra}]'\n")


def test_the_extra_is_named_for_compressed_scans(folder):
    """In a process of its own, since laspy looks for what decompresses when it is imported."""
    code = (
        "import sys; sys.modules['lazrs'] = sys.modules['laszip'] = None\nfrom lightdepth.cli.app import main; main()"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "reconstruct", "from-points", "scan.laz", *POINTS],
        capture_output=True, text=True, cwd=folder, env={"PYTHONPATH": str(SOURCE)}, check=False,
    )  # fmt: skip
    assert done.returncode == 2, done.stderr
    check_message(done.stderr, "lazrs", "points")
    assert not (folder / "meshes").exists()
