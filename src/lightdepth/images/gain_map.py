"""Gain maps: what a JPEG for the screen carries beside it about light brighter than the screen's white.

The format is Ultra HDR (Android, "Ultra HDR Image Format v1.1"; Adobe's gain maps have the same metadata): a second JPEG
in the file, found by its multi-picture index (CIPA DC-007), holds the logarithm of the factor on each pixel.
"""

from __future__ import annotations

import io
import re
import struct
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from PIL import Image, TiffImagePlugin

FloatArray = NDArray[np.float64]

_MP_ENTRIES = 0xB002
_ENTRY = 16
"""Bytes of an entry in the multi-picture index: attributes, size, offset, and two numbers of dependent pictures."""
_NAMESPACE = b"hdrgm:"
_DEFAULTS = {"GainMapMin": 0.0, "GainMapMax": 1.0, "Gamma": 1.0, "OffsetSDR": 1.0 / 64.0, "OffsetHDR": 1.0 / 64.0}


@dataclass(frozen=True)
class GainMap:
    """A gain map and how it is meant.

    Attributes:
        recovery: as stored, 0 to 1, shape (height, width, 1 or 3), float32.
        low: binary logarithm of the factor where ``recovery`` is 0, shape (3,).
        high: likewise where it is 1.
        gamma: of the stored values, shape (3,).
        offset_sdr: added to the picture for the screen before the factor, shape (3,).
        offset_hdr: taken away after it, shape (3,).
    """

    recovery: NDArray[np.float32]
    low: FloatArray
    high: FloatArray
    gamma: FloatArray
    offset_sdr: FloatArray
    offset_hdr: FloatArray

    @property
    def headroom(self) -> float:
        """The largest factor."""
        return float(np.exp2(self.high.max()))

    def applied(self, linear: NDArray[np.float32]) -> NDArray[np.float32]:
        """Radiance out of a picture for the screen, linear, 1 its white, shape (height, width, 3)."""
        height, width = linear.shape[:2]
        recovery = cv2.resize(self.recovery, (width, height), interpolation=cv2.INTER_LINEAR).reshape(height, width, -1)
        boost = self.low + (self.high - self.low) * recovery ** (1.0 / self.gamma)
        bright = (linear + self.offset_sdr) * np.exp2(boost) - self.offset_hdr
        return np.maximum(bright, 0.0).astype(np.float32)


def has_gain_map(xmp: bytes) -> bool:
    """Whether a picture's XMP packet says that there is a gain map beside it."""
    return _NAMESPACE + b"Version" in xmp


def read_gain_map(path: Path, image: Image.Image) -> GainMap:
    """The gain map in a JPEG file.

    Args:
        path: the file.
        image: as Pillow opened it.

    Raises:
        ValueError: there is none, or it is damaged or of another kind; the message says so.
    """
    try:
        index, start = image.info["mp"], int(image.info["mpoffset"])
        tags = TiffImagePlugin.ImageFileDirectory_v2(index[:8])
        stream = io.BytesIO(index)
        stream.seek(tags.next)
        tags.load(stream)
        entries, order = tags[_MP_ENTRIES], "<" if index[:2] == b"II" else ">"
        with path.open("rb") as file:
            for at in range(_ENTRY, len(entries), _ENTRY):
                _, size, offset = struct.unpack_from(f"{order}III", entries, at)
                file.seek(start + offset)
                with Image.open(io.BytesIO(file.read(size))) as second:
                    xmp = second.info.get("xmp", b"")
                    if has_gain_map(xmp):
                        stored = np.asarray(second.convert("L" if second.mode == "L" else "RGB"), np.float32) / 255.0
                        return _gain_map(stored.reshape(*stored.shape[:2], -1), xmp)
    except (KeyError, OSError, SyntaxError, struct.error, TypeError) as error:
        raise ValueError("it is damaged") from error
    raise ValueError("none of the pictures in the file is one")


def _gain_map(recovery: NDArray[np.float32], xmp: bytes) -> GainMap:
    if re.search(rb"hdrgm:BaseRenditionIsHDR\s*(=\s*[\"']|>)\s*True", xmp):
        raise ValueError("it leads from HDR to the screen's range")
    values = {name: _numbers(xmp, name, default) for name, default in _DEFAULTS.items()}
    low, high, gamma, offset_sdr, offset_hdr = values.values()
    if not (np.isfinite(list(values.values())).all() and (gamma > 0.0).all() and (np.abs([low, high]) < 32.0).all()):
        raise ValueError("its values make no sense")
    return GainMap(recovery, low, high, gamma, offset_sdr, offset_hdr)


def _numbers(xmp: bytes, name: str, default: float) -> FloatArray:
    """One number for all channels, or three: an attribute, or an element with a list."""
    attribute = re.search(rb"hdrgm:" + name.encode() + rb"\s*=\s*[\"']([^\"']*)[\"']", xmp)
    element = re.search(rb"<hdrgm:" + name.encode() + rb"\s*>(.*?)</hdrgm:" + name.encode(), xmp, re.DOTALL)
    if attribute is not None:
        texts = [attribute.group(1)]
    elif element is not None:
        texts = re.findall(rb"<rdf:li[^>]*>([^<]*)<", element.group(1)) or [element.group(1)]
    else:
        return np.full(3, default)
    if len(texts) not in (1, 3):
        raise ValueError("its values make no sense")
    return np.broadcast_to(np.array([float(text) for text in texts]), 3).copy()
