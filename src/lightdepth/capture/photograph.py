"""Photographs as the camera wrote them: JPEG, PNG, TIFF and camera RAW."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError, warn
from lightdepth.images.orientation import upright
from lightdepth.images.pixels import read_pixels
from lightdepth.packages import optional_package

Codes = NDArray[np.uint8] | NDArray[np.uint16]
"""Camera readings: RGB, shape (height, width, 3), 0 is black and the type's largest value is white."""
WhiteBalance = tuple[float, ...]
"""Multipliers of a sensor's red, green, blue and second green."""

DEVELOPED = (".jpg", ".jpeg", ".png", ".tif", ".tiff")
RAW = (".arw", ".cr2", ".cr3", ".crw", ".dng", ".nef", ".nrw", ".orf", ".pef", ".raf", ".raw", ".rw2", ".srw", ".x3f")
PHOTOGRAPHS = DEVELOPED + RAW
"""File name extensions of photographs."""

_SAME_BALANCE = 0.01


def is_raw(path: Path) -> bool:
    """Whether a file is camera RAW by its name; its readings are then linear."""
    return path.suffix.lower() in RAW


def read_photograph(path: Path, orientation: int = 1, white_balance: WhiteBalance | None = None) -> Codes:
    """Read a photograph as the sensor saw it.

    Args:
        path: the file. RAW is developed linearly by LibRaw to Rec.709 primaries, so that the sensor's white is the
            largest reading whatever the picture holds.
        orientation: EXIF orientation to undo (1: leave as the sensor saw it).
        white_balance: of RAW, see :func:`shared_white_balance`; ``None`` is the photograph's own.

    Returns:
        Camera readings, RGB, 8 or 16 bits.

    Raises:
        InputError: the file is missing, is no readable photograph, or has a type that has no white.
        SetupError: it is RAW and the package that reads it is not installed.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    if path.suffix.lower() not in PHOTOGRAPHS:
        raise InputError(f"{path}: '{path.suffix}' is not a photograph; allowed are {', '.join(PHOTOGRAPHS)}")
    codes = _read_raw(path, white_balance) if is_raw(path) else _read_developed(path)
    return upright(codes, orientation)


def shared_white_balance(photographs: Sequence[Path]) -> WhiteBalance | None:
    """One white balance for all photographs of a shoot, for colours that change between them cannot be merged.

    Cameras on automatic choose again for every photograph. The median of their choices is taken.

    Args:
        photographs: all RAW, or none.

    Returns:
        Multipliers; ``None`` for developed photographs, whose white balance is in their pixels.

    Raises:
        InputError: RAW and developed photographs are mixed, or a file cannot be read.
    """
    raw = [path for path in photographs if is_raw(path)]
    if not raw:
        return None
    if len(raw) < len(photographs):
        other = next(path for path in photographs if not is_raw(path))
        raise InputError(f"{other}: is no RAW file, but {raw[0].name} is; a shoot must be all of one kind")
    found = np.array([_white_balance(path) for path in raw])
    shared = np.exp(np.median(np.log(found), axis=0))
    off = np.abs(np.log(found / shared)).max(axis=1)
    if off.max() > _SAME_BALANCE:
        name = raw[int(off.argmax())].name
        warn(
            f"{raw[0].parent}: the camera's white balance changes between the photographs, most in {name}, by "
            f"{100 * np.expm1(off.max()):.0f} %; the median of all {len(raw)} is used for each"
        )
    return tuple(shared.tolist())


def foreign_profile(path: Path) -> str | None:
    """Name of a colour profile other than sRGB in a developed photograph; such profiles are not applied."""
    from PIL import Image, ImageCms

    if is_raw(path):
        return None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Of damaged EXIF data, which are read elsewhere.
            with Image.open(path) as image:
                profile = image.info.get("icc_profile")
        if not profile:
            return None
        name = ImageCms.getProfileDescription(ImageCms.ImageCmsProfile(io.BytesIO(profile))).strip()
    except (OSError, SyntaxError, ImageCms.PyCMSError):
        return None  # What cannot be read is reported where the pixels are.
    return None if "srgb" in name.lower().replace(" ", "") else name


def _read_developed(path: Path) -> Codes:
    pixels = read_pixels(path, "image")
    if pixels.dtype not in (np.uint8, np.uint16):
        raise InputError(f"{path}: has {pixels.dtype} values; photographs have 8 or 16 bits")
    if pixels.shape[2] < 3:  # Grey, and perhaps alpha.
        return np.repeat(pixels[:, :, :1], 3, axis=2)
    return np.ascontiguousarray(pixels[:, :, :3])


def _read_raw(path: Path, white_balance: WhiteBalance | None) -> Codes:
    with _opened(path) as raw:
        import rawpy

        balance = white_balance or _balance_of(raw)
        return raw.postprocess(
            gamma=(1, 1),
            no_auto_bright=True,
            adjust_maximum_thr=0.0,  # Else white is the brightest pixel, another one in every file.
            output_bps=16,
            user_wb=list(balance),
            user_sat=_white_of_linear_rgb(raw, balance) if raw.raw_type == rawpy.RawType.Stack else None,
            user_flip=0,
            output_color=rawpy.ColorSpace.sRGB,
        )


def _white_of_linear_rgb(raw: Any, balance: WhiteBalance) -> int:
    """White of a file of linear RGB above the black level of the channel that is multiplied least.

    LibRaw subtracts the black levels, but reduces the white by none of them; what it calls white is greater than the
    file's by as much as the first channel's black level is greater than the least one.
    """
    black = raw.black_level_per_channel[:3]
    return int(raw.white_level - (black[0] - min(black)) - black[int(np.argmin(balance[:3]))])


def _white_balance(path: Path) -> WhiteBalance:
    with _opened(path) as raw:
        return _balance_of(raw)


def _balance_of(raw: Any) -> WhiteBalance:
    """The camera's white balance, or that of daylight where it states none; the second green is the first where unset."""
    camera = list(raw.camera_whitebalance)
    chosen = camera if min(camera[:3]) > 0.0 else list(raw.daylight_whitebalance)
    if not min(chosen[:3]) > 0.0:
        chosen = [1.0, 1.0, 1.0, 1.0]
    chosen[3] = chosen[3] if chosen[3] > 0.0 else chosen[1]
    return tuple(value / chosen[1] for value in chosen)


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    rawpy = optional_package("rawpy", "capture")
    try:
        with rawpy.imread(str(path)) as raw:
            yield raw
    except rawpy.LibRawError as error:
        raise InputError(
            f"{path}: not a RAW file that LibRaw can read; it is damaged, cut off, or of an unknown camera"
        ) from error
