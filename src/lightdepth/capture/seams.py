"""Remapping and blending by Hugin's own programs: seams that go round what moved, instead of soft transitions."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
import numpy as np

from lightdepth.capture import hugin
from lightdepth.capture.lens import PROJECTIONS, Lens
from lightdepth.capture.panorama import Panorama, corrected
from lightdepth.capture.photometry import Photograph, Photometry
from lightdepth.errors import LightdepthError

TOOLS = ("nona", "enblend")


def blend(photographs: Sequence[Photograph], photometry: Photometry, width: int, folder: Path) -> Panorama:
    """Remap photographs by nona and blend them by enblend, in linear radiance throughout.

    Args:
        photographs: with optimised lenses and poses.
        photometry: corrections to apply.
        width: of the panorama in pixels, even.
        folder: where the programs work.

    Raises:
        SetupError: a program is not installed.
        LightdepthError: a program failed.
    """
    lines = [f'p f2 w{width} h{width // 2} v360 E0 R1 n"TIFF_m c:NONE"', "m i5"]
    for index, photograph in enumerate(photographs):
        name = f"radiance{index:03d}.tif"
        pixels = corrected(photograph, photometry, index)
        # The fourth channel is the mask; nona takes what is 0 there for not photographed.
        mask = (photograph.seen > 0.0).astype(np.float32)[..., None]
        bgra = np.concatenate([pixels[..., ::-1], mask], axis=-1)
        if not cv2.imwrite(str(folder / name), bgra, [cv2.IMWRITE_TIFF_COMPRESSION, 1]):
            raise LightdepthError(f"{folder}: the temporary folder cannot be written; is the disk full?")
        lines.append(_image_line(photograph.lens, name))
    (folder / "remap.pto").write_text("\n".join(lines) + "\n")
    hugin.run("nona", "-r", "hdr", "-m", "TIFF_m", "-p", "FLOAT", "-o", "remapped", "remap.pto", folder=folder)
    layers = sorted(path.name for path in folder.glob("remapped*.tif"))
    if not layers:
        raise LightdepthError("nona remapped none of the images")
    hugin.run(
        "enblend", "--wrap=horizontal", "-f", f"{width}x{width // 2}", "-o", "blended.tif", *layers, folder=folder
    )
    blended = cv2.imread(str(folder / "blended.tif"), cv2.IMREAD_UNCHANGED)
    if blended is None or blended.shape[:2] != (width // 2, width):
        raise LightdepthError("enblend wrote no panorama of the right size")
    radiance = np.maximum(blended[..., 2::-1], 0.0).astype(np.float32)
    covered = blended[..., 3] > 0.0 if blended.shape[2] == 4 else radiance.any(axis=2)
    return Panorama(np.where(covered[..., None], radiance, np.float32(0.0)), covered)


def _image_line(lens: Lens, name: str) -> str:
    a, b, c = lens.distortion
    crop = ""
    if lens.projection == "fisheye":
        # In a square the number 2 means a circle within these bounds.
        crop = f" S0,{lens.width},0,{lens.height}"
    return (
        f"i w{lens.width} h{lens.height} f{PROJECTIONS[lens.projection]} v{lens.fov} Ra0 Rb0 Rc0 Rd0 Re0 Eev0 Er1 Eb1 "
        f"r{lens.roll} p{lens.pitch} y{lens.yaw} TrX0 TrY0 TrZ0 Tpy0 Tpp0 j0 a{a} b{b} c{c} d{lens.shift[0]} "
        f'e{lens.shift[1]} g0 t0 Va1 Vb0 Vc0 Vd0 Vx0 Vy0{crop} Vm5 Rt1 n"{name}"'
    )
