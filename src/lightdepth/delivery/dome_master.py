"""A dome master: numbered lossless pictures, a description, and the sound beside them.

After the AFDI and IMERSA "Dome Master Show File Format": square frames, an equidistant fisheye that touches the edges,
black outside it, numbered ``Name_00001``.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Literal

import numpy as np

from lightdepth.delivery.arrangement import Arrangement
from lightdepth.delivery.frames import Frames
from lightdepth.delivery.grading import Grade
from lightdepth.delivery.whole import whole_folder
from lightdepth.errors import InputError, warn
from lightdepth.film.header import software
from lightdepth.images.raster import SUFFIXES, write_raster

SIZES = (1024, 2048, 3072, 4096, 8192)
"""Pixels along the side for which domes are made."""
RATES = (24, 60)
"""Frames per second, from and to."""

LOWEST_AXIS = 45.0
"""Degrees above the horizon at which the middle of a strongly tilted dome still is."""


@dataclass(frozen=True)
class DomeMaster:
    """What a delivery for a dome consists of.

    Attributes:
        pattern: ``folder/Name.png`` or ``.tif``; the frames are ``Name_00001.png`` and so on.
        rate: frames per second; ``None`` of a single frame that states none.
        bits: of each channel.
        audio: a sound file, which is copied as ``Name`` with its own suffix.
    """

    pattern: Path
    rate: Fraction | None
    bits: Literal[8, 16] = 16
    audio: Path | None = None


def write_dome_master(
    wanted: DomeMaster, frames: Frames, arranged: Arrangement, grade: Grade, progress: Callable[[], None]
) -> list[Path]:
    """Write the frames, numbered from 1 on, and what describes them.

    Returns:
        The description and the first frame.

    Raises:
        InputError: something cannot be read or written; nothing is left of it then.
    """
    pattern = wanted.pattern
    if pattern.suffix.lower() not in SUFFIXES:
        raise InputError(f"-o {pattern}: '{pattern.suffix}' is not allowed; a dome master is {', '.join(SUFFIXES)}")
    if wanted.audio is not None and not wanted.audio.is_file():
        raise InputError(f"--audio {wanted.audio}: no such file")
    side = arranged.size[0]
    if side not in SIZES:
        warn(f"{frames.first}: has {side} x {side} pixels; domes expect {', '.join(map(str, SIZES))}")
    if wanted.rate is not None and not RATES[0] <= wanted.rate <= RATES[1]:
        warn(f"{float(wanted.rate):g} frames per second: domes expect 24 to 60, most of them 30 or 60")
    if frames.rotation is not None and frames.camera.get("type") == "fisheye":  # A dome master stands upright itself.
        elevation = float(np.degrees(np.arcsin(np.clip(frames.rotation[2, 1], -1.0, 1.0))))
        if elevation < LOWEST_AXIS:
            warn(
                f"{frames.first}: its camera looks {elevation:.0f} degrees above the horizon; the middle of a dome master "
                "is the zenith: rotation = [90, 0, 0] in the camera looks there"
            )
    with whole_folder(pattern) as folder:
        for number, file in enumerate(frames.files.values(), 1):
            name = f"{pattern.stem}_{number:05}{pattern.suffix}"
            write_raster(folder / name, arranged.arranged(grade.pixels(file, wanted.bits)))
            progress()
        if wanted.audio is not None:
            shutil.copyfile(wanted.audio, folder / f"{pattern.stem}{wanted.audio.suffix}")
        (folder / f"{pattern.stem}.txt").write_text(_description(wanted, frames, side))
    return [pattern.with_suffix(".txt"), pattern.with_name(f"{pattern.stem}_00001{pattern.suffix}")]


def _description(wanted: DomeMaster, frames: Frames, side: int) -> str:
    count, rate = len(frames.files), wanted.rate
    camera = frames.camera
    facts = {
        "Title": wanted.pattern.stem,
        "Format": "Dome Master",
        "Projection": "equidistant azimuthal (fisheye)",
        "Field of view": f"{camera['fov']:g} degrees" if "fov" in camera else "as rendered",
        "Orientation": "bottom of the frame is the front of the dome, left and right as the audience sees them",
        "Dome tilt": f"{camera['tilt']:g} degrees" if "tilt" in camera else "as rendered",
        "Resolution": f"{side} x {side}",
        "Frames": f"{count}, {wanted.pattern.stem}_00001 to {wanted.pattern.stem}_{count:05}",
        **({} if rate is None else _timing(count, rate)),
        "File format": f"{wanted.pattern.suffix.lower().lstrip('.').upper()}, {wanted.bits} bits per channel, R G B",
        "Audio": "none" if wanted.audio is None else f"{wanted.pattern.stem}{wanted.audio.suffix}",
        "Software": software(),
    }
    return "".join(f"{name}: {value}\n" for name, value in facts.items())


def _timing(count: int, rate: Fraction) -> dict[str, str]:
    return {
        "Frame rate": f"{float(rate):g} per second" + ("" if rate.denominator == 1 else f" ({rate})"),
        "Duration": f"{float(count / rate):.3f} seconds",
    }
