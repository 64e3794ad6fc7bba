"""Several files that appear together or not at all."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from lightdepth.errors import InputError


@contextmanager
def whole_folder(target: Path) -> Iterator[Path]:
    """Give a temporary folder beside files that are to be written, and move its files there once all went well.

    Args:
        target: one of the files; its folder is made.

    Yields:
        The temporary folder. It is removed in any case.

    Raises:
        InputError: the files cannot be written.
    """
    folder = target.parent
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=f".{target.stem}.", dir=folder) as temporary:
            yield Path(temporary)
            for file in sorted(Path(temporary).iterdir()):
                os.replace(file, folder / file.name)
    except OSError as error:
        raise InputError(f"{target}: cannot be written ({error.strerror or error})") from error
