"""The renderer as a separate process: found, run, listened to, cancelled, and never left behind."""

import atexit
import contextlib
import json
import os
import queue
import shutil
import signal
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import IO, Any, Self, TypeVar

COMMAND = "lightdepth"
Taken = TypeVar("Taken")
INTERRUPTED = 130
"""Exit status of a renderer that was interrupted and wrote what it had."""
PATIENCE = 300.0
"""Seconds after which a renderer that was asked something is no longer waited for."""


class RendererError(Exception):
    """What went wrong with the renderer, in words for the person in front of Blender."""


def find_command(preferred: str) -> str:
    """The path of the renderer's command.

    Args:
        preferred: the path from the preferences; empty to look in the usual places.

    Raises:
        RendererError: there is no such program.
    """
    if preferred:
        found = shutil.which(os.path.expanduser(preferred))
        if found is None:
            raise RendererError(
                f"The renderer '{preferred}' is not there or is not a program. "
                f"Set the path of the command '{COMMAND}' in the extension's preferences."
            )
        return found
    found = shutil.which(COMMAND) or shutil.which(COMMAND, path=str(Path.home() / ".local" / "bin"))
    if found is None:
        raise RendererError(
            f"The command '{COMMAND}' was not found. Install the renderer, "
            "or set the path of its command in the extension's preferences."
        )
    return found


_LEASH = 'exec 3<&0; (cat <&3; kill -KILL -$$) > /dev/null 2>&1 & exec "$0" "$@" < /dev/null 3<&-'
"""A shell that becomes the command it is given. Beside it waits for the end of a pipe that only Blender holds open, and
then ends the process group: however Blender ends, be it killed, the renderer ends with it."""
NOT_FOUND, NOT_STARTABLE = 127, 126
"""Exit statuses of a shell that could not become the command."""


class _Process:
    """The renderer at work. As a context manager it ends the process and its children on every way out.

    Args:
        command: the path of the renderer's command.
        arguments: its arguments, beginning with the subcommand.
        output: where its standard output goes, as for ``subprocess.Popen``.

    Raises:
        RendererError: the process cannot be started.
    """

    def __init__(self, command: str, arguments: list[str], output: IO[str] | int):
        self.command = command
        # A file, because a pipe that nobody reads would stop the renderer once it is full.
        self._errors = _file()
        try:
            self._process = subprocess.Popen(
                ["/bin/sh", "-c", _LEASH, command, *arguments],
                stdin=subprocess.PIPE,
                stdout=output,
                stderr=self._errors,
                text=True,
                errors="replace",
                start_new_session=True,  # its own process group, so that its children end with it
            )
        except OSError as error:
            self._errors.close()
            raise RendererError(f"The renderer '{command}' cannot be started: {error.strerror or error}") from error
        _running.add(self)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        self.end()

    def end(self) -> None:
        """End the process group now, whatever it does, and wait until it is gone."""
        self._signal(signal.SIGKILL)
        self._process.wait()
        self._process.stdin.close()
        self._errors.close()
        _running.discard(self)

    def _signal(self, number: int) -> None:
        with contextlib.suppress(ProcessLookupError):  # it and its children have ended by themselves
            os.killpg(self._process.pid, number)

    def _failure(self, printed: str = "") -> RendererError:
        """Why it ended with an error: in the renderer's own words; where it said nothing, how it ended."""
        status = self._process.returncode
        said = (_all_of(self._errors) or printed).strip()
        if status in (NOT_FOUND, NOT_STARTABLE):
            return RendererError(f"The renderer '{self.command}' cannot be started: {said}")
        if "Traceback (most recent call last)" in said:
            said = f"The renderer crashed: {said.splitlines()[-1]}"
        if said:
            return RendererError(said.removeprefix("error: "))
        if status < 0:
            name = signal.Signals(-status).name
            return RendererError(f"The renderer '{self.command}' was ended by the system ({name}).")
        return RendererError(f"The renderer '{self.command}' ended with status {status} and said nothing.")

    def _not_understood(self, printed: str) -> RendererError:
        shown = " ".join(printed.split())
        shown = shown if len(shown) <= 120 else shown[:120] + "..."
        return RendererError(
            f"'{self.command}' answered '{shown}', which is not what {COMMAND} says. "
            "Is this the right program and version?"
        )


