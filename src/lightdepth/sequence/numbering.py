"""Which frames are meant, and which files they are."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from lightdepth.errors import InputError
from lightdepth.numbered_files import MARK, is_pattern, numbered
from lightdepth.scene.animation import SequenceTable

_RANGE = re.compile(r"(\d{1,7})(?:-(\d{1,7}))?")


def parsed_frames(text: str, step: int, sequence: SequenceTable) -> list[int]:
    """The frames of the option ``--frames``: ``1-240``, ``7``, ``1-10,20-30``; of each range every ``step``-th one.

    Raises:
        InputError: it is written otherwise, or a frame is not in the sequence.
    """
    frames: dict[int, None] = {}
    for first, last in _ranges(text):
        if first < sequence.first or last > sequence.last:
            outside = first if first < sequence.first else last
            raise InputError(
                f"--frames {text[:60]}: {outside} is outside the [sequence], which has frames {sequence.first} to "
                f"{sequence.last}"
            )
        frames |= dict.fromkeys(range(first, last + 1, step))
    return sorted(frames)


def parsed_ranges(text: str) -> list[int]:
    """The frames of the option ``--frames`` where no sequence limits them.

    Raises:
        InputError: it is written otherwise.
    """
    return sorted({number for first, last in _ranges(text) for number in range(first, last + 1)})


def _ranges(text: str) -> Iterator[tuple[int, int]]:
    for part in text.split(","):
        match = _RANGE.fullmatch(part.strip())
        if match is None:
            raise InputError(f"--frames {text[:60]}: write it as 1-240, or 7, or 1-10,20-30")
        first, last = int(match[1]), int(match[2] or match[1])
        if first > last:
            raise InputError(f"--frames {text[:60]}: {first} comes after {last}")
        yield first, last


@dataclass(frozen=True)
class FrameFiles:
    """The files of a sequence.

    Attributes:
        pattern: an ``.exr`` file in whose name ``#`` stands for the digits of a frame's number.
    """

    pattern: Path

    def __post_init__(self) -> None:
        name = self.pattern.name
        if self.pattern.suffix.lower() != ".exr":
            raise InputError(f"-o {self.pattern}: '{self.pattern.suffix}' is not allowed; frames are .exr files")
        if not is_pattern(name) or MARK in str(self.pattern.parent):
            raise InputError(
                f"-o {self.pattern}: the name must have {MARK} for each digit of the frame's number, in one place, as in "
                f"shot.{MARK * 4}.exr"
            )

    def file(self, frame: int) -> Path:
        """The file of a frame; numbers that need more digits have them."""
        return numbered(self.pattern, frame)
