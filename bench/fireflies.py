"""Fireflies that are left in denoised first pictures of photographed places, and the light that denoising loses.

Each panorama of :data:`SHOTS` gets the scene that ``lightdepth new`` guesses for it, with two balls. Its view is rendered
with few samples and denoised, and compared with many samples of other random numbers.
"""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

import lightdepth
from bench.boxes import PHOTOGRAPHS
from lightdepth.film.frame import Frame
from lightdepth.images.panorama_file import read_panorama
from lightdepth.images.tonemapping import LUMINANCE
from lightdepth.images.validation import validate_panorama
from lightdepth.quickstart.objects import NewObject, default_objects
from lightdepth.quickstart.place import guess_place
from lightdepth.quickstart.pose import guess_pose
from lightdepth.quickstart.scene import group_width, write_first_scene
from lightdepth.quickstart.spot import find_floor_spot
from lightdepth.scene.model import Scene

WIDTH = 320
"""Of the pictures, pixels."""
SAMPLES, REFERENCE, SEEDS = 32, 128, 2
"""Samples of a pixel, those of the reference, and how many pictures of few samples."""
BRIGHT, VISIBLE = 2.0, 0.1
"""A firefly is this many times as bright as the reference, and brighter by this share of the picture's mean."""
WHITE = 5.0
"""Times the picture's mean: what is brighter is white on a screen, and errors there are not seen."""


@dataclass(frozen=True)
class Shot:
    """A first picture.

    Attributes:
        name: of the row.
        image: the panorama's file.
        camera_height: metres.
        balls: chrome and grey, else silver of roughness 0.3 and matte red.
    """

    name: str
    image: str
    camera_height: float
    balls: bool


SHOTS = (
    Shot("café with lamps", "comfy_cafe_1k.hdr", 1.6, True),
    Shot("courtyard in the sun", "modern_buildings_2_1k.hdr", 1.6, True),
    Shot("hotel room", "interior_hotelroom_1k.exr", 1.3, False),
    Shot("room with bright windows", "lebombo_1k.hdr", 1.6, False),
)


def fireflies(quick: bool, console: Console) -> dict[str, Any]:
    """Render and compare all shots.

    Args:
        quick: only the first shot.
        console: for progress.

    Raises:
        SetupError: Open Image Denoise is not installed.
    """
    from lightdepth.film.denoising import denoise

    rows = []
    for shot in SHOTS[:1] if quick else SHOTS:
        with tempfile.TemporaryDirectory() as folder:
            scene = _scene(shot, Path(folder))
        reference = lightdepth.render(scene, "view", samples=REFERENCE, seed=SEEDS)
        for seed in range(SEEDS):
            noisy = lightdepth.render(scene, "view", samples=SAMPLES, seed=seed)
            for words, frame in (("", noisy), (", denoised", denoise(noisy))):
                rows.append([f"{shot.name}, seed {seed}{words}", *_compared(frame, noisy, reference)])
                console.print("   ".join(rows[-1]), highlight=False, markup=False)
    title = f"Fireflies at {SAMPLES} samples a pixel"
    head = ["picture", "root mean square error", "fireflies", "light of the objects", "light of the change"]
    return {"title": title, "head": head, "rows": rows}


def _compared(frame: Frame, noisy: Frame, reference: Frame) -> list[str]:
    """Error in % of the mean, pixels that are fireflies, and the light of both layers against that of the samples."""
    seen, true = (_picture(each) for each in (frame, reference))
    mean = true.mean()
    error = np.sqrt(((np.minimum(seen, WHITE * mean) - np.minimum(true, WHITE * mean)) ** 2).mean()) / mean
    spots = (seen > BRIGHT * true) & (seen > true + VISIBLE * mean)
    lights = []
    for layer in ("synthetic", "change"):
        # A change's two signs cancel in part: what is lost counts against the sum of both.
        now, before = (getattr(each, layer).sum(dtype=np.float64) for each in (frame, noisy))
        whole = np.abs(getattr(reference, layer)).sum(dtype=np.float64)
        lights.append(f"{100.0 * (now - before) / whole:+.2f} %")
    return [f"{100.0 * error:.2f} %", str(int(spots.sum())), *lights]


def _picture(frame: Frame) -> NDArray[np.float64]:
    """Luminance of the finished picture."""
    radiance = frame.plate * (1.0 - frame.coverage[..., None]) + frame.change + frame.synthetic
    return np.asarray(radiance @ LUMINANCE, np.float64)


def _scene(shot: Shot, folder: Path) -> Scene:
    """The scene that ``lightdepth new`` writes, with a small view."""
    path = PHOTOGRAPHS / shot.image
    image = read_panorama(path)
    radiance = validate_panorama(image.radiance, path, repair=True)
    pose = guess_pose(replace(image, radiance=radiance), shot.camera_height)
    place = guess_place(radiance, pose)
    things = (
        default_objects() if shot.balls else [_dressed(*pair) for pair in zip(default_objects(), DRESS, strict=True)]
    )
    half = 0.5 * group_width(things)
    distance = pose.height * min(0.8 + 2.0 * half, 1.7) + half
    spot = find_floor_spot(radiance, pose, place, half, 0.5 * float(things[0].size[0]), distance)
    write_first_scene(folder / "scene.toml", path, pose, place, things, spot, radiance)
    scene = lightdepth.load_scene(folder / "scene.toml", repair=True)
    view = scene.cameras["view"]
    across, high = view.camera.resolution
    size = {"width": WIDTH, "height": round(WIDTH * high / across)}
    return replace(scene, cameras={"view": replace(view, camera=view.camera.model_copy(update=size))})


DRESS = (
    ("silver", {"type": "metal", "name": "Ag", "roughness": 0.3}),
    ("red", {"type": "diffuse", "color": [0.6, 0.05, 0.04]}),
)
"""Names and materials of the balls that are not chrome and grey."""


def _dressed(ball: NewObject, dress: tuple[str, dict[str, Any]]) -> NewObject:
    name, material = dress
    return replace(ball, name=name, keys={**ball.keys, "material": material})
