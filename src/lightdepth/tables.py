"""Tables of results as files: CSV and JSON."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lightdepth.errors import InputError
from lightdepth.images.writing import whole_file


def write_table(path: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write rows of named values; the file appears whole or not at all.

    Args:
        path: a .json file (a list of objects) or a .csv file, in which a list of numbers has a column for each, named
            ``NAME_1``, ``NAME_2`` ..., and nothing stands for ``None``.
        rows: each with the same names.

    Raises:
        InputError: the name ends in something else, or the file cannot be written.
    """
    if path.suffix.lower() == ".json":
        text = json.dumps(list(rows), indent=2) + "\n"
    elif path.suffix.lower() == ".csv":
        text = _csv(rows)
    else:
        raise InputError(f"{path}: '{path.suffix}' is not a format for tables; allowed are .csv, .json")
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def _csv(rows: Sequence[Mapping[str, Any]]) -> str:
    lengths: dict[str, int] = {}
    for row in rows:
        for name, value in row.items():
            lengths[name] = max(lengths.get(name, 0), len(value) if isinstance(value, list) else 0)
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(
        [title for name, n in lengths.items() for title in ([f"{name}_{i + 1}" for i in range(n)] if n else [name])]
    )
    for row in rows:
        cells: list[Any] = []
        for name, n in lengths.items():
            value = row[name]
            cells += (value if value is not None else [""] * n) if n else [value]
        writer.writerow(cells)
    return text.getvalue()
