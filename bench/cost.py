"""What rendering costs: against stock Mitsuba, and how it grows with panorama, objects and triangles."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from statistics import median, quantiles
from typing import Any

import numpy as np
import trimesh
from rich.console import Console

import lightdepth
from bench.after_sampling import after_sampling
from bench.methods.job import MAX_BOUNCES
from bench.places import lamp_and_window
from bench.places.objects import Matte
from bench.places.place import Place
from bench.preparation import preparation
from bench.truth import path_trace
from lightdepth.kernel.start import start
from lightdepth.scene.model import AnalyticShape, Mesh, Scene, SyntheticObject, SyntheticPart

ROOT = Path(__file__).parents[1]


def cost(quick: bool, console: Console, only: str = "") -> dict[str, Any]:
    """All cost measurements whose titles contain ``only``, as tables of text."""
    start()
    tables = []
    for title, make in (
        ("Cost of a camera sample against Mitsuba `path` on the same augmented room, both 8 bounces", _against_path),
        ("Width of the panorama (the objects fill the same share of it)", _widths),
        ("Number of objects", _object_counts),
        ("Triangles of one object", _triangles),
        ("Seconds from starting Python to a draft of the demo, and to another one", _starts),
        (
            "Seconds (of processor) from a scene in memory to one sample of every pixel, and denoised, demo, 640x400",
            preparation,
        ),
        ("Seconds of processor after sampling, demo, 24 samples", after_sampling),
        ("Memory and time of an 8192x4096 panorama in and out", _large),
    ):
        if only not in title:
            continue
        console.print(f"cost: {title}", highlight=False, markup=False)
        head, rows = make(quick)
        tables.append({"title": title, "head": head, "rows": rows})
    return {"tables": tables}


def _timed(scene: Scene, camera: str, samples: int, repeats: int = 3) -> tuple[list[float], Any]:
    """Seconds of rendering with everything prepared and compiled, and the last image."""
    lightdepth.render(scene, camera=camera, samples=samples)
    seconds = []
    for repeat in range(repeats):
        began = time.perf_counter()
        frame = lightdepth.render(scene, camera=camera, samples=samples, seed=repeat + 1)
        seconds.append(time.perf_counter() - began)
    return seconds, frame


def _against_path(quick: bool) -> tuple[list[str], list[list[str]]]:
    """Both in turn, since the speed of a machine changes in the meantime; the median of the ratios of neighbours."""
    import mitsuba as mi

    samples, width, pairs = (8, 128, 3) if quick else (32, 320, 15)
    place = lamp_and_window("mixed")
    stock = mi.load_dict(place.mitsuba_scene(objects=True), optimize=False)
    scene = place.scene(256, 256, view_width=width)
    scene = replace(scene, render=replace(scene.render, max_bounces=MAX_BOUNCES))
    view = scene.cameras["view"]
    ours: list[float] = []
    theirs: list[float] = []
    for pair in range(pairs + 1):
        began = time.perf_counter()
        frame = lightdepth.render(scene, camera="view", samples=samples, seed=pair)
        ours.append((time.perf_counter() - began) / int(frame.samples.astype(np.int64).sum()))
        began = time.perf_counter()
        taken = path_trace(stock, view, samples, pair, MAX_BOUNCES + 1, with_coverage=False).samples
        theirs.append((time.perf_counter() - began) / (taken * width * view.camera.resolution[1]))
    # The first ones prepare and compile.
    ratios = [mine / stocks for mine, stocks in zip(ours[1:], theirs[1:], strict=True)]
    low, middle, high = quantiles(ratios, n=4)
    rows = [
        ["Mitsuba `path`", f"{1e6 * median(theirs[1:]):.2f}", "1"],
        ["lightdepth `difference`", f"{1e6 * median(ours[1:]):.2f}", f"{middle:.2f} ({low:.2f} to {high:.2f})"],
    ]
    return ["renderer", "microseconds a sample", f"ratio: median and quartiles of {pairs} pairs"], rows


def panorama_scene(place: Place, width: int) -> Scene:
    """The room with a photograph of any width: a small one enlarged, which costs the same to render."""
    scene = place.scene(256, 256)
    radiance = np.repeat(np.repeat(scene.panorama.radiance, width // 256, axis=0), width // 256, axis=1)
    camera = place.camera("panorama", width)
    return replace(scene, panorama=replace(scene.panorama, radiance=radiance), cameras={"panorama": camera})


def _widths(quick: bool) -> tuple[list[str], list[list[str]]]:
    """Each width in a process of its own: the largest takes most of a machine's memory."""
    floor_scene()  # The photograph is path-traced and cached before.
    rows = []
    for width in (1024, 2048) if quick else (1024, 2048, 4096, 8192, 16384):
        repeats = 1 if width > 4096 else 3
        code = (
            "import json; from statistics import median; from bench.cost import *; from bench.cost import _timed;"
            f"scene = panorama_scene(floor_only(lamp_and_window('mixed')), {width});"
            f"seconds, frame = _timed(scene, 'panorama', 1, {repeats});"
            "print(json.dumps([median(seconds), int((frame.samples > 0).sum()), frame.samples.size]))"
        )
        try:
            seconds, influenced, pixels = json.loads(_python(code).splitlines()[-1])
        except subprocess.CalledProcessError as error:
            rows.append([f"{width} x {width // 2}", f"failed ({error.returncode}): not enough memory?", "", "", ""])
            continue
        rows.append(
            [
                f"{width} x {width // 2}",
                f"{influenced / 1e6:.3f}",
                f"{influenced / pixels:.1%}",
                f"{seconds:.2f}",
                f"{1e6 * seconds / max(influenced, 1):.2f}",
            ]
        )
    return ["panorama", "influenced, million pixels", "share", "seconds", "microseconds an influenced pixel"], rows


