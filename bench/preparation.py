"""What it costs to get ready: a place for the first time, a known place in a new process, a moved object in a session.

``python -m bench.preparation``, the demo's scene. Processor seconds beside wall clock, since other work on the machine
changes only the latter.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
WIDTH, HEIGHT = 640, 400
MOVES = 3
STAGES = ("check", "prepare", "plate and pixels", "first sample of every pixel", "layers and denoising")

SESSION = """
import json, sys, time
from dataclasses import replace
import lightdepth
from lightdepth import api
from lightdepth.kernel.start import start
from lightdepth.scene.model import AnalyticShape

start("cpu")
import lightdepth.checks, lightdepth.preparation
from lightdepth.film.denoising import denoise
from lightdepth.film.rendering import Rendering

def moved(scene, by):
    things = []
    for thing in scene.synthetic:
        if thing.name == "silver ball":
            (part,) = thing.parts
            to_world = part.geometry.to_world.copy()
            to_world[0, 3] += by
            thing = replace(thing, parts=(replace(part, geometry=AnalyticShape(part.geometry.kind, to_world)),))
        things.append(thing)
    return replace(scene, synthetic=tuple(things))

def timed(work):
    clock, processor = time.perf_counter(), time.process_time()
    result = work()
    costs.append((time.perf_counter() - clock, time.process_time() - processor))
    return result

scene = lightdepth.load_scene("examples/lounge/scene.toml")
view = scene.cameras["view"]
view = replace(view, camera=view.camera.model_copy(update={"width": int(sys.argv[1]), "height": int(sys.argv[2])}))
rows = []
for move in range(1 + int(sys.argv[3])):
    costs, now = [], moved(scene, 0.01 * move)
    timed(lambda: api._renderable(now))
    prepared = timed(lambda: api._prepare(now, "difference", True))
    rendering = timed(lambda: Rendering(now, prepared, view, "difference", 0))
    timed(lambda: list(rendering.run(1)))
    timed(lambda: denoise(rendering.frame()))
    rows.append(costs)
print(json.dumps(rows))
"""


def preparation(quick: bool = False) -> tuple[list[str], list[list[str]]]:
    """Head and rows of the table.

    Args:
        quick: one move instead of several.
    """
    moves = 1 if quick else MOVES
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "kernels").mkdir()
        environment = {"LIGHTDEPTH_CACHE": f"{folder}/places", "DRJIT_CACHE_DIR": f"{folder}/kernels"}
        cold, *_ = _session(0, environment)
        known, *after = _session(moves, environment)
    rows = [_row("unknown place, no kernel compiled", cold), _row("known place, new process", known)]
    rows += [_row(f"object moved, {number}. time", costs) for number, costs in enumerate(after, 1)]
    return ["", *STAGES, "all"], rows


def _session(moves: int, environment: dict[str, str]) -> list[list[tuple[float, float]]]:
    """Wall-clock and processor seconds of each stage: of the demo, and after each move of an object."""
    path = os.pathsep.join([str(ROOT), str(ROOT / "src")])
    command = [sys.executable, "-c", SESSION, str(WIDTH), str(HEIGHT), str(moves)]
    environment = {**os.environ, "PYTHONPATH": path, **environment}
    output = subprocess.run(command, check=True, cwd=ROOT, env=environment, stdout=subprocess.PIPE, text=True).stdout
    costs: list[Any] = json.loads(output.splitlines()[-1])
    return costs


def _row(name: str, costs: list[tuple[float, float]]) -> list[str]:
    total = (sum(wall for wall, _ in costs), sum(processor for _, processor in costs))
    return [name, *(f"{wall:.2f} ({processor:.2f})" for wall, processor in [*costs, total])]


def main() -> None:
    """Print the table."""
    head, rows = preparation()
    for row in [head, *rows]:
        print(" | ".join(row))


if __name__ == "__main__":
    main()
