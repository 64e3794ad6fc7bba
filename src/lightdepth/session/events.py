"""What a session reports: typed events, which also travel as JSON, an object a line.

Every event has the key ``event``, its kind. Readers ignore unknown kinds and keys; ``SCHEMA`` grows when
the meaning of one changes or one goes away.
"""

from __future__ import annotations

import json
import os
from dataclasses import asdict, dataclass, field, fields
from typing import Any, ClassVar

from lightdepth.errors import InputError

SCHEMA = 1
"""Version of the events and of the requests of ``lightdepth serve``."""


@dataclass(frozen=True)
class Event:
    """Base of the events.

    Attributes:
        kind: the value of the key ``event`` in JSON.
    """

    kind: ClassVar[str]

    def to_json(self, **more: object) -> str:
        """The event as one line of JSON, with ``more`` keys."""
        return json.dumps({"event": self.kind, **asdict(self), **more})


@dataclass(frozen=True)
class Hello(Event):
    """The first event of a process: its versions.

    Attributes:
        version: of lightdepth.
        schema: see :data:`SCHEMA`.
        pid: of the process.
    """

    kind: ClassVar[str] = "hello"
    version: str
    schema: int = SCHEMA
    pid: int = field(default_factory=os.getpid)


@dataclass(frozen=True)
class Stage(Event):
    """A part of the work begins.

    Attributes:
        stage: ``loading``, ``preparing``, ``rendering``, ``denoising`` or ``writing``.
    """

    kind: ClassVar[str] = "stage"
    stage: str


@dataclass(frozen=True)
class Preparing(Event):
    """Progress of the preparation of a place that is not in the cache.

    Attributes:
        fraction: of the most work that there may be; it may end early.
    """

    kind: ClassVar[str] = "preparing"
    fraction: float


@dataclass(frozen=True)
class Progress(Event):
    """Progress of the rendering; the attributes are those of :class:`lightdepth.film.rendering.Progress`."""

    kind: ClassVar[str] = "progress"
    fraction: float
    samples: float
    error: float
    seconds_left: float


@dataclass(frozen=True)
class Picture(Event):
    """The displays show a picture.

    Attributes:
        file: where it is, where one of the displays is a file; the first of them.
        finished: whether it is the last one.
    """

    kind: ClassVar[str] = "picture"
    file: str | None = None
    finished: bool = False


@dataclass(frozen=True)
class Caution(Event):
    """The picture will be wrong in places, or something failed that it can do without."""

    kind: ClassVar[str] = "warning"
    message: str


@dataclass(frozen=True)
class Failure(Event):
    """The work has failed; no further events follow.

    Attributes:
        message: the reason, for a person.
    """

    kind: ClassVar[str] = "failure"
    message: str


@dataclass(frozen=True)
class Done(Event):
    """The work has ended.

    Attributes:
        file: as for :class:`Picture`; ``None`` as well where it was interrupted before there was a picture.
        interrupted: whether it was cancelled before all samples were taken.
        exposure: stops at which the panorama's own brightness shows the picture; ``None`` without a picture.
        error: estimated relative error of the samples that the picture is made of; ``None`` without a picture.
        denoised: whether the picture was denoised, so that most of that error is gone.
    """

    kind: ClassVar[str] = "done"
    file: str | None = None
    interrupted: bool = False
    exposure: float | None = None
    error: float | None = None
    denoised: bool = False


@dataclass(frozen=True)
class SequenceProgress(Event):
    """Progress of a sequence; the other events in between are of the frame that is being rendered.

    Attributes:
        frame: the one that is being rendered here; ``None`` between two.
        total: frames that are wanted.
        done: those of them that are there.
        elsewhere: those that other processes are rendering, as far as is known.
        fraction: of all frames, with the part of the one at work.
        seconds_left: until all are there; ``None`` before it can be estimated.
    """

    kind: ClassVar[str] = "sequence"
    frame: int | None
    total: int
    done: int
    elsewhere: int
    fraction: float
    seconds_left: float | None


@dataclass(frozen=True)
class FrameState(Event):
    """State of a frame: after rendering, or as it was found on disk.

    Attributes:
        frame: its number.
        file: its file.
        state: ``rendered``, by this process; ``delivered``, by another one meanwhile; or as it was found: ``current``,
            ``missing``, ``outdated`` or ``damaged``.
    """

    kind: ClassVar[str] = "frame"
    frame: int
    file: str
    state: str


KINDS: dict[str, type[Event]] = {
    event.kind: event
    for event in (Hello, Stage, Preparing, Progress, Picture, Caution, Failure, Done, SequenceProgress, FrameState)
}
"""The events by their kind. A new one is a class and its name here."""


def from_json(line: str) -> Event | None:
    """An event from a line of JSON; ``None`` for a kind that this version does not know.

    Raises:
        InputError: the line is not an event.
    """
    try:
        values: Any = json.loads(line)
        event = KINDS.get(values["event"])
        return None if event is None else event(**{f.name: values[f.name] for f in fields(event) if f.name in values})
    except (ValueError, TypeError, KeyError) as error:
        raise InputError(f"not an event: {line.strip()[:120]}") from error
