"""A libLLVM that will not do is refused with a message that says what to install; the process never aborts."""

import _ctypes
import os
import shutil
import subprocess
import sys

import pytest

FIND = "from lightdepth.kernel.start import find_libllvm, libllvm_version; print(libllvm_version(find_libllvm()))"


def run(code, **environment):
    return subprocess.run(
        [
            sys.executable,
            "-c",
            f"from lightdepth.errors import SetupError\ntry:\n {code}\nexcept SetupError as e: exit(e)",
        ],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=False,
    )


def test_installed_libllvm_is_found():
    assert int(run(FIND).stdout) >= 17


@pytest.mark.parametrize("start", [FIND, "from lightdepth.kernel.start import start; start('cpu')"])
@pytest.mark.parametrize(
    ("library", "complaint"),
    [
        ("nowhere.so", "which is not a file"),
        (__file__, "cannot be loaded as libLLVM"),
        (_ctypes.__file__, "is not libLLVM"),
    ],
)
def test_wrong_file_is_refused(start, library, complaint):
    result = run(start, DRJIT_LIBLLVM_PATH=library)
    assert result.returncode == 1
    assert library in result.stderr
    assert complaint in result.stderr
    assert "pip install karellen-llvm-core" in result.stderr
    assert "Traceback" not in result.stderr


@pytest.mark.skipif(shutil.which("cc") is None, reason="needs a C compiler to make a library that calls itself old")
@pytest.mark.parametrize(
    ("source", "complaint"),
    [
        ("void LLVMContextCreate(void) {}", "libLLVM of a version before 16"),
        ("void LLVMGetVersion(unsigned *a, unsigned *b, unsigned *c) { *a = 16; }", "libLLVM 16, but 17 or later"),
    ],
)
def test_old_version_is_refused(tmp_path, source, complaint):
    (tmp_path / "old.c").write_text(source)
    library = tmp_path / "libLLVM-old.so"
    subprocess.run(["cc", "-shared", "-fPIC", "-o", library, tmp_path / "old.c"], check=True)
    result = run("from lightdepth.kernel.start import start; start('cpu')", DRJIT_LIBLLVM_PATH=str(library))
    assert complaint in result.stderr
    assert "pip install karellen-llvm-core" in result.stderr
    assert result.returncode == 1


def test_an_old_library_that_is_loaded_already_is_refused():
    own_search = {name: value for name, value in os.environ.items() if name != "DRJIT_LIBLLVM_PATH"}
    code = (
        "import drjit as dr; from lightdepth.errors import SetupError; from lightdepth.kernel.start import start\n"
        "print(dr.detail.llvm_version()[0], flush=True)\n"
        "try: start('cpu')\n"
        "except SetupError as e: exit(str(e))\n"
        "import mitsuba as mi; print(mi.Float(1.0) + 1.0)"
    )
    ended = subprocess.run([sys.executable, "-c", code], env=own_search, capture_output=True, text=True, check=False)
    if int(ended.stdout.split()[0]) < 17:
        assert ended.returncode == 1
        assert "was imported before lightdepth started" in ended.stderr
    else:
        assert ended.returncode == 0
        assert "2" in ended.stdout


START = "from lightdepth.kernel.start import start; "


HAS_CUDA = f"{START}start(); import drjit as dr; print(dr.has_backend(dr.JitBackend.CUDA))"


def test_the_device_is_the_cpu_unless_another_one_is_asked_for():
    assert run(f"{START}print(start(), start('cpu'), start('auto'))").stdout.split() == ["llvm_ad_rgb"] * 3


@pytest.mark.parametrize("value", ["1", "3"])
def test_as_many_threads_compute_as_are_asked_for(value):
    code = f"{START}start(); import drjit as dr; print(dr.thread_count())"
    assert run(code, LIGHTDEPTH_THREADS=value).stdout.split() == [value]


@pytest.mark.parametrize("value", ["0", "-1", "two", "1.5", "²"])
def test_what_is_no_number_of_threads_is_refused(value):
    result = run(f"{START}start()", LIGHTDEPTH_THREADS=value)
    assert result.returncode == 1
    assert f"LIGHTDEPTH_THREADS is '{value}'" in result.stderr
    assert "Traceback" not in result.stderr


def test_a_process_that_computes_on_the_cpu_refuses_cuda():
    result = run(f"{START}start('auto'); start('cuda')")
    assert result.returncode == 1
    assert "device 'cuda': this process already computes on 'cpu'" in result.stderr
    assert "Traceback" not in result.stderr


def test_cuda_where_there_is_none_is_refused_in_words_and_the_cpu_still_works():
    if int(run(HAS_CUDA).stdout):
        pytest.skip("there is a CUDA device")
    refused = run(f"{START}start('cuda')")
    assert refused.returncode == 1
    assert "there is no usable CUDA device here" in refused.stderr
    assert "jit_" not in refused.stderr
    code = f"{START}\n try: start('cuda')\n except SetupError: print(start('cpu'))"
    assert run(code).stdout.strip() == "llvm_ad_rgb"


def test_a_device_that_is_not_known_is_refused_before_anything_starts():
    refused = run(f"{START}start('gpu')")
    assert refused.returncode == 1
    assert refused.stderr.strip() == "device 'gpu' is not known; allowed are auto, cpu, cuda"


def test_a_process_that_runs_another_variant_is_refused():
    result = run(f"import mitsuba; mitsuba.set_variant('scalar_rgb'); {START}start('cpu')")
    assert result.returncode == 1
    assert "has started Mitsuba with the variant 'scalar_rgb'" in result.stderr


@pytest.mark.parametrize(("flags", "complaint"), [("fpu sse4_2 avx", "no FMA"), ("fpu fma avx2", "")])
def test_a_processor_without_fma_is_refused(tmp_path, flags, complaint):
    """Dr.Jit would abort the process at its first kernel."""
    processors = tmp_path / "cpuinfo"
    processors.write_text(f"processor : 0\nflags : {flags}\n")
    code = "from pathlib import Path; from lightdepth.kernel import start; "
    code += f"start.PROCESSORS = Path('{processors}'); start.start()"
    done = run(code)
    assert complaint in done.stderr
    assert (done.returncode == 0) == (complaint == "")


def test_ctrl_c_while_mitsuba_loads_is_held_until_it_has():
    """Within the loading of its native modules it ended the process by a SystemError, an abort, or a segmentation fault."""
    code = """
import signal, sys
from lightdepth.kernel.start import start
signal.signal(signal.SIGINT, signal.default_int_handler)  # A shell's background jobs begin with it ignored.
class Interrupting:
    def find_spec(self, name, path, target=None):
        if name == "mitsuba":
            signal.raise_signal(signal.SIGINT)
sys.meta_path.insert(0, Interrupting())
try:
    start()
except KeyboardInterrupt:
    print(sys.modules["mitsuba"].variant())
"""
    ended = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert (ended.stdout, ended.returncode) == ("llvm_ad_rgb\n", 0), ended.stderr
