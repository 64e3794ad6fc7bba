"""A video file, whole or not at all, with the boxes of a spherical one where it is that."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

from lightdepth.delivery.arrangement import Arrangement
from lightdepth.delivery.frames import Frames
from lightdepth.delivery.grading import Grade
from lightdepth.delivery.spherical import mark_spherical
from lightdepth.delivery.video import encode, find_codec
from lightdepth.delivery.whole import whole_folder
from lightdepth.film.header import software


@dataclass(frozen=True)
class Movie:
    """A video that is to be written.

    Attributes:
        file: where to.
        rate: frames per second.
        codec: its name.
        quality: constant quality instead of the codec's own.
        audio: a sound file.
    """

    file: Path
    rate: Fraction
    codec: str = "h264"
    quality: int | None = None
    audio: Path | None = None


def write_movie(
    wanted: Movie, frames: Frames, arranged: Arrangement, grade: Grade, progress: Callable[[], None]
) -> list[Path]:
    """Encode frames.

    Returns:
        The file.

    Raises:
        InputError: something cannot be read, encoded or written; nothing is left of it then.
        SetupError: PyAV or the encoder is missing.
    """
    codec = find_codec(wanted.codec, wanted.file, arranged.size)
    tags = grade.tags(8 if codec.pixels == "yuv420p" else 10)
    pictures = (arranged.arranged(grade.pixels(file, 16)) for file in frames.files.values())
    with whole_folder(wanted.file) as folder:
        file = folder / wanted.file.name
        encode(
            file,
            pictures,
            arranged.size,
            wanted.rate,
            codec,
            wanted.quality,
            tags,
            wanted.audio,
            progress,
            wanted.file,
        )
        if arranged.sphere is not None:
            flat = file.rename(file.with_stem("flat"))
            mark_spherical(flat, file, arranged.sphere, software())
            flat.unlink()
    return [wanted.file]
