"""How the commands that find poses print them: a table for people, or a JSON object for programs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import typer


def rounded(values: Iterable[Any], decimals: int = 5) -> list[float]:
    """Numbers as ``--json`` prints them, without negative zeros."""
    return [round(float(value), decimals) + 0.0 for value in values]


def numbers(values: Sequence[float], decimals: int = 3) -> str:
    """Numbers as the table shows them."""
    return "  ".join(f"{value:.{decimals}f}" for value in values)


def print_result(report: dict[str, Any], rows: Iterable[tuple[str, str, str]], as_json: bool) -> None:
    """Print a result; its warnings go to the standard error output.

    Args:
        report: what ``--json`` prints, with ``warnings``.
        rows: of the table: what, its values, and what they are.
        as_json: print the report instead of the table.
    """
    import json

    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    if as_json:
        typer.echo(json.dumps(report))
        return
    table = Table(show_header=False, box=None, pad_edge=False)
    for row in rows:
        table.add_row(*row)
    Console(highlight=False).print(table)
    for warning in report["warnings"]:
        Console(stderr=True, soft_wrap=True, highlight=False).print(f"[yellow]warning:[/] {escape(warning)}")
