"""Single pictures for the web: JPEG or PNG, panoramas with the metadata by which viewers know them."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from PIL.PngImagePlugin import PngInfo

from lightdepth.delivery.arrangement import Arrangement
from lightdepth.delivery.frames import Frames
from lightdepth.delivery.grading import Grade
from lightdepth.delivery.whole import whole_folder
from lightdepth.errors import InputError
from lightdepth.film.header import software
from lightdepth.images.gpano import photo_sphere_xmp
from lightdepth.numbered_files import MARK, is_pattern, numbered

SUFFIXES = (".jpg", ".jpeg", ".png")
_JPEG_QUALITY = 95
_MOST_JPEG = 65500
"""Pixels along a side that a JPEG can have."""


def write_stills(
    target: Path, frames: Frames, arranged: Arrangement, grade: Grade, progress: Callable[[], None]
) -> list[Path]:
    """Write each frame as a picture.

    Args:
        target: the file; of several frames, with ``#`` for the digits of their numbers.
        frames: what to write.
        arranged: its arrangement.
        grade: its grade.
        progress: called after each picture.

    Returns:
        The files.

    Raises:
        InputError: something cannot be read or written; nothing is left of it then.
    """
    if target.suffix.lower() not in SUFFIXES:
        raise InputError(f"-o {target}: '{target.suffix}' is not allowed; stills are {', '.join(SUFFIXES)}")
    if len(frames.files) > 1 and not is_pattern(target.name):
        raise InputError(
            f"-o {target}: for several frames, the name must have {MARK} for the digits of their numbers, in one place"
        )
    if target.suffix.lower() != ".png" and max(arranged.size) > _MOST_JPEG:
        raise InputError(f"-o {target}: a JPEG has at most {_MOST_JPEG} pixels along a side; write a .png")
    xmp = None
    if arranged.sphere is not None:
        xmp = photo_sphere_xmp(*arranged.size, frames.rotation, software())
    written = []
    with whole_folder(target) as folder:
        for number, file in frames.files.items():
            name = numbered(target, number).name
            _save(folder / name, arranged.arranged(grade.pixels(file, 8)), xmp)
            written.append(target.with_name(name))
            progress()
    return written


def _save(path: Path, pixels: NDArray[Any], xmp: bytes | None) -> None:
    picture = Image.fromarray(np.ascontiguousarray(pixels))
    if path.suffix.lower() == ".png":
        texts = PngInfo()
        if xmp is not None:
            texts.add_itxt("XML:com.adobe.xmp", xmp.decode())
        picture.save(path, pnginfo=texts, compress_level=4)
    else:
        more = {} if xmp is None else {"xmp": xmp}
        picture.save(path, format="JPEG", quality=_JPEG_QUALITY, subsampling=0, **more)
