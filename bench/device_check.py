"""Whether another device gives the CPU's pictures within noise, and how fast it is: ``python bench/device_check.py``.

Needs nothing but Python, this repository and, where it is not installed, a folder with the wheels of it and its
packages, which it installs aside (``--wheels``), without a network. Each device renders in a process of its own. Ends
with 0 where the pictures agree, with 1 where they do not, and with 2 where a device did not render.
"""

from __future__ import annotations

import argparse
import importlib.util
import json
import os
import platform
import site
import subprocess
import sys
import tempfile
import time
import venv
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
SCENE = ROOT / "examples" / "lounge" / "scene.toml"
FALSE_ALARM = 1e-6
"""Chance that a comparison fails though the devices agree, shared by all its blocks."""
TOLERANCE = 1e-3
"""What rounding may make of a block's radiance: single precision differs in the last digits between devices."""
GRAZING = 1e-3
"""Largest share of a plate's pixels that may differ: their rays graze edges, and rounding leads them past."""
BLOCK = 16
"""Pixels of a block's side: the means of blocks are compared."""
WIDTHS = {"view": 320, "dome": 192, "pano": 256}
CASES = [("difference", "view"), ("difference", "dome"), ("difference", "pano"), ("envpath", "view")]
START = """
import sys
from lightdepth.errors import LightdepthError
from lightdepth.kernel.start import start
try:
    start(sys.argv[1])
except (LightdepthError, ValueError) as error:
    sys.exit(f"{sys.argv[1]}: {error}")
"""
"""Whether a device can render, in a process of its own."""
SPEED_WIDTHS = {"view": 1280, "dome": 1024, "pano": 2048}


