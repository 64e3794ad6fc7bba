"""What a farm is to render, and in which chunks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from lightdepth.numbered_files import told_frames
from lightdepth.sequence.numbering import FrameFiles


@dataclass(frozen=True)
class Shot:
    """The frames of a scene and how to render them.

    Attributes:
        scene: the scene file, absolute.
        frames: their numbers, ascending.
        files: where they go, absolute.
        options: further options of ``lightdepth render``, the same for all frames.
        chunk: frames that a machine renders at a time; the place is prepared once for each chunk.
    """

    scene: Path
    frames: Sequence[int]
    files: FrameFiles
    options: tuple[str, ...]
    chunk: int

    @property
    def chunks(self) -> list[str]:
        """The frames as ``--frames`` has them, chunk by chunk."""
        return [
            told_frames(self.frames[first : first + self.chunk]) for first in range(0, len(self.frames), self.chunk)
        ]

    def arguments(self, scene: str, frames: str, output: str) -> list[str]:
        """Those of the command ``lightdepth``, with whatever an engine puts in place of the first three."""
        return ["render", scene, "--frames", frames, "-o", output, *self.options, "--progress", "none"]
