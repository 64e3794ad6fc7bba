"""An ordinary photograph, as one looks at it: pixels for the screen, upright, and what its metadata say of the lens."""

from __future__ import annotations

import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import ExifTags, Image, ImageOps

from lightdepth.errors import InputError
from lightdepth.images.radiance import holds_radiance, read_radiance
from lightdepth.images.tonemapping import auto_exposure, tone_map

_FULL_FRAME_DIAGONAL = float(np.hypot(36.0, 24.0))


@dataclass(frozen=True)
class Picture:
    """A photograph for the screen.

    Attributes:
        pixels: sRGB, shape (height, width, 3), uint8, turned upright as its metadata say.
        fov: horizontal field of view by the EXIF focal length in terms of 35 mm film, degrees; ``None`` where there is
            none.
    """

    pixels: NDArray[np.uint8]
    fov: float | None = None


def read_picture(path: Path, content: bytes | None = None) -> Picture:
    """Read a photograph of any projection: JPEG, PNG, TIFF and what else Pillow reads; OpenEXR and Radiance HDR.

    Args:
        path: the file; where ``content`` is given, only for messages.
        content: the file's bytes.

    Raises:
        InputError: the file is missing, or no readable picture.
    """
    if content is None:
        if not path.is_file():
            raise InputError(f"{path}: no such file")
        if holds_radiance(path):
            radiance = read_radiance(path)
            return Picture(tone_map(radiance, auto_exposure(radiance)))
        content = path.read_bytes()
    try:
        with Image.open(io.BytesIO(content)) as image:
            exif = image.getexif().get_ifd(ExifTags.IFD.Exif)
            upright = ImageOps.exif_transpose(image)
            if upright.mode.startswith("I;16"):
                pixels = np.repeat((np.asarray(upright) // 257).astype(np.uint8)[..., None], 3, axis=2)
            else:
                pixels = np.asarray(upright.convert("RGB"))
    except (OSError, EOFError, SyntaxError, ValueError, TypeError, Image.DecompressionBombError) as error:
        raise InputError(f"{path}: not a readable photograph (damaged, or of another format)") from error
    try:
        focal = float(exif.get(ExifTags.Base.FocalLengthIn35mmFilm, 0))
    except (TypeError, ValueError):
        focal = 0.0
    fov = None
    if np.isfinite(focal) and focal > 0.0:
        height, width = pixels.shape[:2]
        # The film's frame is compared by its diagonal.
        fov = float(np.degrees(2.0 * np.arctan(0.5 * _FULL_FRAME_DIAGONAL * width / np.hypot(width, height) / focal)))
    return Picture(pixels, fov)
