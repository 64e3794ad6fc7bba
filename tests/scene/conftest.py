"""A small scene folder, and Mitsuba."""

import numpy as np
import pytest

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
