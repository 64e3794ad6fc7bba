"""Make the pictures of docs/reconstruction.md: photograph a virtual room, measure it, and run the commands.

Run it from the repository's root with the package installed: python docs/reconstruction/make_pictures.py
"""

import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np
import trimesh

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE.parents[1] / "tests/reconstruction"))

from virtual_room import CAPTURE, FURNITURE, ROOM, radiance, trace  # noqa: E402

from lightdepth.directions import direction_to_latlong, euler_rotation, pixel_directions  # noqa: E402
from lightdepth.images.exr import ExrPart, write_exr  # noqa: E402

HEIGHT = 512
ROTATION = "2,-3,25"


def main() -> None:
    """Make every picture."""
    rotation = euler_rotation([float(angle) for angle in ROTATION.split(",")])
    with tempfile.TemporaryDirectory() as folder:
        photograph_and_measure(Path(folder), rotation)
        low, high = ROOM
        floor = [(low[0], low[1], 0), (high[0], low[1], 0), (high[0], high[1], 0), (low[0], high[1], 0)]
        pose = ["--position", ",".join(map(str, CAPTURE)), "--rotation", ROTATION, "--camera-height", "1.5"]
        run(folder, "reconstruct layout room.exr", *pose, "--floor", clicks(floor, rotation), "--ceiling-corner",
            clicks([(high[0], high[1], high[2])], rotation), "--box",
            f"chest: {foot('chest', rotation)} height=0.5 top=support",
            "--box", f"cupboard: {foot('cupboard', rotation)} height=1.5", "-o layout --write scene.toml --picture",
            HERE / "layout.png")  # fmt: skip
        run(folder, "reconstruct lights scene.toml --picture", HERE / "lights.png")
        run(folder, "lightmap scene.toml -o map.exr --median-cut 64")
        (HERE / "median-cut.png").write_bytes(Path(folder, "map-lights.png").read_bytes())
        run(folder, "reconstruct from-depth depth.png --scale 0.001 --panorama scene.toml -o depth --picture",
            HERE / "from-depth.png")  # fmt: skip
        run(
            folder,
            "reconstruct from-points scan.ply --panorama scene.toml -o points --picture",
            HERE / "from-points.png",
        )
        run(
            folder,
            "reconstruct layout room.exr --outdoor --radius 20",
            *pose,
            "-o outdoor --picture",
            HERE / "outdoor.png",
        )


def run(folder: str, command: str, *arguments: object) -> None:
    """Call lightdepth in a folder and show what it prints."""
    words = [word for part in (command, *arguments) for word in (split(part) if isinstance(part, str) else [str(part)])]
    print("$ lightdepth", shlex.join(words), flush=True)
    code = "from lightdepth.cli.app import main; main()"
    subprocess.run([sys.executable, "-c", code, *words], cwd=folder, check=True)


def split(part: str) -> list[str]:
    """Words of a command; texts with colons, commas or equals signs are one word."""
    return [part] if any(sign in part for sign in ",:=") else part.split()


def photograph_and_measure(folder: Path, rotation: np.ndarray) -> None:
    """Write the room's panorama, a depth image and a scan: 1 cm noise, a fifth missing."""
    random = np.random.default_rng(0)
    fine = pixel_directions(3 * HEIGHT, 6 * HEIGHT) @ rotation.T
    pixels = radiance(CAPTURE + fine * trace(CAPTURE, fine)[..., None])
    pixels = pixels.reshape(HEIGHT, 3, 2 * HEIGHT, 3, 3).mean(axis=(1, 3))
    write_exr(folder / "room.exr", [ExrPart({name: pixels[..., i] for i, name in enumerate("RGB")})])

    depth = trace(CAPTURE, pixel_directions(HEIGHT, 2 * HEIGHT) @ rotation.T)
    depth += random.normal(0, 0.01, depth.shape)
    depth[random.random(depth.shape) < 0.2] = 0
    cv2.imwrite(str(folder / "depth.png"), np.round(1000 * depth).astype(np.uint16))

    directions = random.normal(size=(300_000, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    points = CAPTURE + directions * (trace(CAPTURE, directions) + random.normal(0, 0.01, len(directions)))[:, None]
    missing = directions[:, 2] < -np.cos(np.radians(20))
    while missing.mean() < 0.2:
        patch = random.normal(size=3)
        missing |= directions @ patch > np.cos(np.radians(6)) * np.linalg.norm(patch)
    trimesh.PointCloud(points[~missing]).export(folder / "scan.ply")


def clicks(points: list, rotation: np.ndarray) -> str:
    """Where a person would click for world points, in pixels."""
    u, v = direction_to_latlong((np.array(points) - CAPTURE) @ rotation)
    return " ".join(f"{x:.1f},{y:.1f}" for x, y in zip(u * 2 * HEIGHT, v * HEIGHT, strict=True))


def foot(name: str, rotation: np.ndarray) -> str:
    """Clicks on three corners of a piece of furniture's foot."""
    low, high = FURNITURE[name]
    return clicks([(low[0], low[1], 0), (high[0], low[1], 0), (high[0], high[1], 0)], rotation)


if __name__ == "__main__":
    main()
