"""Adobe RGB (1998), which cameras state by a mark in the EXIF data instead of a profile (DCF 2.0)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from lightdepth.images.chromaticities import COLOUR_SPACES, to_rec709
from lightdepth.images.icc import ColourProfile

_INTEROPERABILITY, _INDEX, _MARK = 0xA005, 1, "R03"
_GAMMA = 563.0 / 256.0


def is_adobe_rgb(image: Image.Image) -> bool:
    """Whether an image's EXIF data have the mark."""
    return bool(image.getexif().get_ifd(_INTEROPERABILITY).get(_INDEX) == _MARK)


def adobe_rgb_profile(path: Path) -> ColourProfile:
    """The curves and primaries; ``path`` is for messages."""
    matrix = to_rec709(COLOUR_SPACES["lin_adobergb_scene"], path)
    assert matrix is not None
    return ColourProfile(np.broadcast_to(np.linspace(0.0, 1.0, 4096) ** _GAMMA, (3, 4096)), matrix.astype(np.float64))