def main() -> int:
    """Run the check; what was measured goes to the terminal, and to ``--output`` as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--wheels", type=Path, help="folder of wheels to install aside first")
    parser.add_argument("--devices", default="cpu,cuda", help="the reference, then what is compared with it")
    parser.add_argument("--seeds", type=int, default=8, help="pictures a comparison, each with its own random numbers")
    parser.add_argument("--samples", type=int, default=32, help="samples per pixel of a compared picture")
    parser.add_argument("--no-speed", action="store_true", help="compare only")
    parser.add_argument("--output", type=Path, default=Path("device-check"), help="folder for pictures and figures")
    parser.add_argument("--measure", nargs=2, metavar=("DEVICE", "FILE"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.measure:
        _measure(arguments.measure[0], Path(arguments.measure[1]), arguments)
        return 0
    arguments.output.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        python = _python(Path(folder), arguments.wheels)
        environment = {**os.environ, "PYTHONPATH": os.pathsep.join((str(ROOT), str(ROOT / "src")))}
        files, devices = [], arguments.devices.split(",")
        # At once, and not when the reference has rendered for minutes.
        if not all(
            subprocess.run([python, "-c", START, device], env=environment).returncode == 0 for device in devices
        ):
            return 2
        for number, device in enumerate(devices):
            files.append(arguments.output / f"{number}-{device}.npz")
            # With caches of its own: nothing compiled or prepared before, and nothing of the other device's.
            caches = Path(folder) / str(number)
            (caches / "kernels").mkdir(parents=True)
            own = {"LIGHTDEPTH_CACHE": str(caches / "places"), "DRJIT_CACHE_DIR": str(caches / "kernels")}
            command = [python, __file__, "--measure", device, str(files[-1])]
            command += ["--seeds", str(arguments.seeds), "--samples", str(arguments.samples)]
            command += ["--no-speed"] * arguments.no_speed
            if subprocess.run(command, env={**environment, **own}).returncode:
                print(f"{device}: did not render")
                return 2
        return _report(files, arguments.output)


def _python(folder: Path, wheels: Path | None) -> str:
    """The Python that renders: this one, or one of its own that has the wheels and sees what is installed here."""
    if wheels is None:
        return sys.executable
    venv.create(folder / "venv", with_pip=False, symlinks=True)
    python = str(folder / "venv" / "bin" / "python")
    (own,) = (folder / "venv" / "lib").glob("python*/site-packages")
    (own / "installed-here.pth").write_text("\n".join(site.getsitepackages()) + "\n")
    command = [sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--no-index", "--no-deps"]
    subprocess.run([*command, *map(str, sorted(wheels.glob("*.whl")))], check=True)
    return python


def _measure(device: str, file: Path, arguments: argparse.Namespace) -> None:
    """Render on one device; pictures and seconds go to a file."""
    import numpy as np

    import lightdepth
    from lightdepth.kernel.start import start

    started = time.perf_counter()
    variant = start(device)
    scene = lightdepth.load_scene(SCENE)
    facts: dict[str, Any] = {"device": device, "variant": variant, "name": _device_name(device)}
    facts["started"] = time.perf_counter() - started
    kept: dict[str, Any] = {}
    for method, camera in CASES:
        small, pictures = _resized(scene, WIDTHS), []
        for seed in range(arguments.seeds):
            began = time.perf_counter()
            frame = lightdepth.render(small, camera, arguments.samples, method=method, seed=seed, device=device)
            if seed == 0:
                facts[f"first {method} {camera}"] = time.perf_counter() - began
            pictures.append(frame.beauty)
        kept[f"{method} {camera}"] = np.stack(pictures)
        kept[f"{method} {camera} plate"] = frame.plate
        kept[f"{method} {camera} depth"] = frame.depth
    if not arguments.no_speed:
        facts["speed"] = _speed(scene, device)
    if importlib.util.find_spec("mitsuba_oidn"):
        from lightdepth.film.layers import write_picture

        began = time.perf_counter()
        frame = lightdepth.render(_resized(scene, SPEED_WIDTHS), "view", 16, denoise=True, device=device)
        facts["denoised"] = time.perf_counter() - began
        write_picture(file.with_suffix(".png"), frame)
    np.savez_compressed(file, facts=json.dumps(facts), **kept)


def _speed(scene: Any, device: str) -> dict[str, dict[str, float]]:
    """Seconds of each camera of the demo at its own size, everything compiled and prepared, and camera samples in them."""
    import numpy as np

    import lightdepth

    large, speeds = _resized(scene, SPEED_WIDTHS), {}
    for camera in SPEED_WIDTHS:
        seconds = []
        for seed in range(4):
            began = time.perf_counter()
            frame = lightdepth.render(large, camera, 16, seed=seed, device=device)
            seconds.append(time.perf_counter() - began)
        samples = float(frame.samples.astype(np.int64).sum())
        speeds[camera] = {"first": seconds[0], "seconds": min(seconds[1:]), "samples": samples}
    return speeds


def _device_name(device: str) -> str:
    """What a person calls the processor that renders."""
    if device == "cuda":
        command = ["nvidia-smi", "--query-gpu=name,driver_version", "--format=csv,noheader"]
        try:
            return subprocess.run(command, check=True, capture_output=True, text=True).stdout.strip()
        except (OSError, subprocess.CalledProcessError):
            return "GPU"
    cores = len(os.sched_getaffinity(0))
    models = [
        line.split(":")[1].strip() for line in Path("/proc/cpuinfo").read_text().splitlines() if "model name" in line
    ]
    return f"{models[0] if models else platform.machine()}, {cores} processors"


def _resized(scene: Any, widths: dict[str, int]) -> Any:
    """The scene with some of its cameras, of other widths."""
    from dataclasses import replace

    cameras = {}
    for name, wanted in widths.items():
        view = scene.cameras[name]
        width, height = view.camera.resolution
        sizes = {"width": wanted}
        if hasattr(view.camera, "height"):  # Of an equirectangular camera and a fisheye it follows from the width.
            sizes["height"] = wanted * height // width
        cameras[name] = replace(view, camera=view.camera.model_copy(update=sizes))
    return replace(scene, cameras=cameras)


def _report(files: list[Path], output: Path) -> int:
    """Compare each device with the first; print and save what was found. Returns the exit status."""
    import numpy as np

    measured = [dict(np.load(file)) for file in files]
    facts = [json.loads(str(values.pop("facts"))) for values in measured]
    for fact in facts:
        print(f"{fact['device']}: {fact['variant']}, {fact['name']}, started in {fact['started']:.1f} s")
    comparisons, agree = [], True
    for fact, values in zip(facts[1:], measured[1:], strict=True):
        for method, camera in CASES:
            name, device = f"{method} {camera}", fact["device"]
            arrays = (measured[0][name], values[name], measured[0][f"{name} plate"], values[f"{name} plate"])
            found = compare(*arrays)
            agree &= bool(found["agree"])
            comparisons.append({"device": device, "case": name, **found})
            print(
                f"{device} {name}: {'agrees' if found['agree'] else 'DIFFERS'}; objects and change {found['bias']:+.3%}, "
                f"error {found['error']:.3%}; block that differs most {found['most']:+.2%}; would be caught from "
                f"{found['caught']:.2%}; pixels within 1 % {found['alike']:.1%}; {found['plate']:.1e} of the plate differs"
            )
            _picture(output / f"{device}-{name.replace(' ', '-')}.png", measured[0][name], values[name])
    for fact in facts:
        for camera, speed in fact.get("speed", {}).items():
            rate = speed["samples"] / speed["seconds"]
            base = facts[0]["speed"][camera]
            print(
                f"{fact['device']} {camera} {SPEED_WIDTHS[camera]} wide: first {speed['first']:.2f} s, then "
                f"{speed['seconds']:.2f} s, {rate / 1e6:.1f} million samples a second, "
                f"{rate * base['seconds'] / base['samples']:.1f} times {facts[0]['device']}"
            )
    report = {"facts": facts, "comparisons": comparisons, "agree": agree}
    (output / "device-check.json").write_text(json.dumps(report, indent=1) + "\n")
    return 0 if agree else 1


def compare(reference: Any, values: Any, plate: Any, other_plate: Any) -> dict[str, Any]:
    """Whether two devices render the same, from pictures that were made with the same random numbers on both.

    Student's test on the difference of each block's mean: it may differ by :data:`TOLERANCE` of the block's radiance and
    by what chance leaves, which the seeds tell. With the Bonferroni correction, all blocks and channels together raise a
    false alarm with the chance :data:`FALSE_ALARM`.

    Args:
        reference: one picture a seed, linear radiance, shape (seeds, height, width, 3).
        values: the other device's, the same shape.
        plate: the photograph below, shape (height, width, 3).
        other_plate: the other device's, the same shape.

    Returns:
        ``agree``; ``bias`` and its standard ``error``, relative to the radiance of all pixels that objects touch; ``most``,
        the greatest relative difference of a block; ``caught``, the relative difference that half of the changed blocks
        would be rejected for; ``alike``, the share of touched pixels within 1 %; ``plate``, the share of the plates'
        pixels that differ.
    """
    import numpy as np
    from scipy.stats import t as student

    pictures, other, plate = (array.astype(np.float64) for array in (reference, values, plate))
    means, differences = _block_means(pictures).mean(0), _block_means(other) - _block_means(pictures)
    count = len(differences)
    limit = student.isf(FALSE_ALARM / (2 * means.size), count - 1)
    allowed = TOLERANCE * means + limit * differences.std(0, ddof=1) / np.sqrt(count)
    touched = np.abs(pictures - plate).max((0, 3)) > 0
    radiance = pictures[:, touched].mean()
    overall = (other - pictures)[:, touched].mean((1, 2)) / radiance
    close = np.abs(other - pictures).max(3) <= 0.01 * np.maximum(pictures.max(3), 1e-6)
    apart = float((np.abs(other_plate - plate) > TOLERANCE * (plate + plate.mean())).any(2).mean())
    relative = differences.mean(0) / np.maximum(means, 1e-12)
    changed = _block_means(np.abs(pictures - plate)).max(0) > 0
    whole = TOLERANCE + student.isf(FALSE_ALARM / 2, count - 1) * overall.std(ddof=1) / np.sqrt(count)
    alike = (np.abs(differences.mean(0)) <= allowed).all() and abs(overall.mean()) <= whole and apart <= GRAZING
    return {
        "agree": bool(alike),
        "bias": float(overall.mean()),
        "error": float(overall.std(ddof=1) / np.sqrt(count)),
        "most": float(relative.flat[np.abs(relative).argmax()]),
        "caught": float(np.median((allowed / np.maximum(means, 1e-12))[changed])),
        "alike": float(close[:, touched].mean()),
        "plate": apart,
    }


def _block_means(pictures: Any) -> Any:
    """Means of the blocks of each picture, shape (pictures, blocks and channels)."""
    count, height, width, _ = pictures.shape
    rows, columns = height // BLOCK, width // BLOCK
    cut = pictures[:, : rows * BLOCK, : columns * BLOCK]
    return cut.reshape(count, rows, BLOCK, columns, BLOCK, 3).mean((2, 4)).reshape(count, -1)


def _picture(file: Path, reference: Any, values: Any) -> None:
    """Both devices' means above each other, and ten times their difference below, for a person to look at."""
    import numpy as np
    from PIL import Image

    means = [reference.mean(0), values.mean(0)]
    rows = [*means, 10.0 * np.abs(means[1] - means[0])]
    exposure = 0.25 / means[0].mean()
    shown = np.clip(np.concatenate(rows) * exposure, 0.0, 1.0) ** (1 / 2.2)
    Image.fromarray((255.0 * shown + 0.5).astype(np.uint8)).save(file)


if __name__ == "__main__":
    sys.exit(main())
