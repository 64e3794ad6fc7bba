"""Panoramas as cameras and stitching programs save them: JPEG, PNG, TIFF and HEIC, to linear radiance."""

from __future__ import annotations

import io
import shlex
import struct
import warnings
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from PIL import Image, TiffImagePlugin

from lightdepth.directions import pixel_solid_angles
from lightdepth.errors import InputError, warn
from lightdepth.images.adobe_rgb import adobe_rgb_profile, is_adobe_rgb
from lightdepth.images.filling import fill
from lightdepth.images.gain_map import GainMap, has_gain_map, read_gain_map
from lightdepth.images.gpano import PhotoSphere, read_photo_sphere
from lightdepth.images.icc import ColourProfile, read_profile, srgb_profile, unlike_srgb_numbers
from lightdepth.images.orientation import upright
from lightdepth.images.panorama_image import PanoramaImage
from lightdepth.images.pixels import read_pixels
from lightdepth.images.png_colours import png_profile
from lightdepth.images.radiance import OPAQUE
from lightdepth.packages import optional_package

HEIF = (".heic", ".heif")
EXTENSIONS = (".jpg", ".jpeg", ".png", ".tif", ".tiff", *HEIF)
_ORIENTATION = 274
_XMP_TAG, _ICC_TAG, _PHOTOMETRIC_TAG = 700, 34675, 262
_OTHER_COLOURS = {5: "CMYK", 8: "CIE L*a*b*", 9: "ICC L*a*b*", 10: "ITU L*a*b*"}
TIFF_STARTS = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_ORIENTATIONS = {
    2: "mirrored",
    3: "upside down",
    4: "mirrored and upside down",
    5: "mirrored and on its side",
    6: "on its side",
    7: "mirrored and on its side",
    8: "on its side",
}
DARK_CORNER = 0.02
"""Share of the mean up to which what lies outside two circles is black."""


def read_photograph(path: Path) -> PanoramaImage:
    """Read a panorama for the screen, or one in linear float.

    Integer numbers are made linear by the embedded profile of colour, by what a PNG's own chunks or the EXIF mark of
    Adobe RGB say, or as sRGB; float numbers are linear already, and
    of a profile only the primaries count. A cropped sphere is padded, and pixels that are wholly transparent are
    unknown; both are filled smoothly from around them.

    Raises:
        InputError: the file is unreadable, no panorama, mirrored, upside down, or in colours that are not read.
        SetupError: HEIC, and the package that reads it is not installed.
    """
    pixels, profile, xmp, gains, orientation = _opened(path)
    turned = _ORIENTATIONS.get(orientation)
    if turned is not None:
        raise InputError(
            f"{path}: its metadata (EXIF orientation) says that it is stored {turned}; open it in an image program and "
            "save it upright, or set the orientation to 1 where it is upright already"
        )
    height, width = pixels.shape[:2]
    sphere = read_photo_sphere(xmp, width, height, str(path))
    _check_shape(pixels, sphere, path)
    notes = []
    known = np.ones((height, width), bool)
    if pixels.shape[2] == 4:
        known = pixels[..., 3] > 0
        partly = float((known & (pixels[..., 3] < _opaque(pixels))).mean())
        if partly > 0.001:
            notes.append(f"{path}: {100.0 * partly:.2g} % of it are partly transparent; nothing is put behind them")
        pixels = pixels[..., :3]
    gain_map = gains if isinstance(gains, GainMap) else None
    radiance = _linear(pixels, profile, gain_map)
    if gain_map is not None:
        notes.append(
            f"{path}: is HDR by its gain map, up to {gain_map.headroom:.3g} times the screen's white; lamps and suns that "
            "are brighter are cut off there, and TOO DARK. `lightdepth recover clipped` recovers what they light"
        )
    elif pixels.dtype.kind == "u":
        notes.append(_clipped_note(pixels, known, path))
    if isinstance(gains, str):
        notes.append(
            f"{path}: holds a gain map, which is not read ({gains}); export the HDR picture as OpenEXR or float TIFF"
        )
    if sphere is not None and (height, width) != (sphere.full_height, sphere.full_width):
        radiance, known = _padded(radiance, known, sphere)
    unknown = None
    if not known.all():
        unknown = ~known
        share = float((unknown.sum(axis=1) * pixel_solid_angles(*known.shape)).sum() / (4.0 * np.pi))
        notes.append(
            f"{path}: shows only a part of the sphere; {100.0 * share:.2g} % of all directions are not in it and were "
            "filled from around: light from there is unknown"
        )
        radiance = fill(radiance, known)
    return PanoramaImage(radiance, None if sphere is None else sphere.rotation, tuple(notes), unknown)


