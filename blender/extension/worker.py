"""The renderer that stays: one process renders all frames, view layers and renderings of a session of Blender."""

import json
import os
import queue
import subprocess
import threading
import time
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Self

from . import process
from .process import COMMAND, Process, RendererError

SCHEMA = 1
"""Version of the renderer's requests and events that is spoken here."""
VERSION = tomllib.loads(Path(__file__).with_name("blender_manifest.toml").read_text(encoding="utf-8"))["version"]
"""Version of the extension, and of the renderer that it needs."""
CANCEL_PATIENCE = 10.0
"""Seconds that a cancelled rendering has to write what it rendered."""
LOOK_SECONDS = 0.1
"""Between two looks whether the rendering is still wanted."""
_USAGE_ERROR = 2
"""Exit status of a command that does not know its arguments."""


class EndedError(RendererError):
    """The process has ended by itself, or was ended because it could not be understood."""


class Worker(Process):
    """A process ``lightdepth serve``.

    Args:
        command: the path of the renderer's command.

    Attributes:
        hello: what it said of itself; ``None`` before :meth:`greet`.
    """

    def __init__(self, command: str):
        reading, writing = os.pipe()
        self._requests = os.fdopen(writing, "w", encoding="utf-8")
        try:
            super().__init__(command, ["serve", "--stdio"], subprocess.PIPE, reading)
        except RendererError:
            self._requests.close()
            raise
        finally:
            os.close(reading)
        self.hello: dict[str, Any] | None = None
        self._ended = False
        self._number = 0
        self._said_before = 0
        self._lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def end(self) -> None:
        """As for every process."""
        if self._ended:
            return
        self._ended = True
        super().end()
        self._requests.close()
        self._reader.join(timeout=3.0)
        self._process.stdout.close()

    @property
    def ended(self) -> bool:
        """Whether it was ended, by whomever."""
        return self._ended

    def greet(self, cancelled: Callable[[], bool]) -> bool:
        """Wait until it has said what it is, before anything is asked of it.

        Args:
            cancelled: whether to wait no longer, asked now and then.

        Returns:
            Whether it may be used; false where it was cancelled.

        Raises:
            EndedError: it is of another version, no renderer at all, cannot be started, or says nothing.
        """
        began = time.monotonic()
        try:
            while (hello := self._next()) is None:
                if cancelled():
                    self.end()
                    return False
                if time.monotonic() - began > process.PATIENCE:
                    self.end()
                    raise EndedError(f"'{self.command}' did not answer for {process.PATIENCE:g} seconds; it was ended")
        except EndedError as error:
            if self._process.returncode == _USAGE_ERROR and "'serve'" in str(error):
                raise EndedError(self._other_version("a version without the command 'serve'")) from error
            raise
        if hello["event"] != "hello":
            raise self._failed(self._not_understood(json.dumps(hello)))
        found = (hello.get("version"), hello.get("schema"))
        if found != (VERSION, SCHEMA):
            raise self._failed(EndedError(self._other_version(f"version {found[0]} (protocol {found[1]})")))
        self._send(request="hello", schema=SCHEMA)
        self.hello = hello
        return True

    def _other_version(self, found: str) -> str:
        return (
            f"The renderer '{self.command}' is {found}, but this extension needs version {VERSION} (protocol {SCHEMA}). "
            f"Install {COMMAND} and its extension in the same version."
        )

    def render(
        self, request: dict[str, Any], cancelled: Callable[[], bool], patience: float | None = None
    ) -> Iterator[dict[str, Any]]:
        """Render, and give the events of it; the last is ``done``, unless it did not stop in time when cancelled.

        Who gives up in between ends the process: nothing is written any more then.

        Args:
            request: the request's keys, without ``request`` and ``id``.
            cancelled: whether the picture is no longer wanted, asked now and then. What has been rendered is written.
            patience: seconds that it then has to stop; ``CANCEL_PATIENCE`` by default.

        Raises:
            EndedError: the process has ended.
            RendererError: it cannot be rendered, in the renderer's words; the process can go on.
        """
        self._number += 1
        name = str(self._number)
        self._said_before = os.fstat(self._errors.fileno()).st_size
        self._send(request="render", id=name, **request)
        complete, deadline = False, None
        try:
            while not complete:
                if deadline is None and cancelled():
                    self._send(request="cancel", id=name)
                    deadline = time.monotonic() + (CANCEL_PATIENCE if patience is None else patience)
                if deadline is not None and time.monotonic() > deadline:
                    return
                event = self._next()
                if event is None or event.get("id", name) != name:
                    continue
                complete = event["event"] in ("done", "failure")
                if event["event"] == "failure":
                    raise RendererError(str(event.get("message")))
                yield event
        finally:
            if not complete:
                self.end()

    def _send(self, **request: object) -> None:
        try:
            self._requests.write(json.dumps(request) + "\n")
            self._requests.flush()
        except (OSError, ValueError):  # it is gone, which reading will tell more about
            pass

    def _read(self) -> None:
        for line in self._process.stdout:
            self._lines.put(line)
        self._lines.put(None)

    def _next(self) -> dict[str, Any] | None:
        """The next event, or ``None`` where there is none for a moment.

        Raises:
            EndedError: there will be none any more, or it is no event.
        """
        try:
            line = self._lines.get(timeout=LOOK_SECONDS)
        except queue.Empty:
            return None
        if line is None:
            if self._ended:
                raise EndedError(f"The renderer '{self.command}' was ended")
            self._wait()
            raise self._failed(self._failure(said_before=self._said_before))
        try:
            event = json.loads(line)
        except ValueError:
            event = None
        if not isinstance(event, dict) or not isinstance(event.get("event"), str):
            raise self._failed(self._not_understood(line))
        return event

    def _wait(self) -> None:
        """Wait until it has ended, as it says nothing any more."""
        try:
            self._process.wait(timeout=3.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()

    def _failed(self, error: RendererError) -> EndedError:
        self.end()
        return EndedError(str(error))


_kept: Worker | None = None
_lock = threading.Lock()
_waiting = 0


class Busy:
    """The renderer for oneself, as a context: it renders one thing after the other, and renderings come before previews.

    Args:
        given_up: whether to wait no longer for it, asked now and then.
        preview: give it back when somebody else waits.

    Attributes:
        mine: whether it was had; false where it was given up before.
    """

    def __init__(self, given_up: Callable[[], bool], preview: bool = False):
        self._given_up, self._preview = given_up, preview
        self.mine = False

    def __enter__(self) -> Self:
        global _waiting
        _waiting += not self._preview
        try:
            while not self.mine and not self._given_up():
                if self._preview and _waiting:
                    time.sleep(LOOK_SECONDS)
                else:
                    self.mine = _lock.acquire(timeout=LOOK_SECONDS)
        finally:
            _waiting -= not self._preview
        return self

    def __exit__(self, *exception: object) -> None:
        if self.mine:
            _lock.release()

    def is_cancelled(self) -> bool:
        """Whether what is rendered is to be cancelled."""
        return self._given_up() or (self._preview and _waiting > 0)


def render(
    command: str,
    request: dict[str, Any],
    cancelled: Callable[[], bool],
    warn: Callable[[str], None],
    patience: float | None = None,
) -> Iterator[dict[str, Any]]:
    """Render in the process that is kept; where there is none, it is started.

    One that has ended since it was used last is started again, once.

    Args:
        command: the path of the renderer's command.
        request: as for :meth:`Worker.render`.
        cancelled: as for :meth:`Worker.render`.
        warn: called with the reason where the process had to be started again.
        patience: as for :meth:`Worker.render`.

    Raises:
        RendererError: as :meth:`Worker.greet` and :meth:`Worker.render` raise it.
    """
    worker, fresh = _worker(command), False
    while True:
        if worker.hello is None:
            fresh = True
            if not worker.greet(cancelled):
                return
        begun = False
        events = worker.render(request, cancelled, patience)
        try:
            for event in events:
                begun = True
                yield event
            return
        except EndedError as error:
            if fresh or begun:
                raise
            warn(f"The renderer's process had ended and was started again: {error}")
            worker = _worker(command)
        finally:
            events.close()


def _worker(command: str) -> Worker:
    """The process that is kept, if it is that of the command and was not ended; else a new one."""
    global _kept
    if _kept is not None and (_kept.ended or _kept.command != command or _kept.hello is None):
        _kept.end()
        _kept = None
    if _kept is None:
        _kept = Worker(command)
    return _kept
