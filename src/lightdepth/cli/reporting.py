"""How commands report a session's events: as a bar, as a JSON object a line for programs, or in the end only.

Where there is no terminal, as in a log, the bar is a line every few seconds.
"""

from __future__ import annotations

import shlex
import sys
import time
from abc import ABC, abstractmethod
from importlib import metadata
from typing import TYPE_CHECKING, Self

from rich.console import Console
from rich.progress import Progress, ProgressColumn

if TYPE_CHECKING:
    from lightdepth.session.events import Event


LOG_SECONDS = 5.0
"""Time between two lines of a log."""


def own_command(*options: str) -> str:
    """The command that is running, as it can be pasted, with ``options`` at its end."""
    arguments = [argument for argument in sys.argv[1:] if argument not in options]
    return shlex.join(["lightdepth", *arguments, *options])


class EventReporter(ABC):
    """What the reporters of all commands share.

    Args:
        kind: ``bar``, ``json`` or ``none``.
        name: of the bar.
        columns: of the bar.
    """

    def __init__(self, kind: str, name: str, columns: tuple[ProgressColumn, ...]) -> None:
        self._kind = kind
        self._console = Console(stderr=True, highlight=False, soft_wrap=True)
        self._bar: Progress | None = None
        self._logged = time.monotonic()
        if kind == "bar" and self._console.is_terminal:
            self._bar = Progress(*columns, console=self._console, transient=False)
            self._task = self._bar.add_task(name, total=1.0, facts="")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar is not None:
            self._bar.stop()

    def begin(self) -> None:
        """Say who speaks."""
        from lightdepth.session.events import Hello

        self.report(Hello(metadata.version("lightdepth")))

    def report(self, event: Event) -> None:
        """Report an event."""
        from lightdepth.session.events import Caution

        if self._kind == "json":
            sys.stdout.write(event.to_json() + "\n")
            sys.stdout.flush()
        if isinstance(event, Caution):
            self._console.print(f"warning: {event.message}", style="yellow", markup=False)
        else:
            self._show(event)

    def _advance(self, what: str, fraction: float, facts: str = "") -> None:
        """Show how far something is: by the bar, or now and then by a line."""
        if self._bar is not None:
            self._bar.start()
            self._bar.update(self._task, description=what, completed=fraction, facts=facts)
        elif self._kind == "bar" and time.monotonic() - self._logged >= LOG_SECONDS:
            self._logged = time.monotonic()
            self._console.print(f"{what}: {fraction:.0%}" + (f", {facts}" if facts else ""), markup=False)

    @abstractmethod
    def _show(self, event: Event) -> None:
        """Show a person an event that is no warning."""
