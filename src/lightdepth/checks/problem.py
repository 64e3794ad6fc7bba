"""What a check finds."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum


class Severity(StrEnum):
    """How bad it is."""

    ERROR = "error"
    """The picture would be meaningless: nothing is rendered."""
    WARNING = "warning"
    """The picture will be wrong in places, unless it is meant so."""
    HINT = "hint"
    """Possibly an oversight."""


@dataclass(frozen=True)
class Problem:
    """One thing that is wrong with a scene.

    Attributes:
        severity: how bad it is.
        message: which part of the scene, what was found, and what is right, in one line.
        frames: of a sequence, at which it was found; empty for a scene that does not move.
    """

    severity: Severity
    message: str
    frames: tuple[float, ...] = ()
