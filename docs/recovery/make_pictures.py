"""Make the pictures of real panoramas: a window's sun recovered, and clipped light recovered.

python docs/recovery/make_pictures.py FOLDER [NAME ...]

FOLDER holds `lebombo_1k.hdr`, `rooitou_park_1k.hdr` and `comfy_cafe_1k.hdr` of Poly Haven (CC0); NAME is `lebombo`,
`park` or `cafe`, by default all.
Of clipped light the whole panorama is the truth: the picture shows the objects in the light of the clipped panorama, of the
recovered one, and of the whole one.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Sequence
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
SHADOW = 0.8
"""Share of the light that stays, up to which a pixel counts as shadow."""
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


LEBOMBO = """[panorama]
image = "pano.exr"
position = [0.0, 0.0, 1.5]

[[real]]
name = "floor"
mesh = "floor.obj"
role = "support"

[[real]]
name = "window wall"
mesh = "window wall.obj"
role = "support"

[[real]]
name = "window"
mesh = "window.obj"
role = "environment"
opening = true

[[real]]
name = "right wall"
mesh = "right wall.obj"
role = "support"

[[real]]
name = "rest"
mesh = "rest.obj"
role = "environment"

[[synthetic]]
name = "ball"
shape = "sphere"
center = [2.35, -0.55, 0.25]
radius = 0.25
material = { type = "diffuse", color = [0.7, 0.7, 0.7] }

[camera.view]
type = "perspective"
width = 480
height = 300
fov = 70
look_at = [2.6, -0.3, 0.3]
"""
CORNERS = np.array([[3.578, 0.735], [-1.509, 3.17], [-3.661, -1.55], [1.426, -3.986]])
"""Of the room's floor, metres, by clicks, around it; between the first two stands the wall with the window,"""
HEIGHT, SIDES, RISE = 3.511, (0.0434, 0.5347), (0.05, 2.02)
"""up to the ceiling; the window's sides along this wall, as shares of it, and its lower and upper edge, metres."""


def main() -> None:
    """Write the pictures beside this file."""
    data, *names = sys.argv[1:]
    for name in names or PICTURES:
        with tempfile.TemporaryDirectory() as folder:
            PICTURES[name](Path(data), Path(folder))


def lebombo(data: Path, folder: Path) -> None:
    """The sun of a window, with the pattern of its bars: a ball in its patch, without and with it."""
    scene = folder / "room.toml"
    scene.write_text(LEBOMBO)
    write_radiance(folder / "pano.exr", read_radiance(data / "lebombo_1k.hdr"))

    def wall(first: int, second: int) -> list[np.ndarray]:
        low = CORNERS[[first, second]]
        return [np.array([[*low[0], 0.0], [*low[0], HEIGHT], [*low[1], HEIGHT], [*low[1], 0.0]])]

    def part(left: float, right: float, low: float, high: float) -> np.ndarray:
        along = CORNERS[0] + np.array([[left], [right]]) * (CORNERS[1] - CORNERS[0])
        return np.array([[*along[0], low], [*along[0], high], [*along[1], high], [*along[1], low]])

    (left, right), (low, high) = SIDES, RISE
    around = [(0.0, left, 0.0, HEIGHT), (right, 1.0, 0.0, HEIGHT), (left, right, 0.0, low), (left, right, high, HEIGHT)]
    surfaces = {
        "floor": [np.insert(CORNERS, 2, 0.0, axis=1)],
        "window wall": [part(*edges) for edges in around],
        "window": [part(*SIDES, *RISE)],
        "right wall": wall(3, 0),
        "rest": [np.insert(CORNERS[::-1], 2, HEIGHT, axis=1), *wall(1, 2), *wall(2, 3)],
    }
    for name, quads in surfaces.items():
        write_quads(folder / f"{name}.obj", quads)
    frames = [render(scene)]
    run("recover", "sun", scene, "--mask", folder / "mask.exr", "--picture", folder / "sun.png", "--write")
    frames.append(render(scene))
    side_by_side(frames, 0, "lebombo-ball", stops=0.9)
    outlines = Image.open(folder / "sun.png").convert("RGB")
    outlines = outlines.resize((1024, 512), Image.Resampling.LANCZOS).crop((0, 128, 1024, 448))
    outlines.save(HERE / "lebombo-sun.jpg", quality=88, optimize=True)


def write_quads(file: Path, quads: list[np.ndarray]) -> None:
    """Quadrilaterals, each of shape (4, 3), as an OBJ file."""
    lines = [f"v {x:.4f} {y:.4f} {z:.4f}" for quad in quads for x, y, z in quad]
    lines += [f"f {first} {first + 1} {first + 2} {first + 3}" for first in range(1, 4 * len(quads), 4)]
    file.write_text("\n".join(lines) + "\n")


def park(data: Path, folder: Path) -> None:
    """A low sun over a meadow, from places of known albedo: nothing that is modelled throws a shadow."""
    scene = folder / "park.toml"
    scene.write_text(PARK)
    (folder / "meadow.obj").write_text("v -60 -60 0\nv 60 -60 0\nv 60 60 0\nv -60 60 0\nf 1 2 3 4\n")
    whole = read_radiance(data / "rooitou_park_1k.hdr")
    write_radiance(folder / "pano.exr", whole)
    grey = known_albedo(scene, PARK_GREY)
    write_radiance(folder / "pano.exr", cut(whole, LEVEL))
    three(scene, whole, grey, "park-clipped")


