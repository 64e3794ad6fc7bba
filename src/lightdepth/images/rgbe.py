"""Radiance HDR files (G. Ward, "Real pixels", Graphics Gems II, and the format's reference)."""

from __future__ import annotations

import re
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import OpenImageIO
from numpy.typing import NDArray

from lightdepth.errors import InputError, warn
from lightdepth.images.chromaticities import CIE_XYZ, converted, to_rec709
from lightdepth.images.pixels import read_pixels
from lightdepth.images.writing import whole_file

_LONGEST_HEADER = 2**16
_MOST_COMPRESSED = 150
"""A run of 127 pixels takes 2 bytes in each of 4 channels."""
_FORMATS = ("32-bit_rle_rgbe", "32-bit_rle_xyze")
_APPLIED = ("FORMAT", "EXPOSURE", "COLORCORR", "PRIMARIES", "GAMMA", "PIXASPECT")
_REMARKS = (
    *("SOFTWARE", "CAPDATE", "GMT", "DATE", "TITLE", "AUTHOR", "OWNER", "COPYRIGHT", "COMMENT", "DESCRIPTION"),
    *("LATLONG", "CREATOR", "VERSION", "NAME", "CAMERA", "LENS"),
)
"""Lines of the header that change no pixel."""


@dataclass(frozen=True)
class RgbeHeader:
    """What the header says.

    Attributes:
        scanlines: how many there are.
        length: pixels of one.
        columns: scanlines are columns of the picture, not rows.
        upward: rows go from the bottom to the top.
        leftward: columns go from the right to the left.
        factors: what red, green and blue were multiplied by before they were stored: the product of all ``EXPOSURE`` and
            ``COLORCORR`` lines, shape (3,).
        matrix: from the file's primaries to Rec.709, shape (3, 3); ``None`` where they are the same.
        start: bytes before the pixels.
    """

    scanlines: int
    length: int
    columns: bool
    upward: bool
    leftward: bool
    factors: NDArray[np.float32]
    matrix: NDArray[np.float32] | None
    start: int


def read_rgbe(path: Path) -> NDArray[np.float32]:
    """Read a Radiance HDR file: flat, or with old or new run lengths, in RGB of any primaries or XYZ, any way round.

    Returns:
        Linear Rec.709, shape (height, width, 3), float32.

    Raises:
        InputError: it is no such file, or its pixels are damaged or cut off.
    """
    header = read_header(path)
    shape = (header.scanlines, header.length)
    if shape[0] * shape[1] > max(2**24, _MOST_COMPRESSED * path.stat().st_size):
        raise _damaged(path)
    with path.open("rb") as file:
        file.seek(header.start)
        first = file.read(4)
        if len(first) == 4 and first[:2] == b"\2\2" and 256 * first[2] + first[3] == header.length:
            pixels = _run_lengths(path, header)
        else:
            pixels = _flat_or_old(first + file.read(), shape, path)
    if (header.factors != 1.0).any():
        with np.errstate(over="ignore"):  # What overflows is reported where radiance is checked.
            pixels /= header.factors
    pixels = converted(pixels, header.matrix)
    if header.columns:
        pixels = pixels.swapaxes(0, 1)
    return np.ascontiguousarray(pixels[:: -1 if header.upward else 1, :: -1 if header.leftward else 1])


