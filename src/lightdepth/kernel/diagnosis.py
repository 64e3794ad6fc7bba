"""What the renderer finds on this machine, and whether it works."""

from __future__ import annotations

import os
import time
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

from lightdepth.kernel.start import Device, find_libllvm, libllvm_version, start

PACKAGES = ("lightdepth", "mitsuba", "drjit", "numpy", "OpenEXR", "mitsuba-oidn")


@dataclass(frozen=True)
class Trial:
    """A tiny rendering whose result is known.

    Attributes:
        variant: Mitsuba's variant that made it.
        seconds: time it took, the first kernel's compilation included.
        error: difference of the picture's mean from the right answer; its noise leaves up to 0.005.
    """

    variant: str
    seconds: float
    error: float


def package_versions() -> dict[str, str | None]:
    """Versions of the packages that rendering depends on; ``None`` for one that is not installed."""
    versions: dict[str, str | None] = {}
    for package in PACKAGES:
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            versions[package] = None
    return versions


def libllvm() -> tuple[Path, int]:
    """The libLLVM that would be used, and its major version.

    Raises:
        SetupError: there is none, or none that will do.
    """
    path = find_libllvm()
    return path, libllvm_version(path)


def compiled_variants() -> list[str]:
    """Names of the variants that this Mitsuba was built with; not all of them need work on this machine."""
    import mitsuba as mi

    return list(mi.variants())


def kernel_cache() -> Path | None:
    """Folder where Dr.Jit keeps compiled kernels; ``None`` where it keeps none, for ``HOME`` is not set."""
    if "DRJIT_CACHE_DIR" in os.environ:
        return Path(os.environ["DRJIT_CACHE_DIR"])
    return Path(os.environ["HOME"]) / ".drjit" if os.environ.get("HOME") else None


def usable_processors() -> int:
    """Number of processors that this process may use."""
    return len(os.sched_getaffinity(0))


def memory() -> int:
    """Physical memory in bytes."""
    return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


def trial_render(device: Device = "auto") -> Trial:
    """Render a white diffuse ball under an even white sky: the mean radiance must be 1 (the furnace test).

    Raises:
        SetupError: Mitsuba does not start, or the device is not there.
    """
    variant = start(device)
    import drjit as dr
    import mitsuba as mi

    started = time.perf_counter()
    scene = mi.load_dict(
        {
            "type": "scene",
            "integrator": {"type": "path", "max_depth": -1, "rr_depth": 1000},
            "sky": {"type": "constant"},
            "ball": {"type": "sphere", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": 1.0}}},
            "sensor": {
                "type": "perspective",
                "fov": 60,
                "to_world": mi.ScalarTransform4f().look_at([0, -4, 0], [0, 0, 0], [0, 0, 1]),
                "film": {"type": "hdrfilm", "width": 32, "height": 32, "rfilter": {"type": "box"}},
            },
        }
    )
    image = mi.TensorXf(mi.render(scene, spp=16))
    error = abs(float(dr.mean(image.array)[0]) - 1.0)
    return Trial(variant, time.perf_counter() - started, error)
