"""Colours that a PNG file states by chunks of its own instead of a profile (W3C, PNG, third edition)."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from lightdepth.images.chromaticities import to_rec709
from lightdepth.images.icc import ColourProfile, srgb_profile, unlike_srgb_numbers

SCREEN_GAMMA = 45455
"""What stands for sRGB's curve in ``gAMA``."""
_NEAR = 2500


def png_profile(path: Path) -> ColourProfile:
    """What ``cICP``, ``sRGB``, ``gAMA`` and ``cHRM`` say, in this order; sRGB where there is none of them.

    Raises:
        ValueError: the curve or the primaries of ``cICP`` are not read, such as those of HDR video.
    """
    found = dict(_chunks(path))
    profile = srgb_profile()
    if len(code := found.get(b"cICP", b"")) == 4:
        if (unlike := unlike_srgb_numbers(code[0], code[1])) is not None:
            raise ValueError(unlike)
        return profile
    if b"sRGB" in found:
        return profile
    curves, matrix = profile.curves, profile.to_rec709
    if len(text := found.get(b"gAMA", b"")) == 4:
        (gamma,) = struct.unpack(">I", text)
        if gamma and abs(gamma - SCREEN_GAMMA) > _NEAR:
            curves = np.broadcast_to(np.linspace(0.0, 1.0, curves.shape[1]) ** (1e5 / gamma), curves.shape)
    if len(text := found.get(b"cHRM", b"")) == 32:
        numbers = np.array(struct.unpack(">8I", text)) / 1e5
        converted = to_rec709(np.roll(numbers, -2), path)
        matrix = matrix if converted is None else converted.astype(np.float64)
    return ColourProfile(curves, matrix)


def _chunks(path: Path) -> Iterator[tuple[bytes, bytes]]:
    """Chunks before the pixels, by name."""
    with path.open("rb") as file:
        file.seek(8)
        while len(head := file.read(8)) == 8 and head[4:] != b"IDAT":
            (size,) = struct.unpack_from(">I", head)
            if size > 64:
                file.seek(size + 4, 1)
            else:
                yield head[4:], file.read(size)
                file.seek(4, 1)
