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

_NAMES = (
    ("x", "easting", "east", "e", "rechtswert", "ost"),
    ("y", "northing", "north", "n", "hochwert", "nord"),
    ("z", "elevation", "height", "h", "altitude", "hoehe", "h\u00f6he"),
)
"""What the columns of coordinates are called in a header."""
_PREFIXES, _AXES = ("points", "point", "pos", "position", "coord", "coordinate", "p"), {"0": "x", "1": "y", "2": "z"}
_UNITS = {"m": 1.0, "mm": 0.001, "cm": 0.01, "km": 1000.0, "ft": 0.3048, "feet": 0.3048, "in": 0.0254, "inch": 0.0254}
"""Metres in units that a header may name."""
_NOTHING = {"null", "none", "n/a", "na", "-", "*", "1.#qnan", "-1.#ind", "1.#inf", "nan(ind)", "-nan(ind)"}
_NO_DATA = (-9999.0, -99999.0, -999999.0, -32768.0, 9999.0, 99999.0)
"""What stands for a point that was not measured, in all of its coordinates."""
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


def read_text_cloud(path: Path) -> tuple[FloatArray, float | None]:
    """Read the points of a text file, a line each.

    Columns are separated by white space, commas or semicolons; numbers may have decimal commas. A header names the
    columns, else the first three count, or those after a column of identifiers. Lines that hold one whole number only are
    counts, as in a PTS file, which may hold several clouds one after the other.

    Returns:
        ``(points, unit)``: shape (n, 3), float64, NaN where a field is empty or says so; and the metres of the unit that
        the header names, or ``None``.

    Raises:
        InputError: a line cannot be understood; the message names it.
    """
    lines, header = _lines(path)
    counts = [index for index, (_, line) in enumerate(lines) if line.isdigit()]
    if counts[:2] == [0, 1]:
        raise InputError(
            f"{path}: begins with two whole numbers, as columns and rows of a PTX file do, which is not read; save it as "
            "PTS or E57"
        )
    data = [entry for entry in lines if not entry[1].isdigit()]
    if not data:
        raise InputError(f"{path}: holds no points, only {len(lines)} lines that are none")
    if header is not None and _is_geographic(header):
        raise InputError(
            f"{path}: its columns are degrees of latitude and longitude; points in metres are needed: project them first"
        )
    layout = _layout([line for _, line in data], header, path)
    title = data.pop(0)[1] if header is None and not _is_point(data[0][1], layout) else None
    if not data:
        raise InputError(f"{path}: holds no points, only the line '{title[:60] if title else ''}'")
    points = _numbers(path, data, layout)
    if title is not None:
        _check_title(path, title, data, layout)
    points[(points == points[:, :1]).all(axis=1) & np.isin(points[:, 0], _NO_DATA)] = np.nan
    _check_counts(path, lines, counts)
    return points, None if header is None else _unit(header)


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
    named = next((line for _, line in lines[:2] if _named_columns(line) or _is_geographic(line)), None)
    if named is not None:
        return [entry for entry in lines if entry[1] != named], named
    return lines, comment if _named_columns(comment) else None


def _fields(line: str) -> list[str]:
    """Fields of a header, in small letters."""
    parts = re.split(r"[;,\t]", line) if re.search(r"[;,\t]", line) else line.split()
    return [part.strip().lower() for part in parts]


def _words(line: str) -> list[str]:
    """Names in a header, in small letters, without units and without what stands before an axis: Points:0 is x."""
    words = []
    for field in _fields(line):
        parts = [part for part in re.split(r"[:_. ]", re.sub(r"[\[(].*", "", field).strip()) if part]
        if len(parts) > 1 and parts[-1] in _UNITS:
            parts.pop()
        if len(parts) == 2 and parts[0] in _PREFIXES:
            parts = [_AXES.get(parts[1], parts[1])]
        words.append(" ".join(parts))
    return words


def _named_columns(line: str) -> tuple[int, int, int] | None:
    words = _words(line)
    found = [next((words.index(name) for name in names if name in words), None) for names in _NAMES]
    return (found[0], found[1], found[2]) if None not in found else None  # type: ignore[return-value]


def _is_geographic(line: str) -> bool:
    words = set(_words(line))
    return bool(words & {"lat", "latitude"} and words & {"lon", "long", "lng", "longitude"}) and not _named_columns(
        line
    )


def _unit(header: str) -> float | None:
    """Metres of the unit that the header names beside the first coordinate."""
    named = _named_columns(header)
    field = _fields(header)[named[0]] if named else ""
    word = re.search(r"[\[(]\s*(\w+)\s*[\])]$|_(\w+)$", field)
    return None if word is None else _UNITS.get(word[1] or word[2])


def _check_title(path: Path, title: str, data: Sequence[tuple[int, str]], layout: _Layout) -> None:
    """Warn of a first line that seems to name the columns in words that are not known."""
    columns = layout.plain(data[0][1]).split(layout.separator) if data else []
    names = title.split(layout.separator)
    if len(names) == len(columns) >= 3 and all(name.strip()[:1].isalpha() for name in names):
        chosen = ", ".join(names[column].strip() for column in layout.columns)
        warn(f"{path}: the names of its columns are not known ('{title[:60]}'); {chosen} are taken for x, y, z")


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
    named_rows = sum(not _is_number(row[0]) for row in rows) > most
    if len(rows) > most and (named_rows or _counts_up(rows) or _are_whole(rows)):
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


def _are_whole(rows: Sequence[Sequence[str]]) -> bool:
    """Whether the first column holds whole numbers, and each of the next three mostly fractions."""
    fractions = [sum("." in row[column] for row in rows) for column in (1, 2, 3)]
    return (
        len(rows) >= 10
        and all(row[0].strip().lstrip("-").isdigit() for row in rows)
        and min(fractions) > 0.8 * len(rows)
    )


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


def _is_point(line: str, layout: _Layout) -> bool:
    words = layout.plain(line).split(layout.separator)
    return len(words) > max(layout.columns) and all(
        _is_nothing(words[column]) or _is_number(words[column]) for column in layout.columns
    )


def _is_nothing(word: str) -> bool:
    word = word.strip().lower()
    return not word or word in _NOTHING


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
        points[index] = [np.nan if _is_nothing(words[column]) else float(words[column]) for column in layout.columns]
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
