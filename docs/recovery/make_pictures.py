"""Make the picture of clipped light: a low sun over a park, clipped on purpose, recovered, and as it is.

python docs/recovery/make_pictures.py FOLDER

FOLDER holds `rooitou_park_1k.hdr` of Poly Haven (CC0). The whole panorama is the truth here: the picture shows the objects
in the light of the clipped panorama, of the recovered one, and of the whole one.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

import lightdepth
from lightdepth.film.frame import Frame
from lightdepth.images.radiance import read_radiance, write_radiance
from lightdepth.images.tonemapping import auto_exposure, tone_map
from lightdepth.lighting.explained import ExplainedLight
from lightdepth.lighting.panorama_view import PanoramaView
from lightdepth.scene.load import load_scene

HERE = Path(__file__).parent
LEVEL = 8.0
"""Times its mean at which a panorama is clipped."""
SAMPLES = 64
COMMAND = [sys.executable, "-c", "from lightdepth.cli.app import main; main()"]

PARK = """[panorama]
image = "pano.exr"
position = [0.0, 0.0, 1.6]
sky = true

[[real]]
name = "meadow"
mesh = "meadow.obj"
role = "support"

[[synthetic]]
name = "ball"
shape = "sphere"
at = [300, 360]
radius = 0.35
material = { type = "diffuse", color = [0.6, 0.6, 0.6] }

[[synthetic]]
name = "post"
shape = "cube"
at = [352, 352]
scale = [0.06, 0.06, 0.5]
material = { type = "diffuse", color = [0.55, 0.2, 0.15] }

[camera.view]
type = "perspective"
width = 400
height = 320
fov = 58
look_at = [-2.6, 0.2, 0.3]
"""
PARK_GREY = ((200, 380), (500, 400), (800, 390))
"""Pixels of the meadow whose albedo is known: from the whole panorama, as with a grey card."""


def main() -> None:
    """Write the picture beside this file."""
    with tempfile.TemporaryDirectory() as folder:
        park(Path(sys.argv[1]), Path(folder))


def park(data: Path, folder: Path) -> None:
    """A low sun over a meadow, from places of known albedo: nothing that is modelled throws a shadow."""
    scene = folder / "park.toml"
    scene.write_text(PARK)
    (folder / "meadow.obj").write_text("v -60 -60 0\nv 60 -60 0\nv 60 60 0\nv -60 60 0\nf 1 2 3 4\n")
    whole = read_radiance(data / "rooitou_park_1k.hdr")
    write_radiance(folder / "pano.exr", whole)
    loaded = load_scene(scene)
    view, places = PanoramaView(loaded), np.array(PARK_GREY) + 0.5
    seen = view.look(places)
    light = ExplainedLight(loaded.panorama, loaded.real).irradiance(seen.point, seen.normal, 1024)
    around = [np.array([x, y]) for x in (-1, 0, 1) for y in (-1, 0, 1)]
    albedo = np.pi * np.mean([view.colour(places + step) for step in around], axis=0) / light
    grey = []
    for (x, y), (red, green, blue) in zip(places, albedo, strict=True):
        grey += ["--grey", f"{x},{y} {red:.4f} {green:.4f} {blue:.4f}"]
    write_radiance(folder / "pano.exr", cut(whole))
    three(scene, whole, grey, "park-clipped")


def cut(radiance: np.ndarray) -> np.ndarray:
    """A panorama that is clipped at ``LEVEL`` times its mean."""
    return np.minimum(radiance, np.float32(LEVEL * radiance.mean()))


def three(scene: Path, whole: np.ndarray, options: list[str], name: str) -> None:
    """Render with the clipped panorama, with what is recovered from it, and with the whole one."""
    frames = [render(scene)]
    run("recover", "clipped", scene, *options, "--write")
    frames.append(render(scene))
    text = scene.read_text()
    scene.write_text(text[: text.index("[[light]]")])
    write_radiance(scene.parent / "pano.exr", whole)
    frames.append(render(scene))
    exposure = auto_exposure(frames[2].plate, frames[2].alpha)
    pictures = [tone_map(frame.beauty, exposure) for frame in frames]
    line = np.full((len(pictures[0]), 6, 3), 255, np.uint8)
    row = np.concatenate([pictures[0], line, pictures[1], line, pictures[2]], axis=1)
    Image.fromarray(row).save(HERE / f"{name}.jpg", quality=88, optimize=True)
    for label, frame in zip(("clipped", "recovered"), frames, strict=False):
        covered = frame.alpha > 0.99
        off = frame.beauty[covered].mean() / frames[2].beauty[covered].mean() - 1.0
        print(f"{name}: objects in {label} light are {100 * off:+.1f} % off those in the whole panorama's")


def render(scene: Path) -> Frame:
    """The scene's view, denoised."""
    return lightdepth.render(lightdepth.load_scene(scene), camera="view", samples=SAMPLES, denoise=True)


def run(*arguments: object) -> None:
    """A command of lightdepth."""
    subprocess.run([*COMMAND, *map(str, arguments)], check=True)


if __name__ == "__main__":
    main()