class Question(_Process):
    """A command of the renderer that answers at its end, like ``check``. Use it as a context manager."""

    def __init__(self, command: str, arguments: list[str]):
        self._answer = _file()
        self._words = f"{COMMAND} {arguments[0]}"
        self._started = time.monotonic()
        super().__init__(command, arguments, self._answer)

    def end(self) -> None:
        """As for every process."""
        super().end()
        self._answer.close()

    @property
    def status(self) -> str:
        """What it is doing, for the person who waits."""
        return f"{self._words} is working, {time.monotonic() - self._started:.0f} s"

    def is_answered(self) -> bool:
        """Whether the answer is there.

        Raises:
            RendererError: the renderer has been asked for too long.
        """
        if self._process.poll() is not None:
            return True
        if time.monotonic() - self._started > PATIENCE:
            raise RendererError(f"'{self.command}' did not answer for {PATIENCE:g} seconds; it was ended")
        return False

    def wait(self) -> None:
        """Wait for the answer.

        Raises:
            RendererError: the renderer has been asked for too long.
        """
        while not self.is_answered():
            time.sleep(0.02)

    def text(self) -> str:
        """The answer of a command that speaks to persons and says the renderer's name.

        Raises:
            RendererError: the renderer failed, or it was another program that answered.
        """
        answer = _all_of(self._answer)
        if self._process.returncode != 0:
            raise self._failure(answer)
        if COMMAND not in answer:
            raise self._not_understood(answer)
        return answer

    def json(self, take: Callable[[dict[str, Any]], Taken]) -> Taken:
        """What is needed of an answer that is one JSON object; what it tells may be a reason for the command to fail.

        Args:
            take: takes it out of the object.

        Returns:
            What ``take`` returns.

        Raises:
            RendererError: the renderer failed, or ``take`` misses something.
        """
        text = _all_of(self._answer)
        try:
            answer = json.loads(text)
        except ValueError:
            answer = None
        if isinstance(answer, dict):
            try:
                return take(answer)
            except (KeyError, TypeError, ValueError) as error:
                raise RendererError(
                    f"The answer of '{self.command}' lacks something ({error}); is it of the extension's version?"
                ) from error
        if self._process.returncode != 0:
            raise self._failure(text)
        raise self._not_understood(text)


class Rendering(_Process):
    """A running rendering, which tells how far it is. Use it as a context manager.

    Args:
        command: the path of the renderer's command.
        arguments: its arguments, beginning with the subcommand; they must ask for progress as JSON lines.
    """

    def __init__(self, command: str, arguments: list[str]):
        super().__init__(command, arguments, subprocess.PIPE)
        self._interrupted = False
        self._lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def end(self) -> None:
        """As for every process."""
        super().end()
        self._reader.join(timeout=3.0)
        self._process.stdout.close()

    def _read(self) -> None:
        for line in self._process.stdout:
            self._lines.put(line)
        self._lines.put(None)

    def events(self, patience: float = 0.1) -> Iterator[dict | None]:
        """What the renderer tells, until it ends.

        Args:
            patience: seconds to wait for an event before ``None`` is given instead, so that the caller can look
                whether the person wants to stop.

        Raises:
            RendererError: the renderer failed, or printed something else than events.
        """
        while True:
            try:
                line = self._lines.get(timeout=patience)
            except queue.Empty:
                yield None
                continue
            if line is None:
                break
            if line.strip():
                yield self._event(line)
        if self._process.wait() not in (0, INTERRUPTED):
            raise self._failure()

    def _event(self, line: str) -> dict:
        try:
            event = json.loads(line)
        except ValueError:
            event = None
        if not isinstance(event, dict) or not isinstance(event.get("event"), str):
            raise self._not_understood(line)
        return event

    def interrupt(self) -> None:
        """Ask the renderer to write what it has and to stop; :meth:`events` goes on until it has.

        It is asked once, however often this is called: a second signal would stop it before it has written.
        """
        if not self._interrupted:
            self._interrupted = True
            self._signal(signal.SIGINT)


def _file() -> IO[str]:
    """A file without a name, to be closed by whoever asked for it."""
    return tempfile.TemporaryFile(mode="w+", errors="replace")


def _all_of(file: IO[str]) -> str:
    file.seek(0)
    return file.read()


_running: set[_Process] = set()


@atexit.register
def end_all() -> None:
    """End what still runs: Blender quits, or the extension is switched off."""
    for process in list(_running):
        process.end()
