"""A bounded store of arrays on disk, found by content and safe between processes.

An entry is one file: a line of JSON that says what it is and holds the digest of the rest, then NumPy's ``.npz``. It is
written under another name and renamed, so that who reads it finds all of it or nothing.
"""

from __future__ import annotations

import contextlib
import errno
import hashlib
import io
import json
import logging
import os
import tempfile
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError, warn

FORMAT = 1
"""Number of the file format; raise it when that changes."""
LIMIT = 1 << 30
"""Bytes that all entries take together, at most; those that were used least recently go first."""
SUFFIX, UNFINISHED = ".place", ".tmp-"
ABANDONED = 3600.0
"""Seconds after which an unfinished file belongs to a process that has died."""
VARIABLE, OFF = "LIGHTDEPTH_CACHE", "off"
FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
"""Of a disk, a user's share of it, and a process's largest file."""

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Entry:
    """A file of the store.

    Attributes:
        path: where it is.
        source: what it was made from, for people; empty where the file is damaged.
        size: bytes.
        used: when it was last used, seconds since the epoch.
    """

    path: Path
    source: str
    size: int
    used: float


class Store:
    """Arrays by key, in a folder that is made when the first entry is written.

    Nothing here raises because of what the disk holds or refuses: it is warned of or logged, and the work goes on without.

    Args:
        folder: where the entries are.
        limit: bytes that they take together, at most.
    """

    def __init__(self, folder: Path, limit: int = LIMIT) -> None:
        self.folder, self.limit = folder, limit

    def read(self, key: str) -> dict[str, NDArray] | None:
        """The arrays of a key; ``None`` where there is none, or where the entry is damaged, with a warning.

        Args:
            key: hexadecimal digits.
        """
        path = self._path(key)
        try:
            contents = path.read_bytes()
        except FileNotFoundError:
            return None
        except OSError as error:
            warn(f"{path}: cannot be read ({error.strerror}); the place is prepared again")
            return None
        try:
            arrays = _unpacked(contents, key)
        except ValueError as error:
            warn(f"{path}: damaged cache entry ({error}); the place is prepared again")
            return None
        with contextlib.suppress(OSError):
            os.utime(path)
        log.info("%s: prepared place taken from the cache", path)
        return arrays

    def write(self, key: str, arrays: Mapping[str, NDArray], source: str) -> None:
        """Keep arrays, and remove what is too much.

        Args:
            key: hexadecimal digits.
            arrays: by name, none of them of Python objects.
            source: what they were made from, for people.
        """
        contents = _packed(key, arrays, source)
        if len(contents) > self.limit:
            log.info("a prepared place of %d bytes is too large for the cache", len(contents))
            return
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            handle, name = tempfile.mkstemp(prefix=UNFINISHED, dir=self.folder)
            try:
                with os.fdopen(handle, "wb") as file:
                    os.fchmod(file.fileno(), 0o644)  # A cache may be shared by several users.
                    file.write(contents)
                os.replace(name, self._path(key))
            except BaseException:
                with contextlib.suppress(OSError):
                    os.unlink(name)
                raise
        except OSError as error:
            text = f"{self.folder}: cannot be written ({error.strerror}); going without a cache"
            if error.errno in FULL:
                warn(f"{text}. 'lightdepth cache --clear' makes room; {VARIABLE} names another folder")
            else:
                log.info("%s", text)
            return
        self._remove_surplus()

    def entries(self) -> list[Entry]:
        """What is there, the most recently used first."""
        found = [Entry(path, _source(path), size, used) for path, size, used in self._files(SUFFIX)]
        return sorted(found, key=lambda entry: -entry.used)

    def clear(self) -> int:
        """Remove all entries, and say how many there were.

        Raises:
            InputError: one cannot be removed.
        """
        count = 0
        for path, _, _ in [*self._files(SUFFIX), *self._files("")]:
            try:
                path.unlink()
            except FileNotFoundError:
                continue
            except OSError as error:
                raise InputError(f"{path}: cannot be removed ({error.strerror})") from error
            count += path.suffix == SUFFIX
        return count

    def _path(self, key: str) -> Path:
        return self.folder / f"{key}{SUFFIX}"

    def _files(self, suffix: str) -> Iterator[tuple[Path, int, float]]:
        """Entries (with their suffix) or unfinished files (without one): path, bytes, and time of last use."""
        try:
            names = sorted(os.listdir(self.folder))
        except OSError:
            return
        for name in names:
            if name.endswith(SUFFIX) if suffix else name.startswith(UNFINISHED):
                with contextlib.suppress(OSError):  # Another process may have removed it.
                    status = (self.folder / name).stat()
                    yield self.folder / name, status.st_size, status.st_mtime

    def _remove_surplus(self) -> None:
        files = sorted(self._files(SUFFIX), key=lambda file: -file[2])
        total = 0
        surplus = []
        for path, size, _ in files:
            total += size
            if total > self.limit:
                surplus.append(path)
        surplus += [path for path, _, changed in self._files("") if time.time() - changed > ABANDONED]
        for path in surplus:
            with contextlib.suppress(OSError):
                path.unlink()


def default_store() -> Store | None:
    """The store that the environment asks for; ``None`` where there is no folder for one, which is logged.

    ``LIGHTDEPTH_CACHE`` names the folder, or is ``off``. Without it, it is ``lightdepth`` in ``XDG_CACHE_HOME`` or in
    ``~/.cache``.
    """
    chosen = os.environ.get(VARIABLE, "")
    if chosen == OFF:
        return None
    if chosen:
        return Store(Path(chosen).absolute())
    base = os.environ.get("XDG_CACHE_HOME", "")
    if os.path.isabs(base):  # Others are to be ignored, as the specification says.
        return Store(Path(base) / "lightdepth")
    home = os.environ.get("HOME", "")
    if not os.path.isabs(home):
        log.info("no home folder; going without a cache")
        return None
    return Store(Path(home) / ".cache" / "lightdepth")


def _packed(key: str, arrays: Mapping[str, NDArray], source: str) -> bytes:
    stream = io.BytesIO()
    np.savez(stream, **arrays)  # type: ignore[arg-type]
    payload = stream.getvalue()
    head = {"format": FORMAT, "key": key, "source": source, "sha256": hashlib.sha256(payload).hexdigest()}
    return json.dumps(head).encode() + b"\n" + payload


def _unpacked(contents: bytes, key: str) -> dict[str, NDArray]:
    """The arrays of a file.

    Raises:
        ValueError: the file is damaged, or of another format.
    """
    line, _, payload = contents.partition(b"\n")
    head = _head(line)
    if head.get("format") != FORMAT:
        raise ValueError(f"format {head.get('format')!r}, not {FORMAT}")
    if head.get("key") != key:
        raise ValueError("it belongs to another place")
    if head.get("sha256") != hashlib.sha256(payload).hexdigest():
        raise ValueError("its contents do not match their digest")
    with np.load(io.BytesIO(payload), allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


def _head(line: bytes) -> dict[str, Any]:
    try:
        head = json.loads(line)
    except ValueError as error:
        raise ValueError("it has no header") from error
    if not isinstance(head, dict):
        raise ValueError("it has no header")
    return head


def _source(path: Path) -> str:
    try:
        with path.open("rb") as file:
            return str(_head(file.readline(1 << 16)).get("source", ""))
    except (OSError, ValueError):
        return ""
