"""Image files as textures."""

from __future__ import annotations

from enum import Enum
from pathlib import Path
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from lightdepth.errors import InputError
from lightdepth.images.radiance import READERS, read_radiance
from lightdepth.scene.materials.texture import Texture, decode_srgb


class Content(Enum):
    """What the numbers of an image mean."""

    COLOUR = "colour"  # three channels, sRGB in 8-bit files, linear in .exr and .hdr
    SHARE = "share"  # one channel, a plain number in [0, 1]
    VECTOR = "vector"  # three channels, plain numbers in [0, 1]


def read_texture(path: Path, content: Content) -> Texture:
    """Read an image file as a texture.

    Raises:
        ValueError: the file is missing or is no image that can be read.
    """
    if not path.is_file():
        raise ValueError(f"{path}: no such file")
    if path.suffix.lower() in READERS:
        if content is not Content.COLOUR:
            raise ValueError(f"{path}: an 8-bit image (.png, .jpg) is needed here")
        try:
            return Texture(read_radiance(path))
        except InputError as error:
            raise ValueError(str(error)) from error
    try:
        with Image.open(path) as image:
            pixels = eight_bit(image, "L" if content is Content.SHARE else "RGB")
    except (OSError, SyntaxError, Image.DecompressionBombError) as error:
        raise ValueError(f"{path}: not an image that can be read ({error})") from error
    return texture_of(pixels, content)


def eight_bit(image: Image.Image, mode: Literal["L", "RGB", "RGBA"]) -> NDArray[np.uint8]:
    """An image's pixels in another mode; Pillow by itself would clip 16-bit grey values at 255."""
    if image.mode.startswith("I"):
        image = Image.fromarray((np.asarray(image) // 257).astype(np.uint8))
    return np.asarray(image.convert(mode))


def texture_of(pixels: NDArray[np.uint8], content: Content) -> Texture:
    """A texture of 8-bit pixels of shape (height, width, 3), or (height, width) for shares."""
    if content is Content.COLOUR:
        return Texture(decode_srgb(pixels))
    return Texture((pixels.reshape(*pixels.shape[:2], -1) / np.float32(255)).astype(np.float16))
