import os
import subprocess
import sys


def doctor(**environment):
    return subprocess.run(
        [sys.executable, "-c", "from lightdepth.cli.app import main; main()", "doctor"],
        env={**os.environ, "COLUMNS": "300", **environment},
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        check=False,
    )


def test_all_is_well(tmp_path):
    result = doctor(DRJIT_CACHE_DIR=str(tmp_path))
    assert result.returncode == 0, result.stderr
    for words in ("mitsuba", "drjit", "libLLVM", "llvm_ad_rgb", str(tmp_path), "everything that rendering needs works"):
        assert words in result.stdout


def test_broken_libllvm_is_reported_without_an_abort(tmp_path):
    library = tmp_path / "libLLVM.so"
    library.write_text("no library")
    result = doctor(DRJIT_LIBLLVM_PATH=str(library))
    assert result.returncode == 2
    assert f"{library}: cannot be loaded as libLLVM" in result.stderr
    assert "pip install karellen-llvm-core" in result.stderr
    assert "processors" in result.stdout
    assert "Traceback" not in result.stderr
