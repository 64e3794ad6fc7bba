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
WITHOUT = """
import sys
missing, *sys.argv[1:] = sys.argv[1:]
for name in missing.split(","):
    sys.modules[name] = None  # What is None here cannot be imported, as if it were not installed.
from lightdepth.cli.app import main
main()
"""


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
    make_room(tmp_path)
    return tmp_path


POINTS = ["--position", "0,0,1", "-o", "meshes"]


@pytest.mark.parametrize(
    ("missing", "extra", "arguments"),
    [
        ("exifread", "capture", ["capture", "merge", "a.png", "-o", "x.exr"]),
        ("rawpy", "capture", ["capture", "merge", "a.dng", "--exposures", "table.csv", "-o", "x.exr"]),
        ("laspy", "points", ["reconstruct", "from-points", "scan.las", *POINTS]),
        ("lazrs,laszip", "points", ["reconstruct", "from-points", "scan.laz", *POINTS]),
        ("pye57", "points", ["reconstruct", "from-points", "scan.e57", *POINTS]),
        ("pymeshlab", "points", ["reconstruct", "from-points", "scan.las", *POINTS]),
        ("mitsuba_oidn", "denoise", ["render", "scene.toml", "--denoise", "-o", "x.exr"]),
    ],
)
def test_the_extra_is_named(missing, extra, arguments, folder):
    before = sorted(folder.iterdir())
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT, missing, *arguments],
        capture_output=True, text=True, cwd=folder, env={"PYTHONPATH": str(SOURCE)}, check=False,
    )  # fmt: skip
    name = missing.split(",")[0]
    assert done.returncode == 2, done.stderr
    assert done.stderr.lstrip().startswith(f"error: the Python package '{name}' is needed for this")
    assert done.stderr.endswith(f": pip install 'lightdepth[{extra}]'\n")
    assert sorted(folder.iterdir()) == before
