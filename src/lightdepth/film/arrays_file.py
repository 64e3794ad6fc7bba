"""Named arrays in one file, with a header: how sums of samples are kept.

The file is NumPy's ``.npz``, uncompressed, which many tools read.
"""

from __future__ import annotations

import json
import os
import zipfile
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError

FORMAT = 1
"""Version of the files' contents."""


def write_arrays(path: Path, kind: str, header: Mapping[str, Any], arrays: Mapping[str, NDArray]) -> None:
    """Write arrays; whenever the process is killed, ``path`` is the old file or the new one, and whole.

    Args:
        path: the file.
        kind: what the file is.
        header: plain values for JSON.
        arrays: by name.

    Raises:
        InputError: ``path`` cannot be written.
    """
    # Always the same name, so that a killed process leaves one such file at most, and the next one takes it over.
    part = path.with_name(f".{path.name}.part")
    text = json.dumps({"kind": kind, "format": FORMAT, **header})
    try:
        with part.open("wb") as file:
            np.savez(file, allow_pickle=False, header=np.array(text), **arrays)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise InputError(f"{path}: cannot be written ({error.strerror or error})") from error


def read_arrays(
    path: Path, kind: str, names: Collection[str] | None = None
) -> tuple[dict[str, Any], dict[str, NDArray]]:
    """Read what :func:`write_arrays` wrote.

    Args:
        path: the file.
        kind: what it must be.
        names: of the arrays that are needed; ``None`` for all.

    Returns:
        The header and the arrays.

    Raises:
        InputError: the file is missing, damaged, of another kind, or of a later version.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
            wanted = file.files if names is None else ("header", *names)
            arrays = {name: file[name] for name in wanted}
        header = json.loads(str(arrays.pop("header")))
        found, version = header["kind"], int(header["format"])
    except (OSError, ValueError, KeyError, TypeError, AttributeError, EOFError, zipfile.BadZipFile) as error:
        raise InputError(f"{path}: not a file of {kind}, or damaged") from error
    if found != kind:
        raise InputError(f"{path}: is a file of {found}, not of {kind}")
    if version > FORMAT:
        raise InputError(f"{path}: has format {version}; this version of lightdepth reads up to {FORMAT}")
    return header, arrays


def remove_arrays(path: Path) -> None:
    """Remove such a file, and what a killed process has left of one."""
    path.unlink(missing_ok=True)
    path.with_name(f".{path.name}.part").unlink(missing_ok=True)
