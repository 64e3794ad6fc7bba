"""The frames that are delivered: which files they are, and what their headers say."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.film.frame import CAMERA, EXPOSURE
from lightdepth.film.header import WORLD_TO_CAMERA
from lightdepth.images.beauty import read_beauty
from lightdepth.images.exr import ExrHeader, ExrReader
from lightdepth.numbered_files import MARK, found_files, is_pattern, told_frames
from lightdepth.sequence.numbering import parsed_ranges


@dataclass(frozen=True)
class Frames:
    """Frames of one shot, or one still, all of one size and seen by one camera.

    Attributes:
        files: by number, in order; a still has the number 0.
        header: of the first one's first part.
    """

    files: Mapping[int, Path]
    header: ExrHeader

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return self.header.display_window[2:]

    @property
    def first(self) -> Path:
        """The first file."""
        return next(iter(self.files.values()))

    @cached_property
    def camera(self) -> Mapping[str, Any]:
        """Settings of the camera by the keys of the scene file; empty where the header does not state them."""
        try:
            found = json.loads(self.header.attributes.get(f"lightdepth:{CAMERA}", "{}"))
        except (TypeError, ValueError):
            return {}
        return found if isinstance(found, dict) else {}

    @property
    def rate(self) -> Fraction | None:
        """Frames per second, where the header states them."""
        found = self.header.attributes.get("framesPerSecond")
        if found is None:
            return None
        numbers = [int(number) for number in np.ravel(found)]
        return Fraction(*numbers) if len(numbers) == 2 and min(numbers) > 0 else None

    @property
    def exposure(self) -> float | None:
        """Stops that bring the panorama's brightness to the screen's, where the header states them."""
        try:
            return float(self.header.attributes[f"lightdepth:{EXPOSURE}"])
        except (KeyError, TypeError, ValueError):
            return None

    @property
    def rotation(self) -> NDArray[np.float64] | None:
        """Camera space (x right, y forward, z up) to world, shape (3, 3), where the header states it."""
        matrix = self.header.attributes.get(WORLD_TO_CAMERA)
        if matrix is None or np.shape(matrix) != (4, 4):
            return None
        return np.asarray(matrix, dtype=np.float64)[:3, [0, 2, 1]]


def find_frames(pattern: Path, numbers: str | None = None, step: int = 1) -> Frames:
    """Find the frames of a pattern, and look at all their headers.

    Args:
        pattern: an EXR file in whose name ``#`` stands for the digits of the number, or one file.
        numbers: which of them, as ``1-240``; all by default.
        step: of these, take every ``step``-th.

    Raises:
        InputError: a frame is missing, is incomplete, or differs from the first in size or camera.
    """
    files = _numbered(pattern, numbers, step) if MARK in pattern.name else {0: pattern}
    if MARK not in pattern.name and numbers is not None:
        raise InputError(f"--frames goes with a pattern such as shot.{MARK * 4}.exr; {pattern} is one file")
    first: Frames | None = None
    for file in files.values():
        with ExrReader(file) as reader:
            if not reader.is_whole():
                raise InputError(f"{file}: is incomplete; render it again")
            found = Frames(files, reader.headers[0])
        if first is None:
            first = found
        if found.size != first.size:
            raise InputError(f"{file}: has {_pixels(found)}, but {first.first} has {_pixels(first)}")
        if found.camera.get("type") != first.camera.get("type"):
            raise InputError(
                f"{file}: is of a camera of the type {found.camera.get('type')}, but {first.first} of the type "
                f"{first.camera.get('type')}"
            )
    assert first is not None
    return first


def read_radiance(file: Path) -> NDArray[np.float32]:
    """The picture of a frame: linear Rec.709, shape (height, width, 3), float32, black outside the camera's image."""
    return read_beauty(file).radiance


def _pixels(frames: Frames) -> str:
    return "{} x {} pixels".format(*frames.size)


def _numbered(pattern: Path, wanted: str | None, step: int) -> dict[int, Path]:
    if not is_pattern(pattern.name) or MARK in str(pattern.parent):
        raise InputError(f"{pattern}: the name must have {MARK} for the digits of the frame's number in one place")
    try:
        there = found_files(pattern)
    except OSError as error:
        raise InputError(f"{pattern.parent}: cannot be read ({error.strerror})") from error
    if not there:
        raise InputError(f"{pattern}: there is no such file")
    chosen = range(min(there), max(there) + 1) if wanted is None else parsed_ranges(wanted)
    chosen = chosen[::step]
    if missing := [number for number in chosen if number not in there]:
        hint = "" if wanted is not None else "; render them, or choose others by --frames"
        raise InputError(f"{pattern}: frames {told_frames(missing)} are missing{hint}")
    return {number: there[number] for number in chosen}
