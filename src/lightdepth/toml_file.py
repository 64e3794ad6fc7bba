"""TOML files that a person wrote and a command changes in places."""

from __future__ import annotations

from pathlib import Path

import tomlkit
from tomlkit.exceptions import TOMLKitError

from lightdepth.errors import InputError


def read_document(path: Path) -> tomlkit.TOMLDocument:
    """Read a TOML file with its comments, order and line ends.

    Raises:
        InputError: the file is missing, cannot be read, or is not TOML.
    """
    try:
        return tomlkit.parse(path.read_bytes().decode("utf-8"))
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file") from error
    except (TOMLKitError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a readable TOML file ({error})") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error


def document_bytes(document: tomlkit.TOMLDocument) -> bytes:
    """What to write into the file; new lines end as the file's own do."""
    text = tomlkit.dumps(document).rstrip("\r\n") + "\n"
    if "\r\n" in text:
        text = text.replace("\r\n", "\n").replace("\n", "\r\n")
    return text.encode("utf-8")