def floor_only(place: Place) -> Place:
    """The place with the floor as its only support: walls give light but are not changed, as in everyday use."""
    return place.with_support(("floor",))


def _object_counts(quick: bool) -> tuple[list[str], list[list[str]]]:
    place, generator, rows = lamp_and_window("matte"), np.random.default_rng(1), []
    for count in (1, 10) if quick else (1, 5, 20, 50, 200):
        objects = []
        for index in range(count):
            radius = 0.3 / np.sqrt(count)
            to_world = np.diag([radius, radius, radius, 1.0])
            to_world[:3, 3] = (*generator.uniform((-1.2, 0.2), (0.9, 2.2)), radius + 0.001)
            color = tuple(float(value) for value in generator.uniform(0.2, 0.8, 3))
            part = SyntheticPart(AnalyticShape("sphere", to_world), Matte(color=color))
            objects.append(SyntheticObject(f"ball {index}", (part,)))
        rows.append([str(count), *_object_row(replace(place, objects=tuple(objects)), quick)])
    return ["objects", "seconds", "microseconds a sample"], rows


def _triangles(quick: bool) -> tuple[list[str], list[list[str]]]:
    place, rows = lamp_and_window("matte"), []
    for wanted in (1_000, 100_000) if quick else (1_000, 10_000, 100_000, 1_000_000, 5_000_000):
        rings = round(np.sqrt(wanted / 4))
        ball = trimesh.creation.uv_sphere(radius=0.4, count=[rings + 1, 2 * rings])
        vertices = (ball.vertices + np.array([0.1, 1.1, 0.401])).astype(np.float32)
        part = SyntheticPart(Mesh(vertices, ball.faces.astype(np.int32)), Matte(color=(0.7, 0.15, 0.1)))
        placed = replace(place, objects=(SyntheticObject("ball", (part,)),))
        rows.append([f"{len(ball.faces):,}", *_object_row(placed, quick)])
    return ["triangles", "seconds", "microseconds a sample"], rows


def _object_row(place: Place, quick: bool) -> list[str]:
    scene = floor_only(place).scene(256, 256, view_width=96 if quick else 320)
    seconds, frame = _timed(scene, "view", 4 if quick else 16)
    return [
        f"{median(seconds):.2f}",
        f"{1e6 * median(seconds) / max(int(frame.samples.astype(np.int64).sum()), 1):.2f}",
    ]


def _python(code: str, **environment: str) -> str:
    """What a Python process of its own prints."""
    path = os.pathsep.join([str(ROOT), str(ROOT / "src")])
    return subprocess.run(
        [sys.executable, "-c", code],
        check=True,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": path, **environment},
        stdout=subprocess.PIPE,
        text=True,
    ).stdout


def _starts(quick: bool) -> tuple[list[str], list[list[str]]]:
    """From nothing to a picture of the demo: a draft of each camera, and once more in the process.

    Cold: with an empty kernel cache; warm: with the one that the first run left.
    """
    rows = []
    for camera in ("view", "dome", "pano"):
        code = (
            "import time; began = time.perf_counter(); import lightdepth;"
            f"scene = lightdepth.load_scene('examples/lounge/scene.toml'); draft = dict(camera={camera!r}, draft=True);"
            "lightdepth.render(scene, **draft); first = time.perf_counter(); lightdepth.render(scene, seed=1, **draft);"
            "print(first - began, time.perf_counter() - first)"
        )
        with tempfile.TemporaryDirectory() as cache:
            runs = [_python(code, DRJIT_CACHE_DIR=cache).split() for _ in range(2 if quick else 4)]
        cold, *warm = ([float(value) for value in run] for run in runs)
        first, again = (median(values) for values in zip(*warm, strict=True))
        rows.append([camera, f"{cold[0]:.1f}", f"{first:.1f}", f"{again:.1f}"])
    return ["camera", "cold: empty kernel cache", "warm: kernels cached", "again in the same process"], rows


def floor_scene() -> Scene:
    """The room with a small photograph, which the larger ones are made from."""
    return panorama_scene(floor_only(lamp_and_window("mixed")), 512)


def _large(quick: bool) -> tuple[list[str], list[list[str]]]:
    width = 2048 if quick else 8192
    code = (
        "import time, lightdepth; from bench.cost import *; from bench.memory import peak_memory;"
        f"scene = panorama_scene(floor_only(lamp_and_window('mixed')), {width});"
        "r = lambda n, s: lightdepth.render(scene, camera='panorama', samples=n, seed=s);"
        "r(1, 0); a = time.perf_counter(); r(1, 1); b = time.perf_counter(); r(3, 2); c = time.perf_counter();"
        "print(peak_memory() / 2**30, (c - b - (b - a)) / 2)"
    )
    floor_scene()
    memory, seconds = _python(code).split()[-2:]
    row = [f"{width} x {width // 2}", f"{float(memory):.2f} GiB", f"{float(seconds):.2f} s"]
    return ["panorama in and out", "peak memory of the process", "time a sample a pixel"], [row]
