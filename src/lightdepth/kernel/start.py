"""Starting Mitsuba: libLLVM is found and checked before Dr.Jit is loaded, then a variant is chosen, once."""

from __future__ import annotations

import ctypes
import os
import re
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Literal, get_args

from lightdepth.errors import SetupError

Device = Literal["auto", "cpu", "cuda"]
"""Where to compute; ``auto`` is the CPU, on which everything is tested."""
VARIANTS = {"cpu": "llvm_ad_rgb", "cuda": "cuda_ad_rgb"}
"""Mitsuba's variants by device."""
DEVICE_LOCK = threading.RLock()
"""Held while a thread traces or launches kernels: Dr.Jit records one computation at a time, and a pass keeps the whole
device busy anyway. Renderings in several threads take turns pass by pass."""
_LOCK = threading.Lock()
THREADS = "LIGHTDEPTH_THREADS"
"""Environment variable: how many threads compute on the CPU. Without it, as many as there are processors."""
OLDEST_LLVM = 17
PROCESSORS = Path("/proc/cpuinfo")
_INSTALL_HINT = (
    "Install it with `pip install karellen-llvm-core`, or set DRJIT_LIBLLVM_PATH to the file of a libLLVM shared "
    f"library, version {OLDEST_LLVM} or later."
)


def find_libllvm() -> Path:
    """Find the libLLVM shared library that Dr.Jit is to load.

    Looked for in this order: the file that ``DRJIT_LIBLLVM_PATH`` names, the one that the wheel
    ``karellen-llvm-core`` installs, then the system's.

    Raises:
        SetupError: there is none, or ``DRJIT_LIBLLVM_PATH`` names no file.
    """
    chosen = os.environ.get("DRJIT_LIBLLVM_PATH")
    if chosen:
        if not Path(chosen).is_file():
            raise SetupError(f"DRJIT_LIBLLVM_PATH is '{chosen}', which is not a file. {_INSTALL_HINT}")
        return Path(chosen)
    folders = [Path(sys.prefix) / "lib", *sorted(Path("/usr/lib").glob("*-linux-gnu"))]
    folders += sorted(Path("/usr/lib").glob("llvm-*/lib"), reverse=True)
    for folder in folders:
        found = sorted(folder.glob("libLLVM*.so*"), key=_version_in_name, reverse=True)
        if found and (_version_in_name(found[0]) == 0 or _version_in_name(found[0]) >= OLDEST_LLVM):
            return found[0]
    raise SetupError(f"libLLVM {OLDEST_LLVM} or later was not found. {_INSTALL_HINT}")


def _version_in_name(library: Path) -> int:
    """Major version in a library's file name, 0 where there is none."""
    match = re.search(r"libLLVM[-.](?:so\.)?(\d+)", library.name)
    return int(match.group(1)) if match else 0


def libllvm_version(library: Path) -> int:
    """Major version of a libLLVM file, asked of the library itself.

    Raises:
        SetupError: the file cannot be loaded, or is older than Dr.Jit needs (an old one would abort the process).
    """
    try:
        loaded = ctypes.CDLL(str(library))
        major = ctypes.c_uint()
        loaded.LLVMGetVersion(ctypes.byref(major), None, None)
    except OSError as error:
        raise SetupError(f"{library}: cannot be loaded as libLLVM ({error}). {_INSTALL_HINT}") from error
    except AttributeError as error:
        kind = "libLLVM of a version before 16" if hasattr(loaded, "LLVMContextCreate") else "not libLLVM"
        raise SetupError(f"{library}: is {kind}; {OLDEST_LLVM} or later is needed. {_INSTALL_HINT}") from error
    if major.value < OLDEST_LLVM:
        raise SetupError(f"{library}: libLLVM {major.value}, but {OLDEST_LLVM} or later is needed. {_INSTALL_HINT}")
    return major.value


def check_processor() -> None:
    """Make sure that the processor runs what Dr.Jit compiles: without FMA, the first kernel would abort the process.

    Raises:
        SetupError: it is an x86-64 processor without FMA.
    """
    try:
        flags = next(line for line in PROCESSORS.read_text().splitlines() if line.startswith("flags"))
    except (OSError, StopIteration):
        return
    if "fma" not in flags.partition(":")[2].split():
        raise SetupError(
            "this processor has no FMA instructions, which the renderer needs on the CPU; all x86-64 processors with AVX2 "
            "have them (Intel from 2013, AMD from 2015 on)"
        )


