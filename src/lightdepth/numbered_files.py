"""Files of which there is one for each frame: ``#`` in the name stands for a digit of the frame's number."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from functools import lru_cache
from itertools import pairwise
from pathlib import Path

MARK = "#"


def is_pattern(name: str) -> bool:
    """Whether a file's name has ``#`` in one place, once or several times in a row."""
    return len(re.findall(f"{MARK}+", name)) == 1


def numbered(pattern: Path, frame: int) -> Path:
    """The file of a frame; numbers that need more digits than there are ``#`` have them."""
    name = re.sub(f"{MARK}+", lambda marks: f"{frame:0{len(marks[0])}d}", pattern.name)
    return pattern.with_name(name)


def found_files(pattern: Path) -> dict[int, Path]:
    """The files of a pattern that are there, by their number, in its order.

    Args:
        pattern: a file whose name ``is_pattern``.

    Raises:
        OSError: the folder cannot be read.
    """
    digits = re.search(f"{MARK}+", pattern.name)
    assert digits is not None
    before, after = map(re.escape, (pattern.name[: digits.start()], pattern.name[digits.end() :]))
    name = re.compile(f"{before}([0-9]+){after}")
    there = set(os.listdir(pattern.parent))
    numbers = sorted({int(match[1]) for each in there if (match := name.fullmatch(each))})
    found = {number: numbered(pattern, number) for number in numbers}
    return {number: path for number, path in found.items() if path.name in there}  # Others have too many zeros.


def missing_files(pattern: Path, frames: range) -> list[int]:
    """The frames for which there is no file."""
    try:
        changed = pattern.parent.stat().st_mtime_ns
    except (OSError, ValueError):
        return list(frames)
    return list(_missing(pattern, frames, changed))


@lru_cache(maxsize=16)
def _missing(pattern: Path, frames: range, _changed: int) -> tuple[int, ...]:
    there = set(os.listdir(pattern.parent))
    return tuple(frame for frame in frames if numbered(pattern, frame).name not in there)


def told_frames(frames: Iterable[int]) -> str:
    """Frames in few words: ``1-3,7``."""
    numbers = sorted(frames)
    cuts = [i + 1 for i, (before, after) in enumerate(pairwise(numbers)) if after != before + 1]
    runs = [numbers[begin:end] for begin, end in pairwise([0, *cuts, len(numbers)]) if numbers]
    return ",".join(f"{run[0]}" if len(run) == 1 else f"{run[0]}-{run[-1]}" for run in runs)
