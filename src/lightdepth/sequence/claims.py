"""Claims on frames: files in the shared folder by which processes agree, without a server, who renders what.

A claim is a small file beside the frame's, created exclusively. It says who holds it, and its holder touches it while it
works. One that has not been touched for its time, or whose process on this machine is gone, is free again. All times are
those of the folder's file system, so that the clocks of the machines may differ. Should two processes render a frame all
the same, because one of them was suspended, both write the same file, whole.
"""

from __future__ import annotations

import contextlib
import json
import os
import socket
import tempfile
import threading
import time
import uuid
from pathlib import Path
from typing import Any

from lightdepth.errors import InputError

EXPIRY = 120.0
"""Seconds after which a claim that nobody touches is free."""
TOUCHES = 6
"""How often a claim is touched in that time."""


class Claim:
    """A frame that this process holds; a context in which it is kept, and after which it is free.

    Args:
        path: the claim's file, which exists.
        token: by which its holder knows it.
        expiry: seconds.
    """

    def __init__(self, path: Path, token: str, expiry: float) -> None:
        self._path, self._token, self._expiry = path, token, expiry
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._keep, name="lightdepth claim", daemon=True)

    def __enter__(self) -> Claim:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()
        if _contents(self._path).get("token") == self._token:
            self._path.unlink(missing_ok=True)

    def _keep(self) -> None:
        while not self._ended.wait(self._expiry / TOUCHES):
            with contextlib.suppress(OSError):
                os.utime(self._path)


def claim_beside(file: Path) -> Path:
    """The claim that belongs to a frame's file."""
    return file.with_suffix(".claim")


def take(path: Path, expiry: float = EXPIRY) -> Claim | None:
    """Claim a frame.

    Args:
        path: the claim's file.
        expiry: seconds without a sign of life after which the claim may be taken by others.

    Returns:
        The claim, or ``None`` where another process holds it.

    Raises:
        InputError: files cannot be made in the folder.
    """
    for _ in range(2):
        token = uuid.uuid4().hex
        try:
            descriptor = os.open(path, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o644)
        except FileExistsError:
            if not clear(path):
                return None
            continue
        except OSError as error:
            raise InputError(f"{path}: cannot be written ({error.strerror})") from error
        try:
            with os.fdopen(descriptor, "w", encoding="utf-8") as file:
                json.dump(_holder(token, expiry), file)
        except OSError as error:
            path.unlink(missing_ok=True)
            raise InputError(f"{path}: cannot be written ({error.strerror})") from error
        return Claim(path, token, expiry)
    return None


def _holder(token: str, expiry: float) -> dict[str, Any]:
    return {
        "host": socket.gethostname(),
        "pid": os.getpid(),
        "time": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()),
        "expiry": expiry,
        "machine": _machine(),
        "began": _began(os.getpid()),
        "token": token,
    }


def _contents(path: Path) -> dict[str, Any]:
    """What a claim says; empty where there is none, or while it is being written."""
    try:
        contents = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return contents if isinstance(contents, dict) else {}


def clear(path: Path) -> bool:
    """Remove a claim whose holder is gone; whether the frame is free."""
    if not path.exists():
        return True
    contents = _contents(path)
    if not _is_abandoned(path, contents):
        return False
    aside = path.with_name(f".{path.name}.{uuid.uuid4().hex}")
    try:
        os.rename(path, aside)
    except FileNotFoundError:
        return True
    except OSError:
        return False
    try:
        if _contents(aside).get("token") == contents.get("token"):
            return True
        with contextlib.suppress(OSError):  # Another process was faster and holds it by now.
            os.link(aside, path)
        return False
    finally:
        aside.unlink(missing_ok=True)


def _is_abandoned(path: Path, contents: dict[str, Any]) -> bool:
    if contents.get("machine") == _machine() and _began(contents.get("pid")) != contents.get("began"):
        return True
    expiry = contents.get("expiry")
    expiry = float(expiry) if isinstance(expiry, int | float) else EXPIRY
    try:
        touched = path.stat().st_mtime
    except FileNotFoundError:
        return True
    except OSError:
        return False
    return now(path.parent) - touched > expiry


def now(folder: Path) -> float:
    """The time by the clock of a folder's file system, seconds."""
    with contextlib.suppress(OSError), tempfile.NamedTemporaryFile(prefix=".clock.", dir=folder) as file:
        return os.fstat(file.fileno()).st_mtime
    return 0.0


def _machine() -> str:
    """What tells machines, and containers that do not see each other's processes, from each other."""
    with contextlib.suppress(OSError):
        boot = Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
        return f"{boot} {os.readlink('/proc/self/ns/pid')}"
    return f"{socket.gethostname()} {uuid.getnode()}"


def _began(pid: Any) -> str | None:
    """When a process of this machine began, so that another one of the same number is not taken for it."""
    try:
        line = Path(f"/proc/{int(pid)}/stat").read_text(encoding="utf-8", errors="replace")
    except (OSError, ValueError, TypeError):
        return None
    fields = line.rpartition(")")[2].split()
    return None if fields[0] == "Z" else fields[19]
