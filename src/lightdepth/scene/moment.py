"""The moment of a sequence at which a scene file's tables are checked."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from lightdepth.numbered_files import missing_files


@dataclass(frozen=True)
class Moment:
    """A frame of a sequence, whole or in between.

    Attributes:
        frame: the frame.
        first: the sequence's first frame.
        last: its last one.
        seconds: since the first frame; negative while the shutter opens before it.
    """

    frame: float
    first: int
    last: int
    seconds: float

    @property
    def nearest(self) -> int:
        """The whole frame that is nearest."""
        return min(max(round(self.frame), self.first), self.last)

    def missing(self, pattern: Path) -> list[int]:
        """The frames of the sequence of which a numbered file is not there."""
        return missing_files(pattern, range(self.first, self.last + 1))
