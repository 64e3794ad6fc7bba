"""What is wrong at which frames of a sequence."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from lightdepth.checks.problem import Problem, Severity
from lightdepth.parameters.checks import DEFAULT, ChecksParameters
from lightdepth.scene.frames import SceneFrames

_NUMBER = re.compile(r"-?\d+(\.\d+)?(e[-+]?\d+)?")


def frames_to_check(frames: SceneFrames, tuned: ChecksParameters = DEFAULT) -> list[float]:
    """The first frame, the last, those with keys, and others evenly between them; all of a short sequence."""
    first, last = frames.sequence.frames
    between = np.unique(np.linspace(first, last, min(tuned.frames, last - first + 1)).round())
    return sorted({float(first), float(last), *map(float, between), *frames.text.animation.key_frames})


@dataclass
class Findings:
    """Problems of several frames; those that differ in their numbers only are one."""

    _found: dict[tuple[Severity, str], list[Problem]] = field(default_factory=dict)

    def add(self, frame: float, problems: Iterable[Problem]) -> None:
        """Note what was found at a frame."""
        for problem in problems:
            key = problem.severity, _NUMBER.sub("#", problem.message)
            self._found.setdefault(key, []).append(replace(problem, frames=(frame,)))

    def all(self, frames: Sequence[float]) -> list[Problem]:
        """Every problem once, with its frames.

        Args:
            frames: all that were looked at, in order.
        """
        merged = []
        for (severity, _), found in self._found.items():
            at = tuple(dict.fromkeys(problem.frames[0] for problem in found))
            alike = len({problem.message for problem in found}) == 1
            if len(at) == len(frames) and alike:
                where = ""
            else:
                where = f" ({_told(at, frames)}{'' if alike else f'; the numbers are those of frame {at[0]:g}'})"
            merged.append(Problem(severity, found[0].message + where, at))
        return merged


def _told(at: Sequence[float], frames: Sequence[float]) -> str:
    """``frame 3``, ``frames 3 to 9, 12``: runs of what was looked at."""
    places = [frames.index(frame) for frame in at]
    cuts = [i + 1 for i, (before, after) in enumerate(pairwise(places)) if after != before + 1]
    runs = [at[begin:end] for begin, end in pairwise([0, *cuts, len(at)])]
    words = [f"{run[0]:g}" if len(run) == 1 else f"{run[0]:g} to {run[-1]:g}" for run in runs]
    return f"{'frame' if len(at) == 1 else 'frames'} {', '.join(words)}"
