"""Render the three pictures of the example: the full panorama, the fulldome fisheye, and a perspective view.

Usage: `python examples/lounge/demo.py [FOLDER]`; EXR and PNG files go to `out/demo/` by default.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

import lightdepth
from lightdepth.film.layers import write_frame, write_picture

SCENE = Path(__file__).with_name("scene.toml")
SAMPLES = {"view": 32, "dome": 24, "pano": 24}


def main() -> None:
    """Render, and tell where the pictures are."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "out/demo")
    folder.mkdir(parents=True, exist_ok=True)
    console = Console(highlight=False, soft_wrap=True)
    started = time.monotonic()
    bar = Progress(
        TextColumn("{task.description:>5}"),
        BarColumn(),
        TextColumn("{task.percentage:>3.0f} %"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=console,
    )
    with bar:
        tasks = {camera: bar.add_task(camera, total=1.0, start=False) for camera in SAMPLES}
        scene = lightdepth.load_scene(SCENE)
        for camera, samples in SAMPLES.items():
            task = tasks[camera]
            bar.start_task(task)
            frame = lightdepth.render(
                scene,
                camera,
                samples,
                denoise=True,
                progress=lambda step, task=task: bar.update(task, completed=step.fraction),
            )
            write_frame(folder / f"{camera}.exr", frame)
            write_picture(folder / f"{camera}.png", frame)
    console.print(f"Rendered in {time.monotonic() - started:.0f} seconds. The pictures, each as EXR and PNG:")
    for camera in SAMPLES:
        console.print(f"  {(folder / camera).resolve()}.exr, .png")


if __name__ == "__main__":
    main()
