"""Image files as textures."""

from __future__ import annotations

import io
import warnings
from enum import Enum
from pathlib import Path
from typing import Literal
from weakref import WeakValueDictionary

import numpy as np
from numpy.typing import NDArray
from PIL import Image, UnidentifiedImageError

from lightdepth.errors import InputError
from lightdepth.files import is_file
from lightdepth.images.radiance import READERS, read_radiance
from lightdepth.scene.materials.texture import Texture, decode_srgb

Mode = Literal["L", "RGB", "RGBA"]


class Content(Enum):
    """What the numbers of an image mean."""

    COLOUR = "colour"  # three channels, sRGB in 8-bit files, linear in .exr and .hdr
    SHARE = "share"  # one channel, a plain number in [0, 1]
    VECTOR = "vector"  # three channels, plain numbers in [0, 1]


def read_texture(path: Path, content: Content) -> Texture:
    """Read an image file as a texture. One that is in use and whose file is unchanged is given again.

    Raises:
        ValueError: the file is missing or is no image that can be read.
    """
    if not is_file(path):
        raise ValueError(f"{path}: no such file")
    status = path.stat()
    key = path, content, status.st_mtime_ns, status.st_size
    texture = _in_use.get(key)
    if texture is None:
        texture = _in_use[key] = _texture(path, content)
    return texture


_in_use: WeakValueDictionary[tuple[Path, Content, int, int], Texture] = WeakValueDictionary()
"""The scenes of a sequence share their textures."""


def _texture(path: Path, content: Content) -> Texture:
    if path.suffix.lower() in READERS:
        if content is not Content.COLOUR:
            raise ValueError(f"{path}: an 8-bit image (.png, .jpg) is needed here")
        return Texture(_radiance(path))
    return texture_of(_eight_bit_file(path, "L" if content is Content.SHARE else "RGB"), content)


def read_pixels(path: Path) -> NDArray[np.uint8] | NDArray[np.float32]:
    """Read an image file: 8-bit codes, red, green, blue and alpha; of .exr and .hdr linear red, green and blue.

    Raises:
        ValueError: the file is no image that can be read.
    """
    return _radiance(path) if path.suffix.lower() in READERS else _eight_bit_file(path, "RGBA")


def _radiance(path: Path) -> NDArray[np.float32]:
    try:
        return read_radiance(path)
    except InputError as error:
        raise ValueError(str(error)) from error


def _eight_bit_file(path: Path, mode: Mode) -> NDArray[np.uint8]:
    try:
        return eight_bit(path.read_bytes(), mode)
    except (OSError, ValueError) as error:
        why = error.strerror if isinstance(error, OSError) else error
        raise ValueError(f"{path}: cannot be read: {why}") from error


def eight_bit(content: bytes, mode: Mode) -> NDArray[np.uint8]:
    """The pixels of an encoded image as 8-bit codes, of shape (height, width) or (height, width, channels).

    Raises:
        ValueError: it is no image, is damaged, or has numbers of 32 bits. The message says which.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            image: Image.Image = Image.open(io.BytesIO(content))
            image.load()
    except UnidentifiedImageError as error:
        raise ValueError("it is not an image, or of a kind that is not supported; save it as .png or .jpg") from error
    except Image.DecompressionBombError as error:
        raise ValueError(f"it has more than {2 * (Image.MAX_IMAGE_PIXELS or 0)} pixels") from error
    except MemoryError:
        raise
    except Exception as error:  # Pillow's decoders raise whatever they meet.
        raise ValueError("it is damaged or cut off") from error
    if image.mode == "F":
        raise ValueError("32-bit values are not supported here; save it with 8 or 16 bits, or as .exr")
    if image.mode.startswith("I"):  # Pillow by itself would clip 16-bit grey values at 255.
        image = Image.fromarray((np.clip(np.asarray(image), 0, 65535) // 257).astype(np.uint8))
    return np.asarray(image.convert(mode))


def texture_of(pixels: NDArray[np.uint8], content: Content) -> Texture:
    """A texture of 8-bit pixels of shape (height, width, 3), or (height, width) for shares."""
    if content is Content.COLOUR:
        return Texture(decode_srgb(pixels))
    return Texture((pixels.reshape(*pixels.shape[:2], -1) / np.float32(255)).astype(np.float16))
