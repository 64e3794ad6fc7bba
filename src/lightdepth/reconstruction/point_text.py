"""Point clouds as text: XYZ, PTS, CSV, as scanners and surveyors' programs write them."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError, warn

FloatArray = NDArray[np.float64]

_NAMES = (("x", "easting", "east", "e"), ("y", "northing", "north", "n"), ("z", "elevation", "height", "h", "altitude"))
"""What the columns of coordinates are called in a header."""
_COMMENTS = ("#", "//", "%", "!")
_SAMPLE = 50


@dataclass(frozen=True)
class _Layout:
    """How lines are written.

    Attributes:
        separator: between columns; ``None`` is white space.
        decimal_comma: numbers are written as 1,5.
        columns: of x, y and z.
    """

    separator: str | None
    decimal_comma: bool
    columns: tuple[int, int, int]

    def plain(self, line: str) -> str:
        """The line with decimal points."""
        return line.replace(",", ".") if self.decimal_comma else line


def read_text_points(path: Path) -> FloatArray:
    """Read the points of a text file, a line each.

    Columns are separated by white space, commas or semicolons; numbers may have decimal commas. A header names the
    columns, else the first three count, or those after a column of identifiers. Lines that hold one whole number only are
    counts, as in a PTS file, which may hold several clouds one after the other.

    Returns:
        Shape (n, 3), float64; NaN where a field is empty or says so.

    Raises:
        InputError: a line cannot be understood; the message names it.
    """
    lines, header = _lines(path)
    counts = [index for index, (_, line) in enumerate(lines) if line.isdigit()]
    data = [entry for entry in lines if not entry[1].isdigit()]
    if not data:
        raise InputError(f"{path}: holds no points, only {len(lines)} lines that are none")
    layout = _layout([line for _, line in data], header, path)
    if header is None and not _is_point(data[0][1], layout):
        data = data[1:]  # A title.
    points = _numbers(path, data, layout)
    _check_counts(path, lines, counts)
    return points


def _lines(path: Path) -> tuple[list[tuple[int, str]], str | None]:
    """Numbered lines that are neither empty nor comments, and the header."""
    data = path.read_bytes()
    encoding = "utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    text = data.decode(encoding, errors="replace").replace('"', "")
    lines: list[tuple[int, str]] = []
    comment = ""
    for number, raw in enumerate(text.splitlines(), start=1):
        line = raw.strip()
        if line.startswith(_COMMENTS):
            comment = line.lstrip("#/%! ") if not lines else comment
        elif line:
            lines.append((number, line))
    named = next((line for _, line in lines[:2] if _named_columns(line)), None)
    if named is not None:
        return [entry for entry in lines if entry[1] != named], named
    return lines, comment if _named_columns(comment) else None


def _words(line: str) -> list[str]:
    """Names in a header, in small letters, without units."""
    parts = re.split(r"[;,\t]", line) if re.search(r"[;,\t]", line) else line.split()
    return [re.sub(r"[\[(].*", "", part).strip().lower() for part in parts]


def _named_columns(line: str) -> tuple[int, int, int] | None:
    words = _words(line)
    found = [next((words.index(name) for name in names if name in words), None) for names in _NAMES]
    return (found[0], found[1], found[2]) if None not in found else None  # type: ignore[return-value]


def _layout(lines: Sequence[str], header: str | None, path: Path) -> _Layout:
    sample = lines[1 : _SAMPLE + 1] if len(lines) > _SAMPLE else lines  # The first line may be a title.
    most = len(sample) / 2
    separator: str | None = None
    if sum(";" in line for line in sample) > most:
        separator = ";"
    elif sum(line.count(",") >= 2 for line in sample) > most:
        in_spaces = sum(len(line.split()) >= 3 and _is_number(line.split()[1].replace(",", ".")) for line in sample)
        separator = None if in_spaces > most and sum("." in line for line in sample) < most else ","
    decimal_comma = separator != "," and sum("," in line for line in sample) > most
    layout = _Layout(separator, decimal_comma, (0, 1, 2))
    named = _named_columns(header) if header else None
    if named is not None:
        return _Layout(separator, decimal_comma, named)
    rows = [layout.plain(line).split(separator) for line in sample]
    rows = [row for row in rows if len(row) >= 4 and all(map(_is_number, row[1:4]))]
    if len(rows) > most and (sum(not _is_number(row[0]) for row in rows) > most or _counts_up(rows)):
        warn(
            f"{path}: the first column is taken for identifiers ('{rows[0][0].strip()}', ...), the next three for x, y, z"
        )
        return _Layout(separator, decimal_comma, (1, 2, 3))
    return layout


def _counts_up(rows: Sequence[Sequence[str]]) -> bool:
    """Whether the first column holds whole numbers, each one more than the last, and the next columns do not."""
    first = [row[0].strip() for row in rows]
    if len(rows) < 3 or not all(word.isdigit() for word in first):
        return False
    numbers = [int(word) for word in first]
    fractions = sum("." in word or "e" in word.lower() for row in rows for word in row[1:4])
    return fractions > len(rows) and all(after == before + 1 for before, after in pairwise(numbers))


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _is_point(line: str, layout: _Layout) -> bool:
    words = layout.plain(line).split(layout.separator)
    return len(words) > max(layout.columns) and all(
        not words[column].strip() or _is_number(words[column]) for column in layout.columns
    )


def _numbers(path: Path, lines: Sequence[tuple[int, str]], layout: _Layout) -> FloatArray:
    try:
        return np.loadtxt(
            [layout.plain(line) for _, line in lines],
            delimiter=layout.separator,
            usecols=layout.columns,
            comments=None,
            ndmin=2,
        )
    except ValueError:
        pass  # Some line is unlike the others: slowly, and with its number.
    points = np.empty((len(lines), 3))
    for index, (number, line) in enumerate(lines):
        if not _is_point(line, layout):
            columns = ", ".join(str(column + 1) for column in layout.columns)
            raise InputError(
                f"{path}: not a readable file of points: line {number} is '{line[:60]}'; numbers in its columns {columns} "
                "are needed"
            )
        words = layout.plain(line).split(layout.separator)
        points[index] = [float(words[column]) if words[column].strip() else np.nan for column in layout.columns]
    return points


def _check_counts(path: Path, lines: Sequence[tuple[int, str]], counts: Sequence[int]) -> None:
    """Warn where a cloud holds another number of points than the line before it says."""
    for index, end in pairwise([*counts, len(lines)]):
        stated, found = int(lines[index][1]), end - index - 1
        if stated != found and found > 0:
            warn(
                f"{path}: line {lines[index][0]} states {stated} points, and {found} follow; is the file cut off, or put "
                "together of several?"
            )
