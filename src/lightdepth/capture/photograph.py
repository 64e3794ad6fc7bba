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
from lightdepth.images.adobe_rgb import is_adobe_rgb
from lightdepth.images.orientation import upright
from lightdepth.images.pixels import read_pixels
from lightdepth.packages import optional_package
from lightdepth.parameters.capture import DEFAULT, CaptureParameters

Codes = NDArray[np.uint8] | NDArray[np.uint16]
"""Camera readings: RGB, shape (height, width, 3), 0 is black and the type's largest value is white."""
WhiteBalance = tuple[float, ...]
"""Multipliers of a sensor's red, green, blue and second green."""

DEVELOPED = (".jpg", ".jpeg", ".insp", ".png", ".tif", ".tiff")
RAW = (
    ".3fr", ".arw", ".cr2", ".cr3", ".crw", ".dcr", ".dng", ".erf", ".fff", ".gpr", ".iiq", ".kdc", ".mef", ".mos", ".mrw",
    ".nef", ".nrw", ".orf", ".pef", ".raf", ".raw", ".rw2", ".rwl", ".sr2", ".srf", ".srw", ".x3f",
)  # fmt: skip
PHOTOGRAPHS = DEVELOPED + RAW
"""File name extensions of photographs."""
OTHER_PICTURES = (
    ".avif", ".bmp", ".dpx", ".gif", ".heic", ".heif", ".jp2", ".jxl", ".jxr", ".mpo", ".psb", ".psd", ".tga", ".webp",
)  # fmt: skip
"""Extensions of pictures that are not read as photographs."""

_XYZ_OF_REC709 = np.array(
    [[0.412453, 0.357580, 0.180423], [0.212671, 0.715160, 0.072169], [0.019334, 0.119193, 0.950227]]
)
"""As LibRaw has it, to five digits, so that colours are those that it makes."""


def is_raw(path: Path) -> bool:
    """Whether a file is camera RAW by its name; its readings are then linear."""
    return path.suffix.lower() in RAW


def read_photograph(path: Path, orientation: int = 1, white_balance: WhiteBalance | None = None) -> Codes:
    """Read a photograph as the sensor saw it.

    Args:
        path: the file. RAW is developed linearly by LibRaw in the camera's own colours (see :func:`camera_colours`), so
            that the sensor's white is the largest reading of each channel whatever the picture holds.
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


def shared_white_balance(photographs: Sequence[Path], tuned: CaptureParameters = DEFAULT) -> WhiteBalance | None:
    """One white balance for all photographs of a shoot, for colours that change between them cannot be merged.

    Cameras on automatic choose again for every photograph. The median of their choices is taken.

    Args:
        photographs: all RAW, or none.
        tuned: by how much they may differ without a warning.

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
        raise InputError(
            f"{other}: is not a RAW file, but {raw[0].name} is; all photographs of a shoot must be of one kind"
        )
    balances, whites = [], []
    for path in raw:
        with _opened(path) as file:
            balances.append(_balance_of(file, path))
            whites.append(file.white_level)
    if len(set(whites)) > 1:
        odd = raw[next(index for index, white in enumerate(whites) if white != whites[0])]
        warn(
            f"{raw[0].parent}: the white level is {whites[0]} in {raw[0].name} and another in {odd.name}; each "
            "photograph is scaled by its own"
        )
    found = np.array(balances)
    shared = np.exp(np.median(np.log(found), axis=0))
    off = np.abs(np.log(found / shared)).max(axis=1)
    if off.max() > tuned.white_balance_same:
        name = raw[int(off.argmax())].name
        warn(
            f"{raw[0].parent}: the camera's white balance changes between the photographs, most in {name}, by "
            f"{100 * np.expm1(off.max()):.0f} %; the median of all {len(raw)} is used for each"
        )
    return tuple(shared.tolist())


def camera_colours(path: Path) -> NDArray[np.float64] | None:
    """What makes linear Rec.709 of a RAW file's readings.

    It is applied after merging: readings that clip would mix into channels that do not, where nothing shows it.

    Returns:
        Matrix, shape (3, 3), that keeps grey; ``None`` for developed photographs and grey or four-coloured sensors.

    Raises:
        InputError: the file cannot be read.
    """
    if not is_raw(path):
        return None
    with _opened(path) as raw:
        if not _is_of_three_colours(raw):
            return None
        own, from_xyz = np.asarray(raw.color_matrix)[:, :3], np.asarray(raw.rgb_xyz_matrix)[:3]
        # As LibRaw chooses: what a DNG states, else what LibRaw knows of the camera.
        if own[0, 0] > 0.125 and (path.suffix.lower() == ".dng" or not from_xyz.any()):
            return own.astype(np.float64)
        if from_xyz.any():
            camera = from_xyz @ _XYZ_OF_REC709
            return np.linalg.inv(camera / camera.sum(axis=1, keepdims=True))
    warn(f"{path}: neither the file nor LibRaw knows the colours of this camera; they are taken to be those of Rec.709")
    return None


