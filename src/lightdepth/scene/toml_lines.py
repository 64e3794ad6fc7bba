"""Line numbers of a TOML file's tables and keys, for messages; Python's own parser does not report them."""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass

_HEADER = re.compile(r"^\s*(\[\[?)\s*([^\]]+?)\s*\]")


@dataclass(frozen=True)
class _Header:
    line: int
    name: str
    position: int  # among the tables of an array; 0 for a plain table


class TomlLines:
    """Where the tables and keys of a TOML text stand."""

    def __init__(self, text: str) -> None:
        self._lines = text.splitlines()
        self._headers: list[_Header] = []
        seen: Counter[str] = Counter()
        for number, line in enumerate(self._lines, start=1):
            if match := _HEADER.match(line):
                name = ".".join(part.strip(" \"'") for part in match[2].split("."))
                self._headers.append(_Header(number, name, seen[name]))
                seen[name] += 1

    def line_of(self, table: str, position: int, keys: tuple[str, ...]) -> int | None:
        """Line of the innermost of some keys that stands on a line of its own, else of the table's header.

        Args:
            table: the table's dotted name; empty for the keys before the first table.
            position: which of the tables of an array, counted from 0.
            keys: the keys from the table inward.

        Returns:
            The line, counted from 1, or ``None`` where the file has no such table.
        """
        start = 0
        for header in self._headers:
            if header.name == table and header.position == position:
                start = header.line
        if table and start == 0:
            return None
        end = min((h.line - 1 for h in self._headers if h.line > start), default=len(self._lines))
        for key in reversed(keys):
            pattern = re.compile(rf"""^\s*["']?{re.escape(key)}["']?\s*[=.]""")
            for number in range(start, end):
                if pattern.match(self._lines[number]):
                    return number + 1
        return start or None