def start(device: Device = "auto") -> str:
    """Load Mitsuba and choose its variant; a process keeps the one that it started with.

    Args:
        device: ``cpu`` (LLVM), ``cuda``, or ``auto``: what the process has started with, else the CPU.

    Returns:
        The variant's name.

    Raises:
        SetupError: the device is none of these; libLLVM is missing, too old or broken, or Dr.Jit was imported before and
            found an old one by itself; the processor has no FMA; ``LIGHTDEPTH_THREADS`` is no number of threads; CUDA was
            asked for and there is none; or the process already computes on another device.
    """
    if device not in (devices := get_args(Device)):
        raise SetupError(f"device '{device}' is not known; allowed are {', '.join(devices)}")
    with _LOCK:
        return _start(device)


def wanted_threads() -> int | None:
    """How many threads ``LIGHTDEPTH_THREADS`` asks for, ``None`` where it is not set.

    Raises:
        SetupError: it is not a number from 1 on.
    """
    value = os.environ.get(THREADS, "").strip()
    if not value:
        return None
    if not re.fullmatch("[0-9]{1,5}", value, re.ASCII) or int(value) == 0:
        raise SetupError(
            f"{THREADS} is '{value}', which is not a number of threads; allowed are whole numbers from 1 on"
        )
    return int(value)


def _start(device: Device) -> str:
    started = sys.modules.get("mitsuba")
    variant = None if started is None else started.variant()
    if variant is None:
        with _interrupts_held():
            variant = _load(device)
    if variant not in VARIANTS.values():
        raise SetupError(
            f"this process has started Mitsuba with the variant '{variant}'; lightdepth needs one of "
            f"{', '.join(VARIANTS.values())}: start it before, or use another process"
        )
    running = "cpu" if variant == VARIANTS["cpu"] else "cuda"
    if device not in ("auto", running):
        raise SetupError(
            f"device '{device}': this process already computes on '{running}' ({variant}), and cannot change; "
            f"choose '{device}' before anything else starts the renderer, or use another process"
        )
    if running == "cpu":
        import drjit as dr

        if (loaded := dr.detail.llvm_version())[0] < OLDEST_LLVM:
            raise SetupError(
                f"Dr.Jit was imported before lightdepth started, and had loaded libLLVM {loaded[0]}; {OLDEST_LLVM} or "
                "later is needed. Import drjit and mitsuba after `lightdepth.kernel.start.start()`, or set "
                f"DRJIT_LIBLLVM_PATH to {find_libllvm()}."
            )
    return str(variant)


@contextmanager
def _interrupts_held() -> Iterator[None]:
    """Hold Ctrl-C back until the end: an exception within the loading of a native module may end the process."""
    of_python = signal.getsignal(signal.SIGINT) is not None  # Else it cannot be put back.
    if (
        threading.current_thread() is not threading.main_thread() or not of_python
    ):  # Other threads are never interrupted.
        yield
        return
    held: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _: held.append(number))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
        if held:
            signal.raise_signal(held[0])


def _load(device: Device) -> str:
    try:
        library = find_libllvm()
        libllvm_version(library)
        os.environ["DRJIT_LIBLLVM_PATH"] = str(library)
    except SetupError:
        if device != "cuda":
            raise
    import drjit as dr
    import mitsuba as mi

    if device == "cuda" and not dr.has_backend(dr.JitBackend.CUDA):
        raise SetupError(
            "device 'cuda': there is no usable CUDA device here (an NVIDIA GPU and its driver are needed); "
            "allowed here: auto, cpu"
        )
    variant = VARIANTS["cuda" if device == "cuda" else "cpu"]
    threads = wanted_threads()
    if device != "cuda":
        check_processor()
    try:
        mi.set_variant(variant)
    except (ImportError, RuntimeError) as error:
        raise SetupError(f"Mitsuba did not start with {variant} ({error})") from error
    if device == "cuda":
        # CUDA 13's assembler refuses it in kernels that call functions, as materials are.
        dr.set_flag(dr.JitFlag.SpillToSharedMemory, False)
    elif threads is not None:
        dr.set_thread_count(threads)
    mi.set_log_level(mi.LogLevel.Error)
    return variant
