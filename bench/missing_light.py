"""Where the figures on light that the photograph lacks are kept, for the page."""

from __future__ import annotations

import json
from typing import Any

from bench.run import RESULTS

FILE = RESULTS / "missing_light.json"


def keep(name: str, tables: list[dict[str, Any]]) -> None:
    """Put tables into the file in place of those of the same name."""
    FILE.write_text(json.dumps(_all() | {name: tables}, indent=1) + "\n")


def kept() -> list[dict[str, Any]]:
    """All tables that were kept."""
    return [table for tables in _all().values() for table in tables]


def _all() -> dict[str, list[dict[str, Any]]]:
    return json.loads(FILE.read_text()) if FILE.is_file() else {}