def read_header(path: Path) -> RgbeHeader:
    """Read and check the header of a Radiance HDR file.

    Lines may end like those of Unix or Windows. An exposure or primaries of 0, as FreeImage and Photoshop write them,
    say nothing.

    Raises:
        InputError: it is no such file, or a value in the header has no meaning.
    """
    try:
        with path.open("rb") as file:
            start = file.read(_LONGEST_HEADER)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    lines = re.match(rb"(#\?.*?)\r?\n\r?\n([^\n]*)\n", start, re.DOTALL)
    if not lines:
        raise InputError(f"{path}: not a Radiance HDR file: it does not start with '#?' and a header")
    header, size = lines[1].decode("latin-1").replace("\r", ""), lines[2].decode("latin-1").strip()
    form = re.search(r"^FORMAT=\s*(\S+)", header, re.MULTILINE)
    if form is not None and form[1] not in _FORMATS:
        raise InputError(f"{path}: its pixels are '{form[1]}'; {' or '.join(map(repr, _FORMATS))} is needed")
    axes = re.fullmatch(r"([-+])([XY])\s+(\d+)\s+([-+])([XY])\s+(\d+)", size)
    if not axes or axes[2] == axes[5] or not int(axes[3]) or not int(axes[6]):
        raise InputError(
            f"{path}: its rows and columns are given as '{size[:40]}'; two of X and Y with a sign and a size are needed, "
            "such as '-Y 512 +X 1024'"
        )
    sign = {axes[2]: axes[1], axes[5]: axes[4]}
    factors = np.ones(3)
    for name, count in (("EXPOSURE", 1), ("COLORCORR", 3)):
        for text in re.findall(rf"^{name}=(.*)", header, re.MULTILINE):
            with np.errstate(over="ignore", under="ignore"):
                factors = factors * _factors(text, name, count, path)
    _name_what_is_not_applied(header, path)
    least, greatest = np.finfo(np.float32).tiny, np.finfo(np.float32).max
    if not ((factors >= least) & (factors <= greatest)).all():
        raise InputError(f"{path}: EXPOSURE and COLORCORR in its header multiply to {factors.tolist()}")
    return RgbeHeader(
        scanlines=int(axes[3]),
        length=int(axes[6]),
        columns=axes[2] == "X",
        upward=sign["Y"] == "+",
        leftward=sign["X"] == "-",
        factors=factors.astype(np.float32),
        matrix=_matrix(header, form is not None and form[1] == _FORMATS[1], path),
        start=lines.end(),
    )


def _name_what_is_not_applied(header: str, path: Path) -> None:
    """Warn of what a header says beside what is applied. Indented lines are those of the pictures it was made of."""
    for text in re.findall(r"^GAMMA=\s*(\S+)", header, re.MULTILINE):
        if text.rstrip("0").rstrip(".") != "1":
            warn(f"{path}: GAMMA={text} in its header is not applied: pixels of this format are linear")
    for text in re.findall(r"^PIXASPECT=\s*(\S+)", header, re.MULTILINE):
        if text.rstrip("0").rstrip(".") not in ("1", ""):
            warn(f"{path}: PIXASPECT={text} in its header is not applied: its pixels are taken to be square")
    if len(set(re.findall(r"^FORMAT=\s*(\S+)", header, re.MULTILINE))) > 1:
        warn(f"{path}: its header states several formats; the first counts")
    for name, text in re.findall(r"^([A-Za-z_]+ ?)=(.*)", header, re.MULTILINE):
        if name not in _APPLIED and name.upper().strip() not in _REMARKS:
            warn(f"{path}: '{name}={text.strip()[:40]}' in its header is not applied")
    for text in re.findall(r"^ +((?:EXPOSURE|COLORCORR|PRIMARIES) *=.*)", header, re.MULTILINE):
        warn(f"{path}: '{text.strip()[:40]}' is indented in its header, as what was applied before, and not applied")


def _numbers(text: str, name: str, path: Path) -> list[float]:
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        numbers = [float("nan")]
    if not np.isfinite(numbers).all():
        raise InputError(f"{path}: {name} in its header is '{text.strip()[:40]}'; numbers are needed")
    return numbers


def _factors(text: str, name: str, count: int, path: Path) -> NDArray[np.float64]:
    """What a line multiplied the pixels by; 1 where it says 0."""
    numbers = _numbers(text, name, path) or [0.0]
    if not any(numbers):
        return np.ones(count)
    if len(numbers) != count or not min(numbers) > 0.0:
        raise InputError(f"{path}: {name} in its header is '{text.strip()[:40]}'; {count} positive are needed")
    return np.array(numbers)


