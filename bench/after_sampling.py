"""What the demo's three pictures cost after sampling: layers, denoising, writing, each as a share of the sampling.

``python -m bench.after_sampling``; processor seconds, since other work on the machine changes the wall clock.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import lightdepth
from lightdepth.kernel.start import start

ROOT = Path(__file__).parents[1]
CAMERAS = ("view", "dome", "pano")
SAMPLES = 24
STAGES = ("sampling", "layers", "denoising", "EXR", "PNG")
Made = TypeVar("Made")


def after_sampling(quick: bool = False) -> tuple[list[str], list[list[str]]]:
    """Head and rows of the table.

    Args:
        quick: few samples, so that the shares are too large.
    """
    start()
    from lightdepth.film.denoising import denoise
    from lightdepth.film.layers import write_frame, write_picture

    samples = 2 if quick else SAMPLES
    scene = lightdepth.load_scene(ROOT / "examples/lounge/scene.toml")
    rows, total = [], [0.0] * len(STAGES)
    for camera in CAMERAS:
        lightdepth.render(scene, camera, samples=1, denoise=True)  # So that all kernels are compiled.
        costs: list[float] = []

        def timed(work: Callable[[], Made], costs: list[float] = costs) -> Made:
            began = time.process_time()
            made = work()
            costs.append(time.process_time() - began)
            return made

        rendering = lightdepth.begin_rendering(scene, camera, seed=1)
        timed(lambda rendering=rendering: list(rendering.run(samples)))  # type: ignore[misc]
        frame = timed(lambda rendering=rendering: rendering.frame(finish=True))  # type: ignore[misc]
        clean = timed(lambda frame=frame: denoise(frame))  # type: ignore[misc]
        with tempfile.TemporaryDirectory() as folder:
            timed(lambda clean=clean, folder=folder: write_frame(Path(folder) / "a.exr", clean))  # type: ignore[misc]
            timed(lambda clean=clean, folder=folder: write_picture(Path(folder) / "a.png", clean))  # type: ignore[misc]
        total = [sum(pair) for pair in zip(total, costs, strict=True)]
        rows.append(_row(camera, costs))
    return ["camera", *STAGES, "after sampling"], [*rows, _row("all", total)]


def _row(name: str, costs: list[float]) -> list[str]:
    return [name, *(f"{each:.2f}" for each in costs), f"{sum(costs[1:]) / costs[0]:.0%}"]


def main() -> None:
    """Print the table."""
    head, rows = after_sampling()
    for row in [head, *rows]:
        print(" | ".join(row))


if __name__ == "__main__":
    main()
