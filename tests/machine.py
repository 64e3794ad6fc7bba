"""Another machine than this one: instruction set, threads and seed of a run, from the environment.

`LIGHTDEPTH_TEST_TARGET` names one of `TARGETS`, `LIGHTDEPTH_THREADS` how many threads compute, as for users, and
`LIGHTDEPTH_TEST_SEED` a number that all random numbers of rendering and recovery then depend on.
`make test-machines` runs the statistical tests under several of each.
"""

import argparse
import ctypes
import os
import resource
import subprocess
import sys
from pathlib import Path

TARGETS = {
    "sse4.2": ("x86-64-v2", "+fma,+f16c", 4),
    "avx2": ("x86-64-v3", None, 8),
    "avx512": ("x86-64-v4", None, 16),
}
"""LLVM's processor, features beyond its own, and lanes of a vector. Dr.Jit's kernels need FMA, and half floats of textures
F16C, which v2 lacks; processors that have the one have the other."""
NEEDED = {"sse4.2": "fma", "avx2": "avx2", "avx512": "avx512vl"}
"""What the processor must have to run them, as Linux calls it."""


SEED = int(os.environ.get("LIGHTDEPTH_TEST_SEED", "0"))
"""For tests that begin random numbers of their own."""


def processor_features() -> set[str]:
    """Of the first processor, as Linux calls them."""
    for line in Path("/proc/cpuinfo").read_text().splitlines():
        if line.startswith("flags"):
            return set(line.partition(":")[2].split())
    return set()


def runnable_targets() -> list[str]:
    """Names of `TARGETS` that this processor can run."""
    features = processor_features()
    return [name for name, feature in NEEDED.items() if feature in features]


def apply() -> str:
    """Compute as the environment says; returns a line about it."""
    target = os.environ.get("LIGHTDEPTH_TEST_TARGET")
    said = [f"threads {os.environ['LIGHTDEPTH_THREADS']}"]
    if target:
        _force_target(target)
        said.append(f"instructions {target}")
    if SEED:
        _shift_seeds(SEED)
        said.append(f"seed {SEED}")
    return ", ".join(said)


def _force_target(name: str) -> None:
    """Compile kernels for a processor of `TARGETS`."""
    from lightdepth.kernel.start import start

    if name not in runnable_targets():
        raise ValueError(f"LIGHTDEPTH_TEST_TARGET is '{name}'; this processor runs {', '.join(runnable_targets())}")
    start("cpu")
    import drjit as dr

    processor, features, lanes = TARGETS[name]
    library = ctypes.CDLL(str(Path(dr.__file__).parent / "libdrjit-core.so"))
    # `jit_llvm_set_target(const char *, const char *, uint32_t)` of Dr.Jit's public header, which Python does not have.
    set_target = library._Z19jit_llvm_set_targetPKcS0_j
    set_target.restype = None
    set_target.argtypes = [ctypes.c_char_p, ctypes.c_char_p, ctypes.c_uint32]
    set_target(processor.encode(), features and features.encode(), lanes)
    get = library._Z19jit_llvm_target_cpuv
    get.restype = ctypes.c_char_p
    assert get() == processor.encode()


def _shift_seeds(seed: int) -> None:
    """Other random numbers for everything that begins with a seed, in NumPy and in the kernels."""
    import numpy as np

    plain = np.random.default_rng

    def shifted(given=None):
        if isinstance(given, int | np.integer):
            return plain([seed, int(given)])
        return plain([seed, *given]) if isinstance(given, list) else plain(given)

    np.random.default_rng = shifted

    from lightdepth.kernel.start import start

    start("cpu")
    import drjit as dr

    from lightdepth.film import light_image, sampling
    from lightdepth.transport.sampler import begin_path

    mixed = (seed * 0x9E3779B1) & 0xFFFFFFFF
    for module in (sampling, light_image):
        module.begin_path = lambda pixel, index, given: begin_path(pixel, index, given ^ dr.opaque(type(given), mixed))


STATISTICAL = [
    "tests/transport", "tests/place", "tests/recovery", "tests/kernel", "tests/lightmap", "tests/film/test_adaptive.py",
    "tests/film/test_selection.py", "tests/film/test_shared_errors.py",
]  # fmt: skip
"""Tests that compare random numbers with limits."""
THREADS = (1, 2, 3, 4)


def main() -> int:
    """Run the statistical tests, each time with another seed, and in turn with all instruction sets and threads."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--runs", type=int, default=12, help="how many (%(default)s)")
    parser.add_argument("--first", type=int, default=1, help="the first seed (%(default)s)")
    parser.add_argument("--share", default="1/1", help="k/n: of these, each n-th from the k-th on")
    parser.add_argument("--targets", nargs="+", choices=TARGETS, help="instruction sets; all that this processor has")
    parser.add_argument("tests", nargs="*", default=STATISTICAL, help="files and folders; all statistical tests")
    arguments = parser.parse_args()
    targets = [name for name in runnable_targets() if name in (arguments.targets or TARGETS)]
    if not targets:
        parser.error(f"this processor runs {', '.join(runnable_targets())}")
    part, parts = (int(number) for number in arguments.share.split("/"))
    failed = 0
    for seed in range(arguments.first, arguments.first + arguments.runs)[part - 1 :: parts]:
        settings = {
            "TEST_TARGET": targets[seed % len(targets)],
            "THREADS": str(THREADS[seed % len(THREADS)]),
            "TEST_SEED": str(seed),
        }
        environment = {**os.environ, **{f"LIGHTDEPTH_{name}": value for name, value in settings.items()}}
        command = [sys.executable, "-m", "pytest", "-q", "--no-header", "-p", "no:cacheprovider", "--durations=3"]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run(
            [*command, *arguments.tests], env=environment, cwd=Path(__file__).parents[1], capture_output=True, text=True
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        lines = done.stdout.splitlines()
        seconds = after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime
        what = ", ".join(f"{name.removeprefix('TEST_').lower()} {value}" for name, value in settings.items())
        print(f"{what}: {lines[-1] if lines else done.stderr[-300:]} ({seconds:.0f} s of processor time)", flush=True)
        for line in lines:
            if line.startswith(("FAILED", "ERROR")):
                print(f"  {line}", flush=True)
        failed += done.returncode != 0
    return 1 if failed else 0


if __name__ == "__main__":
    raise SystemExit(main())
