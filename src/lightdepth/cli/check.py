"""`lightdepth check`: everything that is wrong with a scene, at once."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from lightdepth.errors import InputError

if TYPE_CHECKING:
    from lightdepth.checks import Coverage, Problem

COLORS = {"error": "bold red", "warning": "yellow", "hint": "cyan"}


def check(
    scene: Annotated[Path, typer.Argument(help="Scene file (.toml).", show_default=False)],
    as_json: Annotated[bool, typer.Option("--json", help="Print the findings as JSON.")] = False,
) -> None:
    """Report all problems of a scene at once, and how much of the panorama has geometry.

    The exit status is 2 where an error would keep the scene from being rendered, and 0 with warnings and hints only.

    Example: lightdepth check examples/lounge/scene.toml
    """
    from lightdepth.checks import Severity, inspect_file

    inspection = inspect_file(scene)
    problems, coverage = inspection.problems, inspection.coverage
    if as_json:
        found = {"scene": str(scene), "problems": [asdict(problem) for problem in problems]}
        typer.echo(json.dumps(found | {"coverage": None if coverage is None else asdict(coverage)}, indent=2))
    else:
        _print_report(scene, problems, coverage)
    if any(problem.severity is Severity.ERROR for problem in problems):
        raise typer.Exit(InputError.exit_status)


def _print_report(scene: Path, problems: Sequence[Problem], coverage: Coverage | None) -> None:
    console = Console(soft_wrap=False, highlight=False)
    if problems:
        table = Table(show_header=False, box=None, padding=(0, 1, 1, 0))
        table.add_column(no_wrap=True)
        table.add_column(overflow="fold")
        for problem in problems:
            table.add_row(Text(problem.severity, style=COLORS[problem.severity]), Text(problem.message))
        console.print(table)
    if coverage is not None:
        parts = ", ".join(f"{name} {100 * share:.1f} %" for name, share in coverage.by_surface.items())
        sky = f"; {100 * coverage.sky:.1f} % are sky" if coverage.sky else ""
        console.print(
            Text(f"coverage: {100 * coverage.share:.1f} % of all directions meet a real surface ({parts}){sky}")
        )
    counts = {kind: sum(problem.severity == kind for problem in problems) for kind in COLORS}
    summary = ", ".join(f"{count} {kind}{'' if count == 1 else 's'}" for kind, count in counts.items() if count)
    console.print(Text(f"{scene}: {summary or 'no problems'}"))