CAFE = """[panorama]
image = "pano.exr"
position = [0.0, 0.0, 1.6]
rotation = [-0.361, 0.052, -44.16]

[[synthetic]]
name = "ball"
shape = "sphere"
at = [330, 405]
radius = 0.2
material = { type = "diffuse", color = [0.6, 0.6, 0.6] }

[[synthetic]]
name = "post"
shape = "cube"
at = [405, 400]
scale = [0.08, 0.08, 0.35]
material = { type = "diffuse", color = [0.55, 0.2, 0.15] }

[camera.view]
type = "perspective"
width = 400
height = 320
fov = 62
look_at = [-0.16, 1.35, 0.1]
"""
CAFE_FLOOR, CAFE_CEILING = "1014.7,326.6 739.4,308.9 502.4,297.6 310.0,305.5", 3.4
"""Corners of the floor by clicks, and metres up to the ceiling."""
CAFE_LEVEL, CAFE_GREY = 2.0, ((300, 425), (365, 435), (430, 425))


def cafe(data: Path, folder: Path) -> None:
    """A cafe's lamps: falloff determines none of them, three places of known albedo on the floor their sum."""
    scene = folder / "cafe.toml"
    whole = read_radiance(data / "comfy_cafe_1k.hdr")
    write_radiance(folder / "pano.exr", whole)
    scene.write_text(CAFE)
    options = ("--floor", CAFE_FLOOR, "--ceiling", CAFE_CEILING, "-o", folder, "--write", scene)
    run("reconstruct", "layout", scene, *options)
    grey = known_albedo(scene, CAFE_GREY)
    write_radiance(folder / "pano.exr", cut(whole, CAFE_LEVEL))
    run("recover", "clipped", scene)
    three(scene, whole, grey, "cafe-clipped")


def known_albedo(scene: Path, places: Sequence[tuple[int, int]]) -> list[str]:
    """Options that give places the albedo that the whole panorama explains, as a grey card would have a known one."""
    loaded = load_scene(scene)
    view, middles = PanoramaView(loaded), np.array(places) + 0.5
    seen = view.look(middles)
    light = ExplainedLight(loaded.panorama, loaded.real).irradiance(seen.point, seen.normal, 1024)
    around = [np.array([x, y]) for x in (-1, 0, 1) for y in (-1, 0, 1)]
    albedo = np.pi * np.mean([view.colour(middles + step) for step in around], axis=0) / light
    options = []
    for (x, y), (red, green, blue) in zip(places, albedo, strict=True):
        options += ["--grey", f"{x},{y} {red:.4f} {green:.4f} {blue:.4f}"]
    return options


def cut(radiance: np.ndarray, level: float) -> np.ndarray:
    """A panorama clipped at a multiple of its mean."""
    return np.minimum(radiance, np.float32(level * radiance.mean()))


def three(scene: Path, whole: np.ndarray, options: list[str], name: str) -> None:
    """Render with the clipped panorama, with what is recovered from it, and with the whole one."""
    frames = [render(scene)]
    run("recover", "clipped", scene, *options, "--write")
    frames.append(render(scene))
    text = scene.read_text()
    scene.write_text(text[: text.index("[[light]]")])
    write_radiance(scene.parent / "pano.exr", whole)
    frames.append(render(scene))
    side_by_side(frames, 2, name)
    covered = frames[2].coverage == 1.0
    shaded = ~covered & (frames[2].shadow.astype(float).mean(axis=2) < SHADOW)
    for label, frame in zip(("clipped", "recovered"), frames, strict=False):
        off = frame.synthetic[covered].mean() / frames[2].synthetic[covered].mean() - 1.0
        lost = [1.0 - each.shadow[shaded].astype(float).mean() for each in (frame, frames[2])]
        print(f"{name}: in {label} light, objects are {100 * off:+.1f} % off those in the whole panorama's")
        print(f"{name}: and their shadows take {100 * lost[0]:.0f} % of the light and not {100 * lost[1]:.0f} %")


def side_by_side(frames: list[Frame], exposed: int, name: str, stops: float = 0.0) -> None:
    """Write frames beside each other, all in the exposure of one of them and some stops more."""
    exposure = stops + auto_exposure(frames[exposed].plate, frames[exposed].alpha)
    pictures = [tone_map(frame.beauty, exposure) for frame in frames]
    line = np.full((len(pictures[0]), 6, 3), 255, np.uint8)
    row = np.concatenate([piece for picture in pictures for piece in (line, picture)][1:], axis=1)
    Image.fromarray(row).save(HERE / f"{name}.jpg", quality=88, optimize=True)


def render(scene: Path) -> Frame:
    """The scene's view, denoised."""
    return lightdepth.render(lightdepth.load_scene(scene), camera="view", samples=SAMPLES, denoise=True)


def run(*arguments: object) -> None:
    """A command of lightdepth."""
    subprocess.run([*COMMAND, *map(str, arguments)], check=True)


PICTURES = {"lebombo": lebombo, "park": park, "cafe": cafe}


if __name__ == "__main__":
    main()