def _matrix(header: str, tristimulus: bool, path: Path) -> NDArray[np.float32] | None:
    if tristimulus:
        return to_rec709(CIE_XYZ, path)
    primaries = re.findall(r"^PRIMARIES=(.*)", header, re.MULTILINE)
    numbers = _numbers(primaries[-1], "PRIMARIES", path) if primaries else [0.0]
    return to_rec709(numbers, path) if any(numbers) else None


def _run_lengths(path: Path, header: RgbeHeader) -> NDArray[np.float32]:
    """Pixels with run lengths, channel by channel, as they are stored."""
    with tempfile.TemporaryDirectory(prefix="lightdepth-hdr-") as folder:
        plain = Path(folder) / "plain.hdr"  # OpenImageIO reads rows from the top, of RGB only.
        with path.open("rb") as source, plain.open("wb") as target:
            source.seek(header.start)
            size = f"-Y {header.scanlines} +X {header.length}\n"
            target.write(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n" + size.encode())
            while block := source.read(2**24):
                target.write(block)
        try:
            pixels = read_pixels(plain, "Radiance HDR file")
        except InputError as error:
            raise _damaged(path) from error
    return pixels


def _flat_or_old(data: bytes, shape: tuple[int, int], path: Path) -> NDArray[np.float32]:
    """Pixels of four bytes each, of which some (1, 1, 1, n) may say that the one before comes n times more."""
    count = shape[0] * shape[1]
    pixels = np.frombuffer(data, np.uint8, len(data) // 4 * 4).reshape(-1, 4)
    runs = (pixels[:, :3] == 1).all(axis=1)
    if runs.any():
        if runs[0]:
            raise _damaged(path)
        own = np.arange(len(pixels))
        single = np.maximum.accumulate(np.where(runs, 0, own))
        # Runs that follow each other are the digits of one, lowest first.
        digit = np.minimum(own - single - 1, 4)
        counts = np.where(runs, pixels[:, 3].astype(np.int64) << (8 * np.maximum(digit, 0)), 1)
        needed = int(np.searchsorted(np.cumsum(counts), count)) + 1
        counts = np.minimum(counts[:needed], count)
        pixels = np.repeat(pixels[single[:needed]], counts, axis=0)
    if len(pixels) < count:
        raise _damaged(path)
    pixels = pixels[:count]
    scale = np.where(pixels[:, 3] > 0, np.ldexp(np.float32(1.0), pixels[:, 3].astype(np.int32) - 136), np.float32(0.0))
    return (pixels[:, :3] * scale[:, None]).astype(np.float32).reshape(*shape, 3)


def _damaged(path: Path) -> InputError:
    return InputError(f"{path}: not a readable Radiance HDR file: its pixels are damaged or cut off")


def write_rgbe(path: Path, radiance: NDArray[np.float32]) -> None:
    """Write a Radiance HDR file, rounded to the nearest mantissas; the file appears whole or not at all.

    Args:
        path: where to write; an existing file is replaced.
        radiance: linear Rec.709, shape (height, width, 3), float32; finite and not negative.

    Raises:
        InputError: the file cannot be written.
    """
    # OpenImageIO cuts the mantissas off. Half a step of the brightest channel's 8 bits more makes that rounding to
    # nearest.
    brightest = radiance.max(axis=2, keepdims=True)
    half_step = np.where(brightest > 0.0, np.ldexp(np.float32(0.5), np.frexp(brightest)[1] - 8), np.float32(0.0))
    with whole_file(path) as temporary:
        image: Any = OpenImageIO.ImageOutput.create(str(temporary))
        spec = OpenImageIO.ImageSpec(radiance.shape[1], radiance.shape[0], 3, "float")
        written = image.open(str(temporary), spec) and image.write_image(radiance + half_step)
        image.geterror()
        if not (image.close() and written):
            OpenImageIO.geterror()
            raise InputError(f"{path}: cannot be written (is the disk full?)")
