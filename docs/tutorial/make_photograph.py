"""Make the room of docs/tutorial/photograph.md, run its commands, and keep the pictures.

Run it from the repository's root with the package installed: python docs/tutorial/make_photograph.py

The room is that of the tests, path-traced: a small panorama of 1024 pixels, and a photograph from elsewhere through a lens
that distorts, as a JPEG with an exposure and a white balance of its own. All files stay in out/photograph.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(ROOT))

from tests.support.textured_room import (  # noqa: E402
    CAPTURE,
    HIGH,
    LOW,
    ROTATION,
    RUG,
    panorama_view,
    trace,
    true_surfaces,
)

from lightdepth.cameras import Perspective  # noqa: E402
from lightdepth.directions import look_at_rotation  # noqa: E402
from lightdepth.film.layers import read_frame  # noqa: E402
from lightdepth.images.exr import ExrPart, write_exr  # noqa: E402
from lightdepth.kernel.start import start  # noqa: E402
from lightdepth.reconstruction.scene_file import write_meshes  # noqa: E402
from lightdepth.scene.model import CameraView  # noqa: E402

WORK = ROOT / "out/photograph"
LENS = Perspective(type="perspective", width=480, height=320, fov=68, distortion=(-0.18, 0.04))
POSITION = np.array([-0.9, -1.2, 1.45])
VIEW = CameraView(LENS, POSITION, look_at_rotation(POSITION, (1.0, 1.1, 0.3)))
SAMPLES = 256
EXPOSED = np.float32([0.95, 0.8, 0.66])
SUPPORT = ("floor", "rug", "ceiling", "front", "back", "left", "right")
OBJECTS = """
[[synthetic]]
name = "ball"
shape = "sphere"
center = [1.15, 1.05, 0.28]
radius = 0.28
material = { type = "principled", base_color = [0.05, 0.25, 0.6], roughness = 0.25, clearcoat = 1.0 }

[[synthetic]]
name = "box"
shape = "cube"
position = [0.55, 1.45, 0.17]
rotation = [0, 0, 28]
scale = 0.17
material = { type = "diffuse", color = [0.7, 0.68, 0.6] }

[render]
samples = 128
irradiance_samples = 512
"""
PLATE = """
[plate]
image = "photo.jpg"
camera = "photo"
"""


def main() -> None:
    """Write the room, run the commands, write the pictures."""
    start()
    WORK.mkdir(parents=True, exist_ok=True)
    panorama = trace(panorama_view(1024), 64).mean.astype(np.float32)
    photo = trace(VIEW, SAMPLES, seed=5).mean.astype(np.float32)
    write_exr(WORK / "room.exr", [ExrPart({"RGB": panorama})])
    cv2.imwrite(str(WORK / "photo.jpg"), _screen(photo * EXPOSED)[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 97])
    real = true_surfaces(SUPPORT)
    write_meshes(real, WORK)
    tables = [f'\n[[real]]\nname = "{each.name}"\nmesh = "{each.name}.ply"\nrole = "{each.role}"\n' for each in real]
    pose = f"position = {CAPTURE.tolist()}\nrotation = {ROTATION.tolist()}\n"
    scene = WORK / "room.toml"
    scene.write_text("".join(['[panorama]\nimage = "room.exr"\n', pose, *tables, OBJECTS]))
    _lightdepth(
        *("calibrate", "view", "photo.jpg", *_clicks(), "--distortion", "free"),
        *("--write", "room.toml", "--name", "photo", "--picture", "check.png"),
    )
    _lightdepth("render", "room.toml", "--camera", "photo", "--denoise", "-o", "panorama.exr")
    scene.write_text(scene.read_text() + PLATE)
    _lightdepth("check", "room.toml")
    _lightdepth("render", "room.toml", "--camera", "photo", "--denoise", "-o", "photo.exr")
    _write_pictures()


def _clicks() -> list[str]:
    """Edges and points of the room as a person clicks them, to half a pixel, as options."""
    left, right = LOW[0], HIGH[0]
    lines = {
        "--x-line": [(RUG[0], RUG[1]), (RUG[3], RUG[2]), ((left + 1.0, HIGH[1], 0), (right, HIGH[1], 0))],
        "--y-line": [(RUG[0], RUG[3]), (RUG[1], RUG[2]), ((right, 1.2, 0), (right, HIGH[1], 0))],
        "--z-line": [((right, HIGH[1], 0.0), (right, HIGH[1], 1.6))],
    }
    result = []
    for option, edges in lines.items():
        for first, last in edges:
            along = np.linspace(0.0, 1.0, 5)[:, None]
            clicked = _pixels(np.asarray(first) + along * (np.asarray(last, float) - np.asarray(first)))
            result += [option, " ".join(f"{x:g},{y:g}" for x, y in clicked)]
    for corner in (*RUG, np.array([right, HIGH[1], 0.0])):
        ((x, y),) = _pixels(corner[None])
        result += ["--point", f"{x:g},{y:g} = {','.join(f'{value:g}' for value in corner)}"]
    return result


def _pixels(points: NDArray[np.float64]) -> NDArray[np.float64]:
    film, _ = LENS.film_of((points - POSITION) @ VIEW.rotation)
    return np.asarray(np.round(2.0 * film * LENS.resolution) / 2.0)


def _lightdepth(*arguments: str) -> None:
    print("$ lightdepth", " ".join(f'"{each}"' if " " in each else each for each in arguments))
    code = "from lightdepth.cli.app import main; main()"
    subprocess.run([sys.executable, "-c", code, *arguments], cwd=WORK, check=False)


def _screen(radiance: NDArray[np.float32]) -> NDArray[np.uint8]:
    """As a camera without a look saves it."""
    value = np.clip(radiance, 0.0, 1.0)
    curve = np.where(value <= 0.0031308, 12.92 * value, 1.055 * value ** (1.0 / 2.4) - 0.055)
    return np.rint(255.0 * curve).astype(np.uint8)


def _write_pictures() -> None:
    """Photograph and panorama; what each becomes as a picture; both enlarged at the shadow."""
    panorama = cv2.imread(str(WORK / "photo.jpg"))[..., ::-1]
    from_panorama, from_photo = (read_frame(WORK / f"{name}.exr") for name in ("panorama", "photo"))
    finished = _screen(from_photo.beauty)
    soft = _screen(from_panorama.beauty * EXPOSED)
    gap = np.full((LENS.height, 6, 3), 255, np.uint8)
    top = np.concatenate([panorama, gap, finished], axis=1)
    here = slice(140, 140 + 100), slice(215, 215 + 150)
    large = [
        cv2.resize(image[here], (LENS.width, LENS.height), interpolation=cv2.INTER_NEAREST)
        for image in (soft, finished)
    ]
    bottom = np.concatenate([large[0], gap, large[1]], axis=1)
    between = np.full((6, top.shape[1], 3), 255, np.uint8)
    whole = np.concatenate([top, between, bottom])
    cv2.imwrite(str(HERE / "photograph.jpg"), whole[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 88])


if __name__ == "__main__":
    main()
