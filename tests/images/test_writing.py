"""Files appear whole or not at all, on a full disk as well."""

import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest
from bench.memory import forget_peak, peak_memory
from PIL import Image

from lightdepth.errors import InputError
from lightdepth.images.exr import ExrPart, write_exr
from lightdepth.images.png import write_png
from lightdepth.images.radiance import write_radiance
from lightdepth.images.raster import write_raster
from lightdepth.images.writing import check_writable

NOISE = np.random.default_rng(4).random((128, 256, 3), dtype=np.float32)
WRITE = {
    "x.exr": lambda path: write_exr(path, [ExrPart({"RGB": NOISE}, "a"), ExrPart({"RGB": NOISE}, "b")]),
    "x.hdr": lambda path: write_radiance(path, NOISE),
    "x.png": lambda path: write_png(path, (NOISE * 255).astype(np.uint8)),
    "deep.png": lambda path: write_raster(path, (NOISE * 65535).astype(np.uint16)),
    "deep.tif": lambda path: write_raster(path, (NOISE * 65535).astype(np.uint16)),
}


@pytest.mark.parametrize("name", WRITE)
def test_a_missing_folder_and_a_folder_in_the_way_are_reported(tmp_path, name):
    with pytest.raises(InputError, match="there is no folder"):
        WRITE[name](tmp_path / "absent" / name)
    (tmp_path / "taken").touch()
    with pytest.raises(InputError, match="there is no folder '.*taken'; a file has that name"):
        WRITE[name](tmp_path / "taken" / name)
    (tmp_path / "taken").unlink()
    (tmp_path / name).mkdir()
    with pytest.raises(InputError, match=f"{name}: cannot be written .it is a folder"):
        WRITE[name](tmp_path / name)
    assert list(tmp_path.iterdir()) == [tmp_path / name]


@pytest.mark.parametrize("name", WRITE)
def test_a_failed_write_leaves_the_old_file_and_nothing_else(tmp_path, name):
    """The limit on file size stands for a full disk: both make the write system call fail half way."""
    (tmp_path / name).write_bytes(b"old")
    script = f"""
        import resource, signal, sys
        sys.path[:0] = {[*sys.path]!r}
        from tests.images.test_writing import WRITE
        from lightdepth.errors import InputError
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (20000, 20000))
        from pathlib import Path
        try:
            WRITE[{name!r}](Path({str(tmp_path / name)!r}))
        except InputError as error:
            print(error)
    """
    root = __file__.split("/tests/")[0]
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(script)], cwd=root, capture_output=True, text=True, check=True
    )
    assert f"{name}: cannot be written" in done.stdout
    assert [file.read_bytes() for file in tmp_path.iterdir()] == [b"old"]


def test_a_folder_without_permission_is_reported():
    with pytest.raises(InputError, match="exr: cannot be written"):
        check_writable(Path("/proc/x.exr"))


def test_check_leaves_nothing_behind(tmp_path):
    check_writable(tmp_path / "x.exr")
    assert list(tmp_path.iterdir()) == []


def test_files_can_be_read_by_others(tmp_path):
    write_png(tmp_path / "x.png", np.zeros((4, 8, 4), np.uint8))
    assert (tmp_path / "x.png").stat().st_mode & 0o777 == 0o644
    with Image.open(tmp_path / "x.png") as picture:
        assert (picture.mode, picture.size) == ("RGBA", (8, 4))


def test_an_exr_of_several_parts_is_written_without_copies(tmp_path):
    pixels = np.zeros((2048, 4096, 3), np.float32)
    pixels += 0.5
    forget_peak()
    before = peak_memory()
    write_exr(tmp_path / "x.exr", [ExrPart({"RGB": pixels}, "a"), ExrPart({"RGB": pixels}, "b")])
    assert peak_memory() - before < 0.25 * pixels.nbytes
