"""Text of unknown encoding, and the files that it names."""

from __future__ import annotations

import codecs
from pathlib import Path, PureWindowsPath

from lightdepth.files import is_file

_MARKS = {codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16", codecs.BOM_UTF8: "utf-8-sig"}
_LEGACY = "latin-1"  # Every byte is a letter, so that the bytes can be had back.
_NAME_ENCODINGS = ("cp1252", "gb18030", "shift_jis", "cp949", "big5", "cp1251")


def decoded(content: bytes) -> str:
    """Text by its byte order mark, else as UTF-8, else byte by byte: names then match those read the same way."""
    for mark, encoding in _MARKS.items():
        if content.startswith(mark):
            return content.decode(encoding, errors="replace")
    try:
        return content.decode("utf-8")
    except UnicodeDecodeError:
        return content.decode(_LEGACY)


def logical_lines(text: str) -> list[str]:
    """Lines; those that a backslash continues are joined, and the number of lines stays."""
    lines = (
        text.replace("\r\n", "\n").replace("\r", "\n").split("\n")
    )  # Other ends of lines are halves of letters here.
    if "\\" not in text:
        return lines
    joined: list[str] = []
    start: int | None = None
    for line in lines:
        if start is not None:
            joined[start] += " " + line
            joined.append("")
        else:
            joined.append(line)
        if _continues(line):
            start = len(joined) - 1 if start is None else start
            joined[start] = joined[start].rstrip()[:-1]
        else:
            start = None
    return joined


def _continues(line: str) -> bool:
    """Whether a backslash ends a line that is no comment, and is no half of a letter as in Shift-JIS."""
    line = line.rstrip()
    return line.endswith("\\") and not line.lstrip().startswith("#") and not "\x81" <= line[-2:-1] <= "\xfc"


def named_file(folder: Path, name: str) -> Path | None:
    """The file that a text names: as it stands, in another case, with backslashes, or by its last part in the folder.

    Other programs write names of other machines. Names in old encodings are tried in the common ones.
    """
    name = name.strip().strip('"')
    if not name or "\0" in name:
        return None
    for spelling in _spellings(name):
        if is_file(folder / spelling):
            return folder / spelling
        parts = [part for part in PureWindowsPath(spelling).parts if part not in ("\\", "/", ".")]
        for relative in (parts, parts[-1:]):
            if (found := _in_any_case(folder, relative)) is not None:
                return found
    return None


def _spellings(name: str) -> list[str]:
    found = [name]
    for encoding in _NAME_ENCODINGS if not name.isascii() else ():
        try:
            found.append(name.encode(_LEGACY).decode(encoding))
        except UnicodeError:
            continue
    return found


def _in_any_case(folder: Path, parts: list[str]) -> Path | None:
    """A file by its folders and name, whatever their case; the exact one where there are several."""
    path = folder
    for part in parts:
        if part == "..":
            path = path / part
            continue
        try:
            names = {entry.name for entry in path.iterdir()}
        except (OSError, ValueError):
            return None
        alike = [part] if part in names else sorted(n for n in names if n.casefold() == part.casefold())
        if not alike:
            return None
        path = path / alike[0]
    return path if parts and is_file(path) else None
