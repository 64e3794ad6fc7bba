"""Go the way of docs/tutorial.md with photographs of a virtual room, and keep the pictures that the commands make.

Run it from the repository's root with the package installed (Hugin's tools as well): python docs/tutorial/make_pictures.py

The photographs, the commands' output and the files stay in out/tutorial.
"""

from __future__ import annotations

import json
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
from PIL import Image

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(ROOT))

from tests.support import textured_room as room  # noqa: E402
from tests.support.photography import PAPER_RIG, TestCamera, rig_rotation, shoot  # noqa: E402

from lightdepth.directions import euler_rotation  # noqa: E402

WORK = ROOT / "out/tutorial"
TIMES = [64 * 4.0 ** (3 - index) for index in range(9)]
WIDTH = 1024
OBJECTS = """
[[synthetic]]
name = "clay ball"
shape = "sphere"
center = [0.35, 1.45, 0.3]
radius = 0.3
material = { type = "diffuse", color = [0.65, 0.3, 0.2] }

[[synthetic]]
name = "brass block"
shape = "cube"
position = [1.15, 1.2, 0.251]
rotation = [0.0, 0.0, 30.0]
scale = [0.2, 0.2, 0.25]
material = { type = "principled", base_color = [0.9, 0.8, 0.6], metallic = 1.0, roughness = 0.4 }

[camera.view]
type = "perspective"
width = 640
height = 480
fov = 58
position = [0.7, -0.9, 1.35]
look_at = [0.75, 1.3, 0.3]

[camera.pano]
type = "equirectangular"
width = 1024
"""


def main() -> None:
    """Photograph, then run every command of the tutorial."""
    shutil.rmtree(WORK, ignore_errors=True)
    (WORK / "shoot").mkdir(parents=True)
    panorama = room.trace(room.panorama_view(WIDTH), 64, seed=2).mean.astype(np.float32)
    rng = np.random.default_rng(1)
    true = [rig_rotation(*(np.array([yaw, pitch, 0]) + rng.normal(0, 1.5, 3))) for yaw, pitch in PAPER_RIG]
    bracket, *_ = shoot(panorama, true, TIMES, WORK / "shoot", TestCamera(size=(640, 640), distortion=0.01))
    save(
        "bracket", np.concatenate([np.asarray(Image.open(path).resize((220, 220))) for path in bracket[1:8:2]], axis=1)
    )

    first = [str(path.relative_to(WORK)) for path in bracket]
    run("capture merge", *first, "-o view.exr --circle auto --save-response camera.json")
    run("capture stitch shoot -o room.exr --circle auto --rig paper --fov 180 --response camera.json",
        f"--width {WIDTH} --report stitch.json")  # fmt: skip
    keep("room.png", "stitched")

    images = json.loads((WORK / "stitch.json").read_text())["images"]
    found = [rig_rotation(one["yaw"], one["pitch"], one["roll"]) for one in images]
    u, _, vt = np.linalg.svd(sum(t @ f.T for t, f in zip(true, found, strict=True)))
    to_world = euler_rotation(room.ROTATION) @ u @ np.diag([1, 1, np.linalg.det(u @ vt)]) @ vt

    (WORK / "room.toml").write_text('[panorama]\nimage = "room.exr"\n' + OBJECTS)
    edges = [np.array([[x, y, 0.0], [x, y, room.HIGH[2]]]) for x, y, _ in room.FLOOR]
    run("calibrate room.exr --rectangle", clicks(room.RUG, to_world), "--width 1.6 --length 2.2",
        *(word for edge in edges for word in ("--vertical", clicks(edge, to_world))),
        "--write room.toml --picture calibration.png")  # fmt: skip
    keep("calibration.png", "calibration")
    run("reconstruct layout room.toml --floor", clicks(room.FLOOR, to_world),
        "--ceiling-corner", clicks(room.CEILING_CORNER, to_world),
        "-o meshes --write room.toml --picture layout.png")  # fmt: skip
    keep("layout.png", "layout")
    run("reconstruct lights room.toml --count 3 --picture lights.png")
    keep("lights.png", "lights")
    run("check room.toml")
    run("render room.toml --camera view --samples 64 --denoise -o view-with-objects.exr --layers none")
    keep("view-with-objects.png", "view")
    run("render room.toml --camera pano --samples 32 --denoise -o pano-with-objects.exr --layers none")
    keep("pano-with-objects.png", "pano")
    print((WORK / "room.toml").read_text())


def clicks(points: np.ndarray, to_world: np.ndarray) -> str:
    """Where a person would click."""
    return room.clicks(points, WIDTH, to_world)


def run(command: str, *arguments: str) -> None:
    """Call lightdepth in the tutorial's folder and show what it prints."""
    words = command.split()
    for argument in arguments:
        words += [argument] if "," in argument else argument.split()
    print("$ lightdepth", shlex.join(words), flush=True)
    code = "from lightdepth.cli.app import main; main()"
    subprocess.run([sys.executable, "-c", code, *words], cwd=WORK, check=True)


def keep(file: str, name: str) -> None:
    """A picture of the commands as a small JPEG for the tutorial."""
    save(name, np.asarray(Image.open(WORK / file).convert("RGB")))


def save(name: str, pixels: np.ndarray) -> None:
    """Write a JPEG beside this file."""
    Image.fromarray(pixels).save(HERE / f"{name}.jpg", quality=85, optimize=True)


if __name__ == "__main__":
    main()
