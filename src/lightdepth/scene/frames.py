"""A scene at one frame after the other; what does not change is read once."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from lightdepth.errors import InputError
from lightdepth.scene.animation import SequenceTable
from lightdepth.scene.load import Contents, read_scene
from lightdepth.scene.model import Scene
from lightdepth.scene.scene_file import SceneText

LOOKED_THROUGH = 2000
"""Frames of which the tables are checked, at most."""


class SceneFrames:
    """The frames of a scene file. The file is read when this is made, the files that it names when they are first needed.

    Attributes:
        path: the scene file.
        text: what it says.
    """

    def __init__(self, path: Path, repair: bool = False) -> None:
        """Read a scene file.

        Args:
            path: the TOML file.
            repair: replace impossible radiance of the panorama instead of refusing it.

        Raises:
            InputError: the file is missing, cannot be read, or is not TOML.
        """
        self.path, self.text = path, SceneText(path)
        self._repair = repair
        self._last: Contents | None = None

    @property
    def sequence(self) -> SequenceTable:
        """``[sequence]``.

        Raises:
            InputError: there is none, or it is wrong.
        """
        if self.text.sequence is None:
            _, problems = self.text.tables()
            raise InputError(
                "\n".join(problems.messages) or f"{self.path}: lacks [sequence] with frames = [first, last]"
            )
        return self.text.sequence

    def contents(self, frame: float | None = None) -> Contents:
        """What can be read of the scene at a frame; takes the arguments of :func:`~lightdepth.scene.load.read_scene`."""
        self._last = read_scene(self.text, self._repair, frame, self._last)
        return self._last

    def scene(self, frame: float | None = None) -> Scene:
        """The scene at a frame.

        Raises:
            InputError: it, or a file that it names, is wrong. The message has a line for each problem.
        """
        contents = self.contents(frame)
        if contents.problems or contents.scene is None:
            raise InputError("\n".join(contents.problems))
        return contents.scene

    def table_problems(self) -> tuple[str, ...]:
        """What is wrong with the tables at all frames, a line each; no mesh and no panorama is read.

        Of more than ``LOOKED_THROUGH`` frames, that many between the keys are looked at.
        """
        first, last = self.sequence.frames
        numbers = np.linspace(first, last, min(LOOKED_THROUGH, last - first + 1)).round()
        found: dict[str, None] = {}
        for frame in sorted({*map(float, numbers), *self.text.animation.key_frames}):
            tables, problems = self.text.tables(frame)  # The tables keep their textures until the next ones have them.
            found |= dict.fromkeys(problems.messages)
        del tables
        return tuple(found)
