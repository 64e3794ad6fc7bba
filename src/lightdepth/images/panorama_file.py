"""Panoramas from files of every kind. A new kind is a reader and a line in ``KINDS``."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from lightdepth.errors import InputError
from lightdepth.images.panorama_image import PanoramaImage
from lightdepth.images.photograph import EXTENSIONS, read_photograph
from lightdepth.images.radiance import READERS, holds_radiance, read_radiance


def _hdr(path: Path) -> PanoramaImage:
    return PanoramaImage(read_radiance(path))


KINDS: dict[str, Callable[[Path], PanoramaImage]] = {
    **dict.fromkeys(READERS, _hdr),
    **dict.fromkeys(EXTENSIONS, read_photograph),
}
"""Readers by file name extension."""


def read_panorama(path: Path) -> PanoramaImage:
    """Read a panorama; its shape and its radiance are unchecked.

    OpenEXR and Radiance HDR are known by their content, too, whatever they are called.

    Raises:
        InputError: the file is missing, unreadable, of another format, or no panorama.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    reader = _hdr if holds_radiance(path) else KINDS.get(path.suffix.lower())
    if reader is None:
        hint = "; convert it to JPEG or TIFF" if path.suffix.lower() in (".avif", ".webp") else ""
        hint = hint or ("; develop it with `lightdepth capture`" if path.suffix.lower() == ".dng" else "")
        raise InputError(
            f"{path}: '{path.suffix}' is not a format for a panorama; allowed are {', '.join(KINDS)}{hint}"
        )
    return reader(path)
