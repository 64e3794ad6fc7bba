"""Pixels of Blender's images as linear Rec.709 numbers, and image files for the renderer."""

import struct
import zlib

import bpy
import numpy as np

from .meshfolder import MeshFolder

LUMINANCE = np.array([0.2126, 0.7152, 0.0722], np.float32)
"""Of linear Rec.709, by which Blender turns a colour into a number."""
MISSING = np.array([1.0, 0.0, 1.0, 1.0], np.float32)
"""What Cycles shows where a texture has no image."""
DATA = {"Non-Color", "Raw", "Data", "Utilities - Raw"}
LINEAR = {"Linear", "Linear Rec.709", "scene_linear", "Utilities - Linear - sRGB"}
SRGB = {"sRGB", "sRGB - Display", "sRGB Encoded Rec.709"}
_TO_REC709 = {
    "ACEScg": (
        (1.7050510, -0.6217921, -0.0832589),
        (-0.1302564, 1.1408047, -0.0105483),
        (-0.0240033, -0.1289690, 1.1529723),
    ),
    "Linear Rec.2020": (
        (1.6604910, -0.5876411, -0.0728499),
        (-0.1245505, 1.1328999, -0.0083494),
        (-0.0181508, -0.1005789, 1.1187297),
    ),
}
"""From working spaces (D60 adapted by Bradford's method for ACEScg) to linear Rec.709."""


class ImageError(Exception):
    """An image whose pixels cannot be had as they are shown."""


def working_space() -> str:
    """Name of the linear space that the file's colours are in; always Rec.709 before Blender 5.0."""
    colourspace = getattr(bpy.data, "colorspace", None)
    return getattr(colourspace, "working_space", "Linear Rec.709")


def to_rec709(colours: np.ndarray, space: str | None = None) -> np.ndarray:
    """Colours of the file's working space, or of another, as linear Rec.709; shape (..., 3 or more)."""
    matrix = _TO_REC709.get(working_space() if space is None else space)
    if matrix is None:
        return colours
    colours = np.array(colours, np.float32)
    colours[..., :3] = colours[..., :3] @ np.array(matrix, np.float32).T
    return colours


def from_rec709(colours: np.ndarray) -> np.ndarray:
    """Linear Rec.709 colours of shape (..., 3 or more) in the file's working space."""
    matrix = _TO_REC709.get(working_space())
    if matrix is None:
        return colours
    colours = np.array(colours, np.float32)
    colours[..., :3] = colours[..., :3] @ np.linalg.inv(np.array(matrix)).astype(np.float32).T
    return colours


def pixels(image: bpy.types.Image, with_alpha: bool) -> np.ndarray:
    """An image as Cycles shows it.

    Args:
        image: the image.
        with_alpha: whether its alpha is used by itself; else colours are multiplied by it.

    Returns:
        Linear Rec.709 (plain numbers where the image is data) and alpha, shape (height, width, 4), float32, the first
        row at the top.

    Raises:
        ImageError: its file is missing or its colour space is not known here.
    """
    width, height = image.size
    if not width or not height:
        raise ImageError("has no picture; its file is missing or cannot be read")
    space = image.colorspace_settings.name
    known = DATA | LINEAR | SRGB | set(_TO_REC709)
    if not image.is_float and space not in known:
        raise ImageError(
            f"has the colour space '{space}', which is not known here; sRGB, Non-Color and linear ones are"
        )
    flat = np.empty(width * height * image.channels, np.float32)
    image.pixels.foreach_get(flat)
    found = flat.reshape(height, width, image.channels)[::-1]
    result = np.ones((height, width, 4), np.float32)
    result[..., :3] = found[..., :1] if image.channels < 3 else found[..., :3]
    if image.channels == 4 and image.alpha_mode != "NONE":
        result[..., 3] = found[..., 3]
    is_data = space in DATA
    associated = image.alpha_mode in {"STRAIGHT", "PREMUL"} and not is_data
    alpha = result[..., 3:]
    if image.is_float:  # Blender keeps these linear and premultiplied
        if associated and with_alpha:
            np.divide(result[..., :3], alpha, out=result[..., :3], where=alpha > 0.0)
        return result if is_data else to_rec709(result)
    if associated and not with_alpha:
        result[..., :3] *= alpha
    if space in SRGB:
        result[..., :3] = decoded(result[..., :3])
    elif space in _TO_REC709:
        result = to_rec709(result, space)
    return result


def decoded(codes: np.ndarray) -> np.ndarray:
    """Linear numbers of sRGB ones in [0, 1]."""
    return np.where(codes <= 0.04045, codes / 12.92, ((np.maximum(codes, 0.0) + 0.055) / 1.055) ** 2.4).astype(
        np.float32
    )


def encoded(linear: np.ndarray) -> np.ndarray:
    """Linear numbers as sRGB ones, clipped to [0, 1]."""
    linear = np.clip(linear, 0.0, 1.0)
    return np.where(linear <= 0.0031308, linear * 12.92, 1.055 * linear ** (1.0 / 2.4) - 0.055).astype(np.float32)


class ImageFolder:
    """Writes the image files of one mesh.

    Args:
        folder: where they go.

    Attributes:
        names: of the files.
    """

    def __init__(self, folder: MeshFolder):
        self._folder = folder
        self.names: list[str] = []

    def png(self, values: np.ndarray) -> str:
        """Write numbers in [0, 1], shape (height, width, 3 or 4), as an 8-bit PNG; returns the file's name.

        Raises:
            OSError: the file cannot be written.
        """
        codes = (np.clip(values, 0.0, 1.0) * 255.0 + 0.5).astype(np.uint8)
        height, width, channels = codes.shape
        rows = np.zeros((height, 1 + width * channels), np.uint8)
        rows[:, 1:] = codes.reshape(height, -1)
        header = struct.pack(">IIBBBBB", width, height, 8, 6 if channels == 4 else 2, 0, 0, 0)
        parts = ((b"IHDR", header), (b"IDAT", zlib.compress(rows.tobytes(), 1)), (b"IEND", b""))
        data = b"\x89PNG\r\n\x1a\n" + b"".join(
            struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))
            for kind, body in parts
        )
        return self._write(data, ".png")

    def hdr(self, radiance: np.ndarray) -> str:
        """Write linear radiance, shape (height, width, 3), as a Radiance picture; returns the file's name.

        Raises:
            OSError: the file cannot be written.
        """
        radiance = np.maximum(radiance, 0.0)
        brightest = radiance.max(axis=-1)
        mantissa, exponent = np.frexp(brightest)
        scale = np.where(brightest > 1e-32, mantissa * 256.0 / np.maximum(brightest, 1e-38), 0.0)
        codes = np.zeros((*brightest.shape, 4), np.uint8)
        codes[..., :3] = np.minimum(radiance * scale[..., None] + 0.5, 255.0)
        codes[..., 3] = np.where(brightest > 1e-32, exponent + 128, 0)
        height, width = brightest.shape
        header = f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n".encode()
        return self._write(header + codes.tobytes(), ".hdr")

    def _write(self, data: bytes, suffix: str) -> str:
        self.names.append(self._folder.write("", suffix, data))
        return self.names[-1]
