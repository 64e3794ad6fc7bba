"""The header of Radiance HDR files (G. Ward, "Real pixels", Graphics Gems II, and the format's reference)."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from lightdepth.errors import InputError

_LONGEST_HEADER = 2**16


@dataclass(frozen=True)
class RgbeHeader:
    """What the header says.

    Attributes:
        width: pixels.
        height: pixels.
        exposure: what the radiance was multiplied by before it was stored; the product of all ``EXPOSURE`` lines.
    """

    width: int
    height: int
    exposure: float


def read_header(path: Path) -> RgbeHeader:
    """Read and check the header of a Radiance HDR file.

    Raises:
        InputError: it is no such file, or holds XYZ colours, or its rows or columns run the other way.
    """
    try:
        with path.open("rb") as file:
            start = file.read(_LONGEST_HEADER).decode("latin-1")
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    header, separator, rest = start.partition("\n\n")
    if not start.startswith("#?") or not separator:
        raise InputError(f"{path}: not a Radiance HDR file: it does not start with '#?' and a header")
    form = re.search(r"^FORMAT=\s*(\S+)", header, re.MULTILINE)
    if form and form[1] != "32-bit_rle_rgbe":
        raise InputError(f"{path}: its pixels are '{form[1]}'; '32-bit_rle_rgbe' is needed")
    size = rest.partition("\n")[0]
    ordinary = re.fullmatch(r"-Y (\d+) \+X (\d+)\s*", size)
    if not ordinary:
        raise InputError(f"{path}: its rows and columns are given as '{size[:40]}'; '-Y height +X width' is needed")
    exposure = 1.0
    for line in re.findall(r"^EXPOSURE=\s*(\S+)", header, re.MULTILINE):
        try:
            exposure *= float(line)
        except ValueError:
            exposure = 0.0
    if not 0.0 < exposure < float("inf"):
        raise InputError(f"{path}: EXPOSURE in its header must be a positive number")
    return RgbeHeader(int(ordinary[2]), int(ordinary[1]), exposure)
