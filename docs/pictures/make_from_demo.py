"""Make the README's pictures from the renderings of `make demo`, and from one rendering by the directional method.

make demo
python docs/pictures/make_from_demo.py out/demo
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

import lightdepth
from lightdepth.film.layers import read_frame
from lightdepth.images.tonemapping import auto_exposure, tone_map

HERE = Path(__file__).parent
SCENE = HERE.parents[1] / "examples/lounge/scene.toml"
CROP = (300, 150, 900, 720)
"""The part of the view that holds the objects: left, top, right, bottom in pixels of 1280 x 720."""


def main() -> None:
    """Write the pictures beside this file."""
    demo = Path(sys.argv[1] if len(sys.argv) > 1 else "out/demo")
    view, pano, dome = (read_frame(demo / f"{name}.exr") for name in ("view", "pano", "dome"))
    exposure = auto_exposure(view.plate, view.alpha)
    save("demo-view", tone_map(view.beauty, exposure), 1000)
    save("demo-pano", tone_map(pano.beauty, exposure), 1200)
    picture = tone_map(dome.beauty, exposure)
    picture[dome.alpha < 1.0] = 255
    save("demo-dome", picture, 560)
    before, after = tone_map(view.plate, exposure), tone_map(view.beauty, exposure)
    save("demo-before-after", side_by_side(crop(before), crop(after)), 1000)
    grey = 0.5 + 0.7 * view.change / np.median(view.plate)
    change = np.rint(255 * np.clip(grey, 0, 1)).astype(np.uint8)
    layers = (before, change, tone_map(view.synthetic, exposure))
    save("demo-layers", side_by_side(*map(crop, layers)), 1200)
    if "--demo-only" in sys.argv:
        return

    scene = lightdepth.load_scene(SCENE)
    posed = scene.cameras["view"]
    size = {"width": 640, "height": 360}
    small = replace(posed, camera=posed.camera.model_copy(update=size))
    scene = replace(scene, cameras={"view": small})
    methods = []
    for method in ("difference", "directional"):
        frame = lightdepth.render(scene, "view", 64, method=method, denoise=True)
        methods.append(crop(tone_map(frame.beauty, exposure)))
    save("demo-methods", side_by_side(*methods), 1000)


def crop(pixels: np.ndarray) -> np.ndarray:
    """The part of the view with the objects."""
    left, top, right, bottom = (round(edge * pixels.shape[1] / 1280) for edge in CROP)
    return pixels[top:bottom, left:right]


def side_by_side(*pictures: np.ndarray) -> np.ndarray:
    """Pictures of one size with a white line between them."""
    line = np.full((pictures[0].shape[0], 6, 3), 255, np.uint8)
    parts = [part for picture in pictures for part in (picture, line)]
    return np.concatenate(parts[:-1], axis=1)


def save(name: str, pixels: np.ndarray, width: int) -> None:
    """Write a JPEG of at most this width."""
    picture = Image.fromarray(pixels)
    if picture.width > width:
        picture = picture.resize((width, round(picture.height * width / picture.width)), Image.Resampling.LANCZOS)
    picture.save(HERE / f"{name}.jpg", quality=88, optimize=True)


if __name__ == "__main__":
    main()
