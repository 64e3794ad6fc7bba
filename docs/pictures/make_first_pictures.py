"""Make the quickstart's pictures: first pictures of eight panoramas, the grid of `preview`, and plates of three sizes.

python docs/pictures/make_first_pictures.py FOLDER

FOLDER holds the panoramas named in ``PANORAMAS``, 1K versions from Poly Haven (CC0). The first pictures take about twenty
seconds of processor time each; with ``--keep OUT`` they are made in the folder OUT, and taken from there where they exist.
"""

from __future__ import annotations

import argparse
import tempfile
from pathlib import Path

import cv2
import numpy as np
from PIL import Image, ImageDraw
from typer.testing import CliRunner

from lightdepth.cli.app import app
from lightdepth.directions import direction_to_latlong, latlong_to_direction

HERE = Path(__file__).parent
PANORAMAS = {
    "comfy_cafe_1k.hdr": "café",
    "interior_hotelroom_1k.exr": "hotel room",
    "lebombo_1k.hdr": "empty room",
    "vestibule_1k.hdr": "ball room",
    "thatch_chapel_1k.hdr": "chapel",
    "modern_buildings_2_1k.hdr": "courtyard",
    "noon_grass_1k.hdr": "meadow at noon",
    "rooitou_park_1k.hdr": "park",
}
GRID = "interior_hotelroom_1k.exr"
TILE = (470, 294)
WIDTHS = (1024, 4096, 8192)
VIEW, FOV = (420, 300), 20.0
"""Size in pixels and horizontal degrees of the view of a wall that plates are compared in: 21 pixels per degree."""


def main() -> None:
    """Write the pictures beside this file."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--keep", type=Path, metavar="OUT")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as temporary:
        out = options.keep or Path(temporary)
        save("new-first-pictures", first_pictures(options.folder, out))
        run("preview", options.folder / GRID, "-o", out / "grid.png")
        save("preview-grid", np.asarray(Image.open(out / "grid.png").convert("RGB")))
    save("plate-sharpness", plates())


def run(*arguments: object) -> None:
    """A command of the command line."""
    result = CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=False)
    if result.exit_code != 0:
        raise SystemExit(result.output)


def first_pictures(folder: Path, out: Path) -> np.ndarray:
    """What `lightdepth new` gives for each panorama, two in a row."""
    tiles = []
    for name in PANORAMAS:
        scene = out / f"{name.removesuffix(Path(name).suffix).removesuffix('_1k')}.toml"
        picture = scene.with_name(f"{scene.stem}-view.png")
        if not picture.exists():
            run("new", folder / name, "-o", scene)
        tiles.append(np.asarray(Image.open(picture).convert("RGB").resize(TILE, Image.Resampling.LANCZOS)))
    return grid(tiles, 2)


def plates() -> np.ndarray:
    """The same view of a wall in plates of several widths."""
    tiles = []
    for width in WIDTHS:
        picture = Image.fromarray(np.rint(view(width)).astype(np.uint8))
        label = f"{width} wide: {width / 360:.1f} pixels per degree"
        ImageDraw.Draw(picture).text((10, 10), label, fill=(255, 255, 255), stroke_fill=(0, 0, 0), stroke_width=2)
        tiles.append(np.asarray(picture))
    return grid(tiles, len(tiles))


def view(width: int) -> np.ndarray:
    """A perspective view out of the part of a panorama of this width that it shows, shape (height, width, 3), 0 to 255.

    Two by two samples a pixel, each bilinear, as the renderer takes its plate.
    """
    columns, rows = (np.arange(2 * size) / 2.0 + 0.25 for size in VIEW)
    x, y = np.meshgrid((columns - VIEW[0] / 2) / VIEW[0], (rows - VIEW[1] / 2) / VIEW[0])
    reach = 2.0 * np.tan(np.radians(FOV / 2))
    directions = np.stack([x * reach, np.ones_like(x), -y * reach], axis=-1)
    u, v = direction_to_latlong(directions / np.linalg.norm(directions, axis=-1, keepdims=True))
    at = np.stack([u * width, v * width / 2], axis=-1) - 0.5
    first = np.floor(at.min(axis=(0, 1))).astype(int) - 1
    size = np.ceil(at.max(axis=(0, 1))).astype(int) + 2 - first
    steps = 4
    fine_x, fine_y = (first[axis] + (np.arange(steps * size[axis]) + 0.5) / steps for axis in (0, 1))
    seen = latlong_to_direction(*np.meshgrid(fine_x / width, fine_y / (width / 2)))
    photographed = chart(seen).reshape(size[1], steps, size[0], steps, 3).mean(axis=(1, 3)).astype(np.float32)
    taken = cv2.remap(photographed, *np.moveaxis(at - first, -1, 0).astype(np.float32), cv2.INTER_LINEAR)
    return taken.reshape(VIEW[1], 2, VIEW[0], 2, 3).mean(axis=(1, 3))


def chart(directions: np.ndarray) -> np.ndarray:
    """A wall two metres ahead with writing and stripes on it, seen in directions, shape (..., 3)."""
    wall = np.full((2400, 3200, 3), (205, 190, 165), np.uint8)
    for row, scale in enumerate((9, 6, 4, 2.8, 2)):
        text = "lightdepth 360"
        cv2.putText(
            wall,
            text,
            (120, 620 + 320 * row),
            cv2.FONT_HERSHEY_DUPLEX,
            scale,
            (60, 45, 40),
            round(2.2 * scale),
            cv2.LINE_AA,
        )
    for group, period in enumerate((160, 80, 40, 20)):
        stripes = (np.arange(640) // (period // 2)) % 2 == 0
        wall[2080:2330, 120 + 760 * group : 760 + 760 * group][:, stripes] = (40, 60, 90)
    metres = directions[..., [0, 2]] / np.maximum(directions[..., 1:2], 1e-6) * 2.0
    column, row = metres[..., 0] * 4500 + 1600, -metres[..., 1] * 4500 + 1300
    return cv2.remap(
        wall, column.astype(np.float32), row.astype(np.float32), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )


def grid(tiles: list[np.ndarray], across: int) -> np.ndarray:
    """Tiles of one size with white lines between them."""
    padded = [np.pad(tile, ((0, 6), (0, 6), (0, 0)), constant_values=255) for tile in tiles]
    rows = [np.concatenate(padded[first : first + across], axis=1) for first in range(0, len(padded), across)]
    return np.concatenate(rows)[:-6, :-6]


def save(name: str, pixels: np.ndarray) -> None:
    """Write a JPEG."""
    Image.fromarray(pixels).save(HERE / f"{name}.jpg", quality=86, optimize=True)


if __name__ == "__main__":
    main()
