"""The renderer as a separate process: found, run, understood, and never left behind."""

import atexit
import contextlib
import json
import os
import shutil
import signal
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import IO, Any, Self, TypeVar

COMMAND = "lightdepth"
Taken = TypeVar("Taken")
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


_LEASH = 'input=$1; shift; { (cat <&3; kill -KILL -$$) > /dev/null 2>&1 & } 3<&0; exec "$0" "$@" < "$input"'
"""A shell that becomes the command it is given, with a file as its input. Beside it waits for the end of a pipe that only
Blender holds open, and then ends the process group: when Blender ends, even if it is killed, so does the renderer."""
NOT_FOUND, NOT_STARTABLE = 127, 126
"""Exit statuses of a shell that could not become the command."""
_SHELLS_SIGNALS = 128
"""Exit status of a shell whose command was ended by signal 0."""


class Process:
    """The renderer at work. As a context manager it ends the process and its children on every way out.

    Args:
        command: the path of the renderer's command.
        arguments: its arguments, beginning with the subcommand.
        output: where its standard output goes, as for ``subprocess.Popen``.
        requests: a descriptor that it reads from; none by default.

    Raises:
        RendererError: the process cannot be started.
    """

    def __init__(self, command: str, arguments: list[str], output: IO[str] | int, requests: int | None = None):
        self.command = command
        passed = () if requests is None else (requests,)
        source = "/dev/null" if requests is None else f"/dev/fd/{requests}"
        # A file, because a pipe that nobody reads would stop the renderer once it is full.
        self._errors = _file()
        try:
            self._process = subprocess.Popen(
                ["/bin/sh", "-c", _LEASH, command, source, *arguments],
                stdin=subprocess.PIPE,
                stdout=output,
                stderr=self._errors,
                text=True,
                errors="replace",
                pass_fds=passed,
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

    def _failure(self, printed: str = "", said_before: int = 0) -> RendererError:
        """Why it ended with an error: in the renderer's own words; where it said nothing, how it ended.

        Args:
            printed: its standard output, which counts where its standard error is empty.
            said_before: bytes of standard error that belong to something else.
        """
        status = self._process.returncode
        said = (_all_of(self._errors, said_before) or printed).strip()
        if status in (NOT_FOUND, NOT_STARTABLE):
            return RendererError(f"The renderer '{self.command}' cannot be started: {said}")
        if "Traceback (most recent call last)" in said:
            said = f"The renderer crashed: {said.splitlines()[-1]}"
        if said:
            return RendererError(said.removeprefix("error: "))
        number = -status if status < 0 else status - _SHELLS_SIGNALS
        if number in list(signal.Signals):
            name = signal.Signals(number).name
            return RendererError(f"The renderer '{self.command}' was killed by the system ({name}).")
        return RendererError(f"The renderer '{self.command}' exited with status {status} and no message.")

    def _not_understood(self, printed: str) -> RendererError:
        shown = " ".join(printed.split())
        shown = shown if len(shown) <= 120 else shown[:120] + "..."
        return RendererError(
            f"'{self.command}' answered '{shown}', which is not what {COMMAND} says. "
            "Is this the right program and version?"
        )


class Question(Process):
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


def _file() -> IO[str]:
    """A file without a name, to be closed by whoever asked for it."""
    return tempfile.TemporaryFile(mode="w+", errors="replace")


def _all_of(file: IO[str], begin: int = 0) -> str:
    """What is in a file from a byte on. Its position stays where it is: the process writes there."""
    descriptor = file.fileno()
    size = os.fstat(descriptor).st_size
    return os.pread(descriptor, max(size - begin, 0), begin).decode(errors="replace")


_running: set[Process] = set()


@atexit.register
def end_all() -> None:
    """End what still runs: Blender quits, or the extension is switched off."""
    for process in list(_running):
        process.end()
