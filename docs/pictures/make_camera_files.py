"""Make the quickstart's picture of what 360 degree cameras write, and of what `lightdepth new` makes of it.

python docs/pictures/make_camera_files.py

The files are made from the demo's panorama as cameras would have written them: 8 bits, lamps and windows clipped.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import cv2
import numpy as np
from PIL import Image
from typer.testing import CliRunner

from lightdepth.capture.lens import Lens
from lightdepth.cli.app import app
from lightdepth.directions import direction_to_latlong
from lightdepth.images.gpano import photo_sphere_xmp
from lightdepth.images.radiance import read_radiance
from lightdepth.images.tonemapping import auto_exposure, tone_map

HERE = Path(__file__).parent
PANORAMA = HERE.parents[1] / "examples/lounge/hotel_room.exr"
CAMERA_HEIGHT = 1.3
SIDE, FOV = 512, 195.0
"""Pixels across a fisheye circle, and the degrees that it shows."""
LEFT_OUT = 72
"""Rows that the cropped sphere lacks above and below: 25 degrees of 180 each."""
INPUT, PICTURE = (480, 240), (384, 240)


def main() -> None:
    """Write the picture beside this file."""
    radiance = read_radiance(PANORAMA)
    pixels = tone_map(radiance, auto_exposure(radiance), "linear")
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for stem, make in (("sphere", sphere), ("cropped", cropped), ("fisheyes", fisheyes)):
            shown = make(folder / f"{stem}.jpg", pixels)
            panorama = folder / f"{stem}.jpg"
            if stem == "fisheyes":
                run("capture", "stitch", panorama, "-o", folder / "stitched.exr", "--dual")
                panorama = folder / "stitched.exr"
            run("new", panorama, "-o", folder / f"{stem}.toml", "--camera-height", CAMERA_HEIGHT)
            rows.append(np.hstack([fitted(shown, INPUT), fitted(opened(folder / f"{stem}-view.png"), PICTURE)]))
    Image.fromarray(np.vstack(rows)).save(HERE / "camera-files.jpg", quality=88)


def run(*arguments: object) -> None:
    """A command of the command line."""
    result = CliRunner().invoke(app, [str(argument) for argument in arguments], catch_exceptions=False)
    if result.exit_code != 0:
        raise SystemExit(result.output)


def opened(path: Path) -> np.ndarray:
    """The pixels of a picture, shape (height, width, 3)."""
    return np.asarray(Image.open(path).convert("RGB"))


def fitted(pixels: np.ndarray, size: tuple[int, int]) -> np.ndarray:
    """A picture in a white box of this width and height."""
    image = Image.fromarray(pixels)
    image.thumbnail((size[0] - 6, size[1] - 6), Image.Resampling.LANCZOS)
    box = Image.new("RGB", size, (255, 255, 255))
    box.paste(image, ((size[0] - image.width) // 2, (size[1] - image.height) // 2))
    return np.asarray(box)


def sphere(path: Path, pixels: np.ndarray) -> np.ndarray:
    """A JPEG as a Theta writes it, with the pose in its metadata."""
    xmp = photo_sphere_xmp(pixels.shape[1], pixels.shape[0], np.eye(3), "camera")
    Image.fromarray(pixels).save(path, quality=95, xmp=xmp)
    return pixels


def cropped(path: Path, pixels: np.ndarray) -> np.ndarray:
    """A sphere without its zenith and its nadir, as from a sweep with a phone."""
    part = pixels[LEFT_OUT:-LEFT_OUT]
    xmp = photo_sphere_xmp(pixels.shape[1], pixels.shape[0], np.eye(3), "camera").decode()
    for name, before, now in (
        ("CroppedAreaImageHeightPixels", len(pixels), len(part)),
        ("CroppedAreaTopPixels", 0, LEFT_OUT),
    ):
        xmp = xmp.replace(f"<GPano:{name}>{before}<", f"<GPano:{name}>{now}<")
    Image.fromarray(part).save(path, quality=95, xmp=xmp.encode())
    return part


def fisheyes(path: Path, pixels: np.ndarray) -> np.ndarray:
    """Two circles side by side, from lenses back to back."""
    circles = []
    x, y = np.meshgrid(np.arange(SIDE) + 0.5, np.arange(SIDE) + 0.5)
    inside = np.hypot(x - SIDE / 2, y - SIDE / 2) < SIDE / 2
    for yaw in (0.0, 180.0):
        u, v = direction_to_latlong(Lens(SIDE, SIDE, "fisheye", FOV, yaw=yaw, pitch=0.0, roll=0.0).unproject(x, y))
        at = [(share * size - 0.5).astype(np.float32) for share, size in ((u, pixels.shape[1]), (v, pixels.shape[0]))]
        seen = cv2.remap(pixels, *at, cv2.INTER_LINEAR, borderMode=cv2.BORDER_WRAP)
        circles.append(np.where(inside[:, :, None], seen, 0))
    both = np.pad(
        np.hstack([np.pad(circle, ((0, 0), (16, 16), (0, 0))) for circle in circles]), ((16, 16), (0, 0), (0, 0))
    )
    Image.fromarray(both.astype(np.uint8)).save(path, quality=95)
    return both.astype(np.uint8)


if __name__ == "__main__":
    main()