def unlike_srgb(photographs: Sequence[Path]) -> str | None:
    """A note where developed photographs have colours other than sRGB's, by their profile or EXIF data.

    Such colours are not converted, for the curve of a profile is not the camera's response.
    """
    found = [(path, colours) for path in photographs if (colours := _stated_colours(path)) is not None]
    if not found:
        return None
    more = f" (and {len(found) - 1} others like it)" if len(found) > 1 else ""
    return f"{found[0][0].name}{more}: {found[0][1]}; this is not applied, sRGB is assumed"


def _stated_colours(path: Path) -> str | None:
    from PIL import Image, ImageCms

    if is_raw(path):
        return None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Of damaged EXIF data, which are read elsewhere.
            with Image.open(path) as image:
                profile = image.info.get("icc_profile")
                marked = is_adobe_rgb(image)
        if not profile:
            return "its EXIF data say that its colours are those of Adobe RGB" if marked else None
        name = ImageCms.getProfileDescription(ImageCms.ImageCmsProfile(io.BytesIO(profile))).strip()
    except Exception:  # Of damaged data anything is raised; what cannot be read is reported where the pixels are.
        return None
    return None if "srgb" in name.lower().replace(" ", "") else f"its colour profile is '{name}'"


def _read_developed(path: Path) -> Codes:
    pixels = read_pixels(path, "image")
    if pixels.dtype not in (np.uint8, np.uint16):
        raise InputError(f"{path}: has {pixels.dtype} values; photographs have 8 or 16 bits")
    if pixels.shape[2] in (2, 4) and (share := float((pixels[:, :, -1] < np.iinfo(pixels.dtype).max).mean())):
        warn(f"{path}: {100.0 * share:.3g} % of it are transparent; photographs are opaque, so this is not applied")
    if pixels.shape[2] < 3:  # Grey, and perhaps alpha.
        return np.repeat(pixels[:, :, :1], 3, axis=2)
    return np.ascontiguousarray(pixels[:, :, :3])


def _read_raw(path: Path, white_balance: WhiteBalance | None) -> Codes:
    with _opened(path) as raw:
        import rawpy

        colours = raw.num_colors
        balance = white_balance or _balance_of(raw, path)
        if colours == 1:
            balance = (1.0, 1.0, 1.0, 1.0)
        pixels = raw.postprocess(
            gamma=(1, 1),
            no_auto_bright=True,
            adjust_maximum_thr=0.0,  # Else white is the brightest pixel, another one in every file.
            output_bps=16,
            user_wb=list(balance),
            user_sat=_white_of_linear_rgb(raw, balance) if raw.raw_type == rawpy.RawType.Stack else None,
            user_flip=0,
            output_color=rawpy.ColorSpace.raw if _is_of_three_colours(raw) else rawpy.ColorSpace.sRGB,
        )
    return np.repeat(pixels[:, :, :1], 3, axis=2) if colours == 1 else pixels


def _is_of_three_colours(raw: Any) -> bool:
    return bool(raw.num_colors == 3)


def _white_of_linear_rgb(raw: Any, balance: WhiteBalance) -> int:
    """White of a file of linear RGB above the black level of the channel that is multiplied least.

    LibRaw subtracts the black levels, but reduces the white by none of them; what it calls white is greater than the
    file's by as much as the first channel's black level is greater than the least one.
    """
    black = raw.black_level_per_channel[:3]
    return int(raw.white_level - (black[0] - min(black)) - black[int(np.argmin(balance[:3]))])


def _balance_of(raw: Any, path: Path) -> WhiteBalance:
    """The camera's white balance, or that of daylight where it states none; the second green is the first where unset."""
    camera = list(raw.camera_whitebalance)
    chosen = camera
    if not min(camera[:3]) > 0.0:
        chosen = list(raw.daylight_whitebalance)
        if raw.num_colors > 1:
            warn(f"{path}: states no white balance; that of daylight is used")
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
