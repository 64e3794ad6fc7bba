"""Images on surfaces, as linear numbers."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Wrap = Literal["repeat", "mirror", "clamp"]


@dataclass(frozen=True, eq=False)
class Texture:
    """An image whose numbers are linear: colours are decoded and factors multiplied in when it is made.

    Attributes:
        pixels: shape (height, width, 1 or 3), float16 or float32, row 0 at the image's top.
        wrap: what lies beyond the image's edges.
        nearest: true shows hard texels, false interpolates between them.
        to_uv: shape (3, 3), float64; applied to (u, v, 1), where v grows *downward* in the image, as in glTF.
    """

    pixels: NDArray[np.floating]
    wrap: Wrap = "repeat"
    nearest: bool = False
    to_uv: NDArray[np.float64] = field(default_factory=lambda: np.eye(3))


@dataclass(frozen=True)
class VertexColors:
    """Stands for the linear colours that a mesh carries at its vertices (``Mesh.colors``).

    Attributes:
        texture: what they are multiplied by, if anything.
    """

    texture: Texture | None = None


def decoded_srgb(values: NDArray[np.floating]) -> NDArray[np.float64]:
    """Linear values of sRGB values in [0, 1] (IEC 61966-2-1), of the same shape."""
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4)


SRGB_TO_LINEAR = decoded_srgb(np.arange(256) / 255.0)
"""Linear values in [0, 1] of the 256 codes of 8-bit sRGB (IEC 61966-2-1)."""


def decode_srgb(pixels: NDArray[np.uint8]) -> NDArray[np.float16]:
    """Linear values of 8-bit sRGB codes, of the same shape, in [0, 1]."""
    return SRGB_TO_LINEAR.astype(np.float16)[pixels]