def _opaque(pixels: NDArray) -> float:
    """Alpha from which on a pixel counts as opaque."""
    return OPAQUE * (np.iinfo(pixels.dtype).max if pixels.dtype.kind == "u" else 1.0)


def read_flat_photograph(path: Path) -> NDArray[np.float32]:
    """Read an ordinary photograph of any shape, made linear as :func:`read_photograph` does it.

    Returns:
        Linear Rec.709, shape (height, width, 3), float32, turned upright as the metadata say; 1 is the screen's white. What
        is transparent is as in the file.

    Raises:
        InputError: the file is unreadable, or in colours that are not read.
        SetupError: HEIC, and the package that reads it is not installed.
    """
    pixels, profile, _, gains, orientation = _opened(path)
    return upright(_linear(pixels[..., :3], profile, gains if isinstance(gains, GainMap) else None), orientation)


def _opened(path: Path) -> tuple[NDArray, ColourProfile, bytes, GainMap | str | None, int]:
    """:func:`_decoded`, of HEIC as well."""
    if path.suffix.lower() in HEIF:
        optional_package("pillow_heif", "heic").register_heif_opener()
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", module="PIL")  # Of many pixels, and of EXIF data that are not read here.
        return _decoded(path)


def _decoded(path: Path) -> tuple[NDArray, ColourProfile, bytes, GainMap | str | None, int]:
    """What a file holds.

    Returns:
        Pixels of shape (h, w, 3 or 4) as uint8, uint16 or float32, profile, XMP packet, gain map or why it is not read, and
        EXIF orientation, which is not applied.
    """
    gains: GainMap | str | None = None
    marked = False
    try:
        with path.open("rb") as file:
            start = file.read(25)
        if start[:4] in TIFF_STARTS:
            icc, xmp, orientation = _tiff_tags(path)
            pixels = None
        else:
            # From memory, which gives no more than there is, whatever length a damaged chunk states.
            with Image.open(io.BytesIO(path.read_bytes())) as image:
                icc, xmp = image.info.get("icc_profile"), _xmp(image)
                marked = is_adobe_rgb(image)
                orientation = int(image.getexif().get(_ORIENTATION, 1) or 1)
                pixels = None if _sixteen_bit(start) else _eight_bit(image, path)
                if path.suffix.lower() in HEIF:
                    _check_heif_colours(image, path)
                gains = _gains(path, image, xmp)
    except (OSError, EOFError, SyntaxError, ValueError, TypeError, struct.error, Image.DecompressionBombError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else "damaged, or of another format"
        raise InputError(f"{path}: not a readable picture ({reason})") from error
    if pixels is None:
        pixels = _of_any_depth(path)
    try:
        profile = read_profile(icc) if icc else _profile_without_icc(path, start, marked)
    except ValueError as error:
        raise InputError(f"{path}: {error}; save the picture in sRGB") from error
    return pixels, profile, xmp, gains, orientation


def _profile_without_icc(path: Path, start: bytes, is_adobe_rgb: bool) -> ColourProfile:
    if start[:4] == b"\x89PNG":
        return png_profile(path)
    return adobe_rgb_profile(path) if is_adobe_rgb else srgb_profile()


def _gains(path: Path, image: Image.Image, xmp: bytes) -> GainMap | str | None:
    """The gain map of a picture, or why it is not read; ``None`` where there is none."""
    if has_gain_map(xmp):
        try:
            return read_gain_map(path, image)
        except ValueError as error:
            return str(error)
    auxiliary = image.info.get("aux") or {}
    apple = b"HDRGainMap" in xmp or any("hdrgainmap" in str(kind).lower() for kind in auxiliary)
    return "it is of another kind" if apple else None


def _check_heif_colours(image: Image.Image, path: Path) -> None:
    """Refuse HEIC whose colours are stated by numbers that are not sRGB's, in place of a profile."""
    numbers = image.info.get("nclx_profile") or {}
    if image.info.get("icc_profile") or not numbers:
        return
    primaries, curve = (int(numbers.get(name, 2)) for name in ("color_primaries", "transfer_characteristics"))
    if (unlike := unlike_srgb_numbers(primaries, curve)) is not None:
        raise InputError(f"{path}: {unlike}; save it as JPEG or 16-bit TIFF in sRGB")


def _xmp(image: Image.Image) -> bytes:
    for name in ("xmp", "XML:com.adobe.xmp"):
        found = image.info.get(name)
        if found:
            return found.encode() if isinstance(found, str) else bytes(found)
    return b""


def _tiff_tags(path: Path) -> tuple[bytes | None, bytes, int]:
    """Colour profile, XMP packet and orientation; Pillow opens no TIFF of 32 bits a channel, but reads its tags."""
    with path.open("rb") as file:
        header = file.read(8)
        if header[2] == 43 or header[3] == 43:
            header += file.read(8)
        tags = TiffImagePlugin.ImageFileDirectory_v2(header)
        file.seek(tags.next)
        tags.load(file)
    photometric = int(tags.get(_PHOTOMETRIC_TAG, 2))
    if photometric in _OTHER_COLOURS:
        raise InputError(f"{path}: its colours are {_OTHER_COLOURS[photometric]}; RGB or grey is needed")
    if tags.next:
        warn(f"{path}: holds several pages; the first is used")
    xmp = tags.get(_XMP_TAG, b"")
    return tags.get(_ICC_TAG), bytes(xmp) if isinstance(xmp, bytes | tuple) else b"", int(tags.get(_ORIENTATION, 1))


def _sixteen_bit(start: bytes) -> bool:
    """Whether a file begins as a PNG file of 16 bits a channel, of which Pillow keeps 8."""
    return start[:8] == b"\x89PNG\r\n\x1a\n" and len(start) == 25 and start[24] == 16


def _eight_bit(image: Image.Image, path: Path) -> NDArray[np.uint8]:
    if image.mode in ("CMYK", "YCCK", "LAB", "HSV"):
        raise InputError(f"{path}: its colours are {image.mode}; RGB or grey is needed")
    transparent = image.mode in ("RGBA", "LA", "PA") or "transparency" in image.info
    return np.asarray(image.convert("RGBA" if transparent else "RGB"))


def _of_any_depth(path: Path) -> NDArray:
    pixels = read_pixels(path, "picture")
    if pixels.dtype == np.uint32:
        pixels = (pixels >> 16).astype(np.uint16)
    if pixels.dtype in (np.float16, np.float64):
        pixels = pixels.astype(np.float32)
    if pixels.dtype not in (np.uint8, np.uint16, np.float32):
        raise InputError(
            f"{path}: not a readable picture; JPEG, PNG, and TIFF with 8, 16 or 32 bits (float) a channel are read"
        )
    if pixels.shape[2] < 3:  # Grey, and perhaps alpha.
        return np.concatenate([np.repeat(pixels[:, :, :1], 3, axis=2), pixels[:, :, 1:]], axis=2)
    return np.ascontiguousarray(pixels[:, :, :4])


def _check_shape(pixels: NDArray, sphere: PhotoSphere | None, path: Path) -> None:
    height, width = pixels.shape[:2]
    if sphere is None and width != 2 * height:
        kind = "stands upright like a portrait" if height > width else "is an ordinary photograph"
        raise InputError(
            f"{path}: is {width} x {height} pixels and {kind}; a panorama of 360 x 180 degrees is twice as wide as "
            "high. A part of a sphere needs metadata (GPano) that says which part; photographs of a whole sphere are "
            "joined by `lightdepth capture stitch`"
        )
    if sphere is None and _is_dual_fisheye(pixels):
        command = shlex.join(["lightdepth", "capture", "stitch", path.name, "-o", f"{path.stem}.exr", "--dual"])
        raise InputError(
            f"{path}: shows two fisheye circles side by side, not an equirectangular panorama; stitch it with "
            f"`{command}`, or with the program of the camera's maker"
        )


def _is_dual_fisheye(pixels: NDArray) -> bool:
    """Whether what lies outside two circles beside each other is black, and what lies inside is not."""
    step = max(1, pixels.shape[0] // 256)
    small = pixels[::step, ::step, :3].astype(np.float32).max(axis=2)
    rows, columns = ((np.arange(n) + 0.5) / small.shape[0] * 2.0 - 1.0 for n in small.shape)
    radius = np.hypot(rows[:, None], ((columns + 1.0) % 2.0 - 1.0)[None, :])
    inside, outside = small[radius < 0.85], small[radius > 1.15]
    return bool(inside.mean() > 0 and np.percentile(outside, 90) < DARK_CORNER * inside.mean())


def _linear(pixels: NDArray, profile: ColourProfile, gain_map: GainMap | None) -> NDArray[np.float32]:
    if pixels.dtype.kind == "u":
        levels = np.iinfo(pixels.dtype).max + 1
        at = np.linspace(0.0, 1.0, levels)
        known = np.linspace(0.0, 1.0, profile.curves.shape[1])
        radiance = np.empty(pixels.shape, np.float32)
        for channel, curve in enumerate(profile.curves):
            table = np.interp(at, known, curve).astype(np.float32)
            radiance[..., channel] = table[pixels[..., channel]]
    else:
        radiance = np.ascontiguousarray(pixels, np.float32)
    if gain_map is not None:
        radiance = gain_map.applied(radiance)
    if (profile.to_rec709 != np.eye(3)).any():
        # Colours outside Rec.709 have negative parts, which light cannot have.
        radiance = np.maximum(radiance @ profile.to_rec709.T.astype(np.float32), 0.0)
    return radiance


def _clipped_note(pixels: NDArray, known: NDArray[np.bool_], path: Path) -> str:
    white = np.iinfo(pixels.dtype).max
    clipped = (pixels.max(axis=2) >= white - white // 255) & known
    share = float((clipped.sum(axis=1) * pixel_solid_angles(*clipped.shape)).sum() / (4.0 * np.pi))
    bits = 8 * pixels.dtype.itemsize
    return (
        f"{path}: is a picture for the screen with {bits} bits a channel, in which all that is brighter than white is "
        f"cut off ({100.0 * share:.2g} % of all directions): LAMPS AND SUN ARE MUCH TOO DARK, so that shadows come out "
        "too soft and too weak. Photograph several exposures and merge them with `lightdepth capture merge`, or use an "
        "HDR panorama"
    )


def _padded(
    radiance: NDArray[np.float32], known: NDArray[np.bool_], sphere: PhotoSphere
) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    height, width = known.shape
    here = slice(sphere.top, sphere.top + height), slice(sphere.left, sphere.left + width)
    whole = np.zeros((sphere.full_height, sphere.full_width, 3), np.float32)
    covered = np.zeros(whole.shape[:2], bool)
    whole[here], covered[here] = radiance, known
    return whole, covered
