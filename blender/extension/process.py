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
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

COMMAND = "lightdepth"
Taken = TypeVar("Taken")
INTERRUPTED = 130
"""Exit status of a renderer that was interrupted and wrote what it had."""


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


def run(command: str, arguments: list[str]) -> str:
    """Run a short command of the renderer to its end.

    Args:
        command: the path of the renderer's command.
        arguments: its arguments, beginning with the subcommand.

    Returns:
        What it printed on its standard output.

    Raises:
        RendererError: it could not be started or failed; the message holds its own words.
    """
    done = _completed(command, arguments)
    if done.returncode != 0:
        raise RendererError(_words(command, done.stderr or done.stdout, done.returncode))
    return done.stdout


def doctor(command: str) -> list[str]:
    """What ``lightdepth doctor`` says, line by line.

    Raises:
        RendererError: as :func:`run`, and where another program than the renderer answers.
    """
    said = run(command, ["doctor"])
    if COMMAND not in said:
        raise RendererError(_not_understood(command, said))
    return said.splitlines()


def run_json(command: str, arguments: list[str], take: Callable[[dict[str, Any]], Taken]) -> Taken:
    """As :func:`run`, for commands that print one JSON object; what they found may be a reason for them to fail.

    Args:
        command: the path of the renderer's command.
        arguments: its arguments, beginning with the subcommand.
        take: takes what is needed out of the object.

    Returns:
        What ``take`` returns.

    Raises:
        RendererError: also when what it printed is not a JSON object, or ``take`` misses something in it.
    """
    done = _completed(command, arguments)
    try:
        answer = json.loads(done.stdout)
    except ValueError:
        answer = None
    if isinstance(answer, dict):
        try:
            return take(answer)
        except (KeyError, TypeError, ValueError) as error:
            raise RendererError(
                f"The answer of '{command}' lacks something ({error}); is it of the extension's version?"
            ) from error
    if done.returncode != 0:
        raise RendererError(_words(command, done.stderr or done.stdout, done.returncode))
    raise RendererError(_not_understood(command, done.stdout))


def _completed(command: str, arguments: list[str]) -> subprocess.CompletedProcess:
    try:
        return subprocess.run([command, *arguments], capture_output=True, text=True, errors="replace", check=False)
    except OSError as error:
        raise _not_startable(command, error) from error


class Rendering:
    """A running rendering. As a context manager it ends the process and its children on every way out.

    Args:
        command: the path of the renderer's command.
        arguments: its arguments, beginning with the subcommand; they must ask for progress as JSON lines.

    Raises:
        RendererError: the process cannot be started.
    """

    def __init__(self, command: str, arguments: list[str]):
        self._command = command
        # A file, because a pipe that nobody reads would stop the renderer once it is full.
        self._errors = tempfile.TemporaryFile(mode="w+", errors="replace")  # noqa: SIM115 - lives as long as the process
        self._interrupted = False
        try:
            self._process = subprocess.Popen(
                [command, *arguments],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=self._errors,
                text=True,
                errors="replace",
                start_new_session=True,  # its own process group, so that its children end with it
            )
        except OSError as error:
            self._errors.close()
            raise _not_startable(command, error) from error
        _running.add(self)
        self._lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def __enter__(self) -> "Rendering":
        return self

    def __exit__(self, *exception: object) -> None:
        self.end()

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
        status = self._process.wait()
        if status not in (0, INTERRUPTED):
            raise RendererError(_words(self._command, self._error_text(), status))

    def _event(self, line: str) -> dict:
        try:
            event = json.loads(line)
        except ValueError:
            event = None
        if not isinstance(event, dict) or not isinstance(event.get("event"), str):
            raise RendererError(_not_understood(self._command, line))
        return event

    def _error_text(self) -> str:
        self._errors.seek(0)
        return self._errors.read()

    def interrupt(self) -> None:
        """Ask the renderer to write what it has and to stop; :meth:`events` goes on until it has.

        It is asked once, however often this is called: a second signal would stop it before it has written.
        """
        if not self._interrupted:
            self._interrupted = True
            self._signal(signal.SIGINT)

    def end(self) -> None:
        """End the process group now, whatever it does, and wait until it is gone."""
        self._signal(signal.SIGTERM)
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(timeout=3.0)
        self._signal(signal.SIGKILL)
        self._process.wait()
        self._reader.join(timeout=3.0)
        self._process.stdout.close()
        self._errors.close()
        _running.discard(self)

    def _signal(self, number: int) -> None:
        with contextlib.suppress(ProcessLookupError):  # it and its children have ended by themselves
            os.killpg(self._process.pid, number)


_running: set[Rendering] = set()


@atexit.register
def end_all() -> None:
    """End what still renders: Blender quits, or the extension is switched off."""
    for rendering in list(_running):
        rendering.end()


def _not_startable(command: str, error: OSError) -> RendererError:
    return RendererError(f"The renderer '{command}' cannot be started: {error.strerror or error}")


def _words(command: str, said: str, status: int) -> str:
    """The renderer's own words; where it said nothing, how it ended."""
    said = said.strip()
    if "Traceback (most recent call last)" in said:
        said = f"The renderer crashed: {said.splitlines()[-1]}"
    if said:
        return said.removeprefix("error: ")
    if status < 0:
        return f"The renderer '{command}' was ended by the system ({signal.Signals(-status).name})."
    return f"The renderer '{command}' ended with status {status} and said nothing."


def _not_understood(command: str, printed: str) -> str:
    shown = " ".join(printed.split())
    shown = shown if len(shown) <= 120 else shown[:120] + "..."
    return f"'{command}' answered '{shown}', which is not what {COMMAND} says. Is this the right program and version?"
