"""TOML files that a person wrote: read as plain data, or as a document that a command changes in places."""

from __future__ import annotations

import shlex
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import tomlkit
from tomlkit.exceptions import TOMLKitError

from lightdepth.errors import InputError

PICTURES = (".hdr", ".exr", ".jpg", ".jpeg", ".png", ".tif", ".tiff", ".heic", ".heif")
"""Ends of names of files that are sometimes given in place of a scene file."""
DEEPEST = 32
"""How many tables and lists may stand inside each other."""


def read_toml(path: Path) -> tuple[str, dict[str, Any]]:
    """Read a TOML file as plain data.

    Returns:
        Its text, and what it says.

    Raises:
        InputError: the file is missing, cannot be read, is not TOML, or is nested too deeply.
    """
    text = _read_text(path)
    try:
        document = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: not valid TOML: {error}") from error
    except RecursionError as error:
        raise _too_deep(path) from error
    except ValueError as error:
        raise InputError(f"{path}: not valid TOML: it has a number of too many digits or an impossible date") from error
    _check_values(path, document)
    return text, document


def read_document(path: Path) -> tomlkit.TOMLDocument:
    """Read a TOML file with its comments, order and line ends.

    Raises:
        InputError: the file is missing, cannot be read, is not TOML, or is nested too deeply.
    """
    text, _ = read_toml(path)
    try:
        return tomlkit.parse(text)
    except TOMLKitError as error:
        raise InputError(f"{path}: not valid TOML: {error}") from error


def document_bytes(document: tomlkit.TOMLDocument) -> bytes:
    """What to write into the file; new lines end as the file's own do."""
    text = tomlkit.dumps(document).rstrip("\r\n") + "\n"
    if "\r\n" in text:
        text = text.replace("\r\n", "\n").replace("\n", "\r\n")
    return text.encode("utf-8")


def _read_text(path: Path) -> str:
    """A file's text, without the byte order mark that some editors write, its line ends as they are."""
    try:
        content = path.read_bytes()
    except FileNotFoundError as error:
        raise InputError(f"{path}: no such file") from error
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})") from error
    except ValueError as error:
        raise InputError(f"{str(path)!r}: no such file") from error
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        if path.suffix.lower() in PICTURES:
            hint = f"lightdepth new {shlex.quote(path.name)} begins a scene file from a panorama"
            raise InputError(f"{path}: a picture, and not a scene file (TOML); {hint}") from error
        raise InputError(f"{path}: line {line}: not UTF-8 text; save the TOML file as UTF-8") from error


def _too_deep(path: Path) -> InputError:
    return InputError(f"{path}: tables and lists are nested more than {DEEPEST} levels deep, which no key needs")


def _check_values(path: Path, document: dict[str, Any]) -> None:
    """Refuse what no part of the program expects: numbers beyond TOML's range, and endless nesting."""
    waiting: list[tuple[Any, int]] = [(document, 0)]
    while waiting:
        value, depth = waiting.pop()
        if depth > DEEPEST:
            raise _too_deep(path)
        if isinstance(value, dict | list):
            waiting += [(inner, depth + 1) for inner in (value.values() if isinstance(value, dict) else value)]
        elif isinstance(value, int) and not -(2**63) <= value < 2**63:
            raise InputError(f"{path}: not valid TOML: an integer beyond 64 bits")


def first_panorama(document: Mapping[str, Any]) -> Any:
    """The first ``[[panorama]]`` table of a scene file, or its ``[panorama]``; ``None`` where there is none."""
    panorama = document.get("panorama")
    return panorama[0] if isinstance(panorama, list) and panorama else panorama
