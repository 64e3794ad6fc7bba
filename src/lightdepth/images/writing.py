"""Writing files so that they appear whole or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from lightdepth.errors import InputError


@contextmanager
def whole_file(path: Path) -> Iterator[Path]:
    """Give a temporary file beside ``path`` to write into, and put it in place of ``path`` once that went well.

    Args:
        path: the file to write; an existing one is replaced.

    Yields:
        The temporary file, which has the extension of ``path``. It is removed where writing fails.

    Raises:
        InputError: ``path`` cannot be written (folder missing, no permission, disk full).
    """
    temporary = _beside(path)
    try:
        yield temporary
        os.replace(temporary, path)
    except (OSError, RuntimeError) as error:  # The OpenEXR binding reports a full disk as a RuntimeError.
        raise _cannot_write(path, error) from error
    finally:
        temporary.unlink(missing_ok=True)


def check_writable(path: Path) -> None:
    """Make sure that a file can be written at ``path``, before long work is spent on its content.

    Raises:
        InputError: ``path`` is a folder, or its folder is missing or lets no file be made in it.
    """
    _beside(path).unlink()


def _beside(path: Path) -> Path:
    """Make an empty file in the folder of ``path``, hidden, with the same extension."""
    if path.is_dir():
        raise InputError(f"{path}: cannot be written (it is a folder)")
    if not path.parent.is_dir():
        found = "; a file has that name" if path.parent.exists() else ""
        raise InputError(f"{path}: cannot be written (there is no folder '{path.parent}'{found})")
    try:
        descriptor, name = tempfile.mkstemp(prefix=f".{path.stem}.", suffix=path.suffix, dir=path.parent)
        os.fchmod(descriptor, 0o644)
        os.close(descriptor)
    except OSError as error:
        raise _cannot_write(path, error) from error
    return Path(name)


def _cannot_write(path: Path, error: Exception) -> InputError:
    reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
    return InputError(f"{path}: cannot be written ({reason})")
