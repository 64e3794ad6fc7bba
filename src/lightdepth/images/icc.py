"""Colour profiles of three primaries and curves: sRGB, Display P3, Adobe RGB and their like, to linear Rec.709.

The format is that of the International Color Consortium, ICC.1 (ISO 15076-1).
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]

SRGB_PRIMARIES = np.array(
    [[0.4360747, 0.3850649, 0.1430804], [0.2225045, 0.7168786, 0.0606169], [0.0139322, 0.0971045, 0.7141733]]
)
"""XYZ of Rec.709's primaries as columns, adapted to the profiles' white D50 by Bradford's method."""

_SAME_PRIMARIES, _SCREEN_CURVES = (1, 2), (1, 2, 6, 13)
"""Numbers of ITU-T H.273: primaries of Rec.709 or unknown, and transfer curves of pictures for the screen."""


@dataclass(frozen=True)
class ColourProfile:
    """How an image's numbers become linear light.

    Attributes:
        curves: for each channel the linear light of evenly spaced numbers from 0 to 1, shape (3, n).
        to_rec709: linear light of the profile's primaries to that of Rec.709, shape (3, 3).
    """

    curves: FloatArray
    to_rec709: FloatArray


def srgb_profile(levels: int = 4096) -> ColourProfile:
    """IEC 61966-2-1, what an image without a profile is taken to be in."""
    code = np.linspace(0.0, 1.0, levels)
    linear = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
    return ColourProfile(np.broadcast_to(linear, (3, levels)), np.eye(3))


def unlike_srgb_numbers(primaries: int, curve: int) -> str | None:
    """What is to be said of colours stated by numbers of ITU-T H.273, as HEIC and PNG may; ``None`` where sRGB will do."""
    if primaries in _SAME_PRIMARIES and curve in _SCREEN_CURVES:
        return None
    return f"its colours (primaries {primaries}, curve {curve} of ITU-T H.273) are not those of sRGB"


def read_profile(data: bytes) -> ColourProfile:
    """Read a profile of an RGB or grey image.

    Raises:
        ValueError: it is damaged, or of another kind, such as one with tables for print.
    """
    try:
        return _profile(data)
    except (struct.error, IndexError, OverflowError) as error:
        raise ValueError("the colour profile is damaged") from error


def _profile(data: bytes) -> ColourProfile:
    space = data[16:20].decode("latin-1").strip()
    if data[36:40] != b"acsp" or space not in ("RGB", "GRAY"):
        raise ValueError(f"a colour profile of the space '{space}' is not read")
    (count,) = struct.unpack_from(">I", data, 128)
    tags: dict[str, bytes] = {}
    for entry in range(min(count, 1000)):
        name, offset, size = struct.unpack_from(">4sII", data, 132 + 12 * entry)
        tags[name.decode("latin-1")] = data[offset : offset + size]
    if space == "GRAY" and "kTRC" in tags:
        return ColourProfile(np.broadcast_to(_curve(tags["kTRC"]), (3, 4096)), np.eye(3))
    needed = [f"{channel}{kind}" for kind in ("XYZ", "TRC") for channel in "rgb"]
    if any(name not in tags for name in needed):
        raise ValueError("the colour profile has no primaries and curves, but tables")
    primaries = np.stack([_xyz(tags[name]) for name in needed[:3]], axis=1)
    curves = np.stack([_curve(tags[name]) for name in needed[3:]])
    to_rec709 = np.linalg.inv(SRGB_PRIMARIES) @ primaries
    if np.allclose(to_rec709, np.eye(3), atol=2e-3):  # sRGB up to the profile's rounding.
        to_rec709 = np.eye(3)
    return ColourProfile(curves, to_rec709)


def _xyz(tag: bytes) -> FloatArray:
    return np.array(struct.unpack_from(">3i", tag, 8)) / 65536.0


def _curve(tag: bytes) -> FloatArray:
    """A tone curve at 4096 evenly spaced numbers."""
    code = np.linspace(0.0, 1.0, 4096)
    kind = tag[:4]
    if kind == b"curv":
        (count,) = struct.unpack_from(">I", tag, 8)
        if count == 0:
            return code
        values = np.array(struct.unpack_from(f">{count}H", tag, 12))
        if count == 1:
            return code ** (values[0] / 256.0)
        return np.interp(code, np.linspace(0.0, 1.0, count), values / 65535.0)
    if kind != b"para":
        raise ValueError("the colour profile has a tone curve of an unknown kind")
    (function,) = struct.unpack_from(">H", tag, 8)
    counts = (1, 3, 4, 5, 7)
    if function >= len(counts):
        raise ValueError("the colour profile has a tone curve of an unknown kind")
    g, a, b, c, d, e, f = _parameters(struct.unpack_from(f">{counts[function]}i", tag, 12), function)
    with np.errstate(invalid="ignore"):
        upper = np.maximum(a * code + b, 0.0) ** g + e
    return np.where(code >= d, upper, c * code + f)


def _parameters(fixed: tuple[int, ...], function: int) -> tuple[float, ...]:
    """The seven parameters of the most general of the parametric curves, ``(a x + b)^g + e`` from d on, else c x + f."""
    values = [value / 65536.0 for value in fixed]
    match function:
        case 0:
            return values[0], 1.0, 0.0, 0.0, 0.0, 0.0, 0.0
        case 1:  # 0 below -b / a.
            return *values[:3], 0.0, -values[2] / values[1], 0.0, 0.0
        case 2:  # c below -b / a, and c added above.
            return *values[:3], 0.0, -values[2] / values[1], values[3], values[3]
        case 3:
            return *values[:5], 0.0, 0.0
        case _:
            return tuple(values[:7])
