"""An 8192 x 4096 panorama in and out: memory and time of all, by the command and in Python. Slow: some minutes."""

import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.film.large_place import write_large_place

MOST_MEBIBYTES = 4096
COMMAND = """
from lightdepth.cli.app import main
sys.argv = ["lightdepth", "render", str(scene), "-o", str(target), "--samples", samples, "--progress", "none"]
try:
    main()
except SystemExit as stopped:
    if stopped.code:
        raise
"""
PYTHON = """
import lightdepth
from lightdepth.film.layers import write_frame, write_picture
frame = lightdepth.render(lightdepth.load_scene(scene), samples=int(samples))
write_frame(target, frame)
write_picture(target.with_suffix(".png"), frame)
"""
RUN = """
import sys, time
from pathlib import Path
from bench.memory import peak_memory
begun = time.monotonic()
scene, target, samples = Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3]
{way}
print(peak_memory() / 2**20, time.monotonic() - begun)
"""


@pytest.mark.truth
@pytest.mark.parametrize(
    ("way", "samples", "role"),
    [(COMMAND, 1, "support"), (COMMAND, 4, "support"), (PYTHON, 1, "support"), (PYTHON, 1, "environment")],
    ids=["command-1", "command-4", "python-1", "python-some pixels"],
)
def test_memory_and_time(tmp_path, way, samples, role):
    """All layers are written; of all pixels, which are support and are sampled, or of all but the ceiling's."""
    scene = write_large_place(tmp_path, 8192, ceiling=role)
    arguments = [scene, tmp_path / "out.exr", samples]
    run = subprocess.run(
        [sys.executable, "-c", RUN.format(way=way), *map(str, arguments)],
        stdout=subprocess.PIPE, text=True, check=True,
    )  # fmt: skip
    peak, seconds = map(float, run.stdout.splitlines()[-1].split())
    print(f"{samples} samples: peak {peak:.0f} MiB, {seconds:.0f} s in all")
    assert peak <= MOST_MEBIBYTES
    assert (tmp_path / "out.exr").stat().st_size > 2**28


CAMERA = """
[camera.theatre]
type = "dome_master"
width = 8192
rotation = [-20, 0, 0]
tilt = 10
"""


@pytest.mark.truth
def test_a_dome_master_of_the_demo(tmp_path):
    """All layers; 12 % of its pixels are new, and lie all over it."""
    shutil.copytree(Path(__file__).parents[2] / "examples/lounge", tmp_path / "lounge")
    scene = tmp_path / "lounge/scene.toml"
    scene.write_text(scene.read_text() + CAMERA)
    way = COMMAND.replace('"-o"', '"--camera", "theatre", "-o"')
    run = subprocess.run(
        [sys.executable, "-c", RUN.format(way=way), scene, tmp_path / "out.exr", "1"],
        stdout=subprocess.PIPE, text=True, check=True,
    )  # fmt: skip
    peak = float(run.stdout.splitlines()[-1].split()[0])
    print(f"peak {peak:.0f} MiB")
    assert peak <= MOST_MEBIBYTES
