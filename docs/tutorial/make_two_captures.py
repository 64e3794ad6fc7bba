"""Make the flat of docs/tutorial/two-captures.md, run its commands, and keep the pictures.

Run it from the repository's root with the package installed: python docs/tutorial/make_two_captures.py

The flat is the benchmark's L-shaped room, path-traced from two capture points; someone is painted into the second
panorama, which is exposed otherwise. All files stay in out/two-captures.
"""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(ROOT))

from bench.captures import JOURNEYS, QUICK  # noqa: E402
from bench.places import l_shaped_room  # noqa: E402
from bench.truth import photograph  # noqa: E402

from lightdepth.film.layers import read_frame  # noqa: E402
from lightdepth.images.exr import ExrPart, write_exr  # noqa: E402
from lightdepth.images.radiance import read_radiance  # noqa: E402
from lightdepth.images.tonemapping import auto_exposure, tone_map  # noqa: E402
from lightdepth.reconstruction.scene_file import write_meshes  # noqa: E402
from lightdepth.scene.model import Mesh, RealSurface, Role  # noqa: E402

WORK = ROOT / "out/two-captures"
EXPOSED_OTHERWISE = np.float32([1.6, 1.3, 0.9])
FIRST = """[[panorama]]
image = "hall.exr"
position = [-1.2, -0.4, 1.5]
rotation = [0, 0, -35]
"""
SECOND = """
[[panorama]]
image = "kitchen.exr"
position = [2.0, 2.6, 1.5]
rotation = [0, 0, -35]
"""
CLICKS = (
    "19,173 = 18,146",
    "19,93 = 18,115",
    "272,169 = 18,189",
    "272,97 = 18,80",
    "364,154 = 445,153",
    "364,108 = 445,109",
    "282,109 = 376,36",
)
"""Pixels of room corners and a lamp's in the first and in the second panorama."""
MASK = 'mask = "kitchen-mask.png"\n'
REST = """
[[synthetic]]
name = "ball"
shape = "sphere"
center = [1.5, 1.7, 0.35]
radius = 0.35
material = { type = "principled", base_color = [0.05, 0.25, 0.6], roughness = 0.25, clearcoat = 1.0 }

[camera.corner]
type = "perspective"
width = 360
height = 240
fov = 75
position = [2.2, -0.6, 1.5]
look_at = [1.5, 2.6, 0.7]

[render]
samples = 48
irradiance_samples = 512
"""


def main() -> None:
    """Write the flat, run the commands, write the pictures."""
    WORK.mkdir(parents=True, exist_ok=True)
    place = l_shaped_room()
    hall, kitchen = (
        photograph(replace(place, position=position), *QUICK.photograph).mean.astype(np.float32)
        for position in JOURNEYS["l_shaped_room"].points[:2]
    )
    _write_panoramas(hall, _with_someone(kitchen / EXPOSED_OTHERWISE))
    lamps = [part.mesh for part in place.parts if part.radiance is not None]
    real = [RealSurface(part.name, part.mesh, Role.SUPPORT) for part in place.parts if part.radiance is None]
    write_meshes([*real, RealSurface("lamps", _joined(lamps), Role.ENVIRONMENT)], WORK)
    _relate(real)
    unseen_by_the_first = ("corner wall", "far wall")
    for name, panoramas in (("one", FIRST), ("two", FIRST + SECOND), ("masked", FIRST + SECOND + MASK)):
        tables = [
            _table(each.name, "environment" if name == "one" and each.name in unseen_by_the_first else "support")
            for each in real
        ]
        (WORK / f"{name}.toml").write_text("".join([panoramas, *tables, _table("lamps", "environment"), REST]))
        _lightdepth("check", f"{name}.toml")
        _lightdepth("render", f"{name}.toml", "--camera", "corner", "--denoise", "-o", f"{name}.exr")
    _write_pictures()


