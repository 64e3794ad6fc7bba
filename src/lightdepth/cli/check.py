"""`lightdepth check`: everything that is wrong with a scene, at once."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table
from rich.text import Text

from lightdepth.errors import InputError

if TYPE_CHECKING:
    from lightdepth.checks import Inspection, PhotographReport, PlateReport

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
        found: dict[str, object] = {"scene": str(scene), "problems": [asdict(problem) for problem in problems]}
        found["photographs"] = [asdict(photograph) for photograph in inspection.photographs]
        found["plate"] = None if inspection.plate is None else asdict(inspection.plate)
        typer.echo(json.dumps(found | {"coverage": None if coverage is None else asdict(coverage)}, indent=2))
    else:
        _print_report(scene, inspection)
    if any(problem.severity is Severity.ERROR for problem in problems):
        raise typer.Exit(InputError.exit_status)


def _print_report(scene: Path, inspection: Inspection) -> None:
    problems, coverage = inspection.problems, inspection.coverage
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
    if coverage is not None and inspection.photographs:
        parts = ", ".join(f"{name} {100 * share:.1f} %" for name, share in coverage.unseen.items())
        console.print(Text(f"seen by no panorama, of each surface's area: {parts}"))
        for number, photograph in enumerate(inspection.photographs, 1):
            console.print(Text(f"panorama {number}: {_comparison(photograph)}"))
    if inspection.plate is not None:
        console.print(Text(f"plate: {_plate(inspection.plate)}"))
    counts = {kind: sum(problem.severity == kind for problem in problems) for kind in COLORS}
    summary = ", ".join(f"{count} {kind}{'' if count == 1 else 's'}" for kind, count in counts.items() if count)
    console.print(Text(f"{scene}: {summary or 'no problems'}"))


def _plate(plate: PlateReport) -> str:
    """How the plate compares with the panoramas, in words."""
    gain = " ".join(f"{value:.3g}" for value in plate.gain)
    text = (
        f"gain {gain}, {'as given' if plate.given else 'solved'}; {100 * plate.modelled:.1f} % of it shows a real surface, "
        f"{100 * plate.seen:.1f} % what a panorama sees too"
    )
    if not plate.shared:
        return text
    return (
        f"{text}; {plate.shared} parts compared, differing by {100 * plate.deviation:.1f} % typically, by more than a "
        f"quarter in {100 * plate.disagrees:.1f} %"
    )


def _comparison(photograph: PhotographReport) -> str:
    """How a panorama compares with the others, in words."""
    gain = " ".join(f"{value:.3g}" for value in photograph.gain)
    origin = "as given" if photograph.given else f"gain {gain}, solved"
    if not photograph.shared:
        return f"{origin}; it shares nothing with the others"
    return (
        f"{origin}; {photograph.shared} directions shared, differing by {100 * photograph.deviation:.1f} % typically, by "
        f"more than a quarter in {100 * photograph.disagrees:.1f} %"
    )