def _relate(real: list[RealSurface]) -> None:
    """Find the second pose by clicks on corners and keep the check picture; the other scene files have the true one."""
    tables = "".join(_table(each.name, "support") for each in real)
    (WORK / "related.toml").write_text(FIRST + tables + _table("lamps", "environment"))
    matches = [word for click in CLICKS for word in ("--match", click)]
    options = ("--write", "related.toml", "--picture", "check.png")
    _lightdepth("calibrate", "second", "kitchen.exr", "--scene", "related.toml", *matches, *options)
    picture = cv2.imread(str(WORK / "check.png"))
    assert picture is not None
    small = cv2.resize(picture, (800, 803), interpolation=cv2.INTER_AREA)
    cv2.imwrite(str(HERE / "two-captures-epipolar.jpg"), small, [cv2.IMWRITE_JPEG_QUALITY, 82])


def _lightdepth(*arguments: str) -> None:
    code = "from lightdepth.cli.app import main; main()"
    subprocess.run([sys.executable, "-c", code, *arguments], cwd=WORK, check=False)


def _table(name: str, role: str) -> str:
    return f'\n[[real]]\nname = "{name}"\nmesh = "{name}.ply"\nrole = "{role}"\n'


def _joined(meshes: list[Mesh]) -> Mesh:
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + first for mesh, first in zip(meshes, offsets, strict=False)]
    return Mesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces).astype(np.int32))


def _with_someone(radiance: NDArray[np.float32]) -> NDArray[np.float32]:
    v, u = np.mgrid[0 : radiance.shape[0], 0 : radiance.shape[1]]
    shape = np.zeros(radiance.shape[:2], bool)
    for column, row, across, down in ((300, 150, 9, 9), (300, 186, 14, 30), (294, 222, 6, 24), (306, 222, 6, 24)):
        shape |= ((u - column) / across) ** 2 + ((v - row) / down) ** 2 < 1.0
    spoilt = radiance.copy()
    spoilt[shape] = spoilt[shape] * np.float32([0.12, 0.1, 0.16]) + np.float32(0.02)
    return spoilt


def _write_panoramas(hall: NDArray[np.float32], kitchen: NDArray[np.float32]) -> None:
    for name, radiance in (("hall", hall), ("kitchen", kitchen)):
        write_exr(WORK / f"{name}.exr", [ExrPart({"RGB": radiance})])
    mask = np.full(kitchen.shape[:2], 255, np.uint8)
    mask[136:252, 280:320] = 0
    cv2.imwrite(str(WORK / "kitchen-mask.png"), mask)


def _write_pictures() -> None:
    """The panoramas below each other; one, two and masked, and the shares."""
    hall, kitchen = (read_radiance(WORK / f"{name}.exr") for name in ("hall", "kitchen"))
    exposure = auto_exposure(hall)
    shown = [tone_map(each, exposure, "agx-like") for each in (hall, kitchen)]
    _write("two-captures-panoramas.jpg", np.concatenate([shown[0], _white(6, shown[0].shape[1]), shown[1]]))
    frame = read_frame(WORK / "masked.exr")
    assert frame.photograph is not None
    grey = tone_map(frame.beauty, exposure, "agx-like").mean(axis=2, keepdims=True) / 255.0
    colours = frame.photograph @ np.array([[0.9, 0.35, 0.0], [0.0, 0.35, 0.9]])
    shares = (255.0 * np.clip(colours * (0.35 + 0.65 * grey), 0.0, 1.0)).astype(np.uint8)
    one, two, masked = (cv2.imread(str(WORK / f"{name}.png"))[..., ::-1] for name in ("one", "two", "masked"))
    between = np.full((len(one), 6, 3), 255, np.uint8)
    rows = [np.concatenate([left, between, right], axis=1) for left, right in ((one, two), (masked, shares))]
    _write("two-captures-views.jpg", np.concatenate([rows[0], _white(6, rows[0].shape[1]), rows[1]]))


def _white(height: int, width: int) -> NDArray[np.uint8]:
    return np.full((height, width, 3), 255, np.uint8)


def _write(name: str, pixels: NDArray[np.uint8]) -> None:
    cv2.imwrite(str(HERE / name), pixels[..., ::-1], [cv2.IMWRITE_JPEG_QUALITY, 88])


if __name__ == "__main__":
    main()
