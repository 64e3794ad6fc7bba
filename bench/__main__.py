"""The benchmark's command line: ``python -m bench``, its parts, and ``page``, which publishes what they measured."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console

app = typer.Typer(help=__doc__, pretty_exceptions_enable=False, add_completion=False)
console = Console()


@app.callback(invoke_without_command=True)
def everything(
    context: typer.Context,
    quick: Annotated[
        bool, typer.Option(help="Small images and few samples: a few minutes, to see that it runs.")
    ] = False,
    note: Annotated[str, typer.Option(help="A sentence about the circumstances, for the page.")] = "",
) -> None:
    """Measure all methods on all places, and costs; write bench/results/*.json and docs/benchmarks.md."""
    if context.invoked_subcommand is not None:
        if quick or note:
            raise typer.BadParameter(
                "--quick and --note are of the whole benchmark; a part takes --quick after its name"
            )
        return
    from bench.cost import cost
    from bench.real import real
    from bench.report import write_report
    from bench.run import FULL, QUICK, RESULTS, run, save

    results = run(QUICK if quick else FULL, console) | {"note": note}
    console.print(f"wrote {save(results, 'fidelity')}", highlight=False)
    costs = cost(quick, console)
    photographs = real(quick, console)
    if photographs is not None:
        costs["tables"].append(photographs)
    (RESULTS / "cost.json").write_text(json.dumps(costs, indent=1) + "\n")
    console.print(f"wrote {write_report(results, costs)}", highlight=False)


@app.command()
def page() -> None:
    """Write docs/benchmarks.md again from bench/results/, after a part of the benchmark ran; its pictures stay."""
    from bench.report import write_report
    from bench.run import RESULTS

    results, costs = (json.loads((RESULTS / f"{name}.json").read_text()) for name in ("fidelity", "cost"))
    console.print(f"wrote {write_report(results, costs)}", highlight=False)


@app.command()
def cost(
    quick: Annotated[bool, typer.Option(help="Small sizes.")] = False,
    only: Annotated[str, typer.Option(help="Measure the tables whose titles contain this; others stay.")] = "",
) -> None:
    """Measure costs alone; print them and write bench/results/cost.json, unless they are quick."""
    from bench.cost import cost as measure_cost
    from bench.run import RESULTS

    path = RESULTS / "cost.json"
    costs = measure_cost(quick, console, only)
    for table in costs["tables"]:
        _print_table(table)
    if quick:
        return
    if only:
        measured = {table["title"]: table for table in costs["tables"]}
        costs["tables"] = [measured.get(table["title"], table) for table in json.loads(path.read_text())["tables"]]
    RESULTS.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(costs, indent=1) + "\n")


@app.command()
def captures(
    place: Annotated[list[str] | None, typer.Option(help="The places to measure; all by default. Repeat it.")] = None,
    quick: Annotated[bool, typer.Option(help="Small images and few samples.")] = False,
    panorama_samples: Annotated[
        int | None, typer.Option(help="Samples a pixel of the panoramas, whose noise moves with the surfaces.")
    ] = None,
) -> None:
    """One, two and three captures of a room, and a camera that travels through it."""
    from bench.captures import JOURNEYS
    from bench.captures import captures as measure

    for table in measure(place or list(JOURNEYS), quick, panorama_samples, console):
        _print_table(table)


@app.command()
def motion(quick: Annotated[bool, typer.Option(help="Small images and few samples.")] = False) -> None:
    """Measure motion blur against a path-traced mean over 64 instants; write bench/results/motion-blur.json."""
    from bench.motion_blur import measure
    from bench.run import RESULTS

    table = measure(quick, console)
    (RESULTS / "motion-blur.json").write_text(json.dumps(table, indent=1) + "\n")
    _print_table(table)


@app.command()
def flicker(quick: Annotated[bool, typer.Option(help="Small images and few samples.")] = False) -> None:
    """Measure what flickers under a travelling camera, with and without reuse; write bench/results/flicker.json."""
    from bench.flicker import measure
    from bench.run import RESULTS

    table = measure(quick, console)
    (RESULTS / "flicker.json").write_text(json.dumps(table, indent=1) + "\n")
    _print_table(table)


@app.command()
def truth(
    scene: Annotated[Path, typer.Option(help="A Mitsuba scene file, for example living-room/scene_patched.xml.")],
    capture: Annotated[str, typer.Option(help="Capture point X,Y,Z in the scene's own units and axes.")],
    objects: Annotated[str, typer.Option(help="Where the objects stand: X,Y,Z on the floor, as above.")] = "",
    up: Annotated[str, typer.Option(help="Which of the scene's axes points up: y or z.")] = "y",
    width: Annotated[int, typer.Option(help="Width of the panoramas in pixels.")] = 256,
    samples: Annotated[int, typer.Option(help="Samples a pixel of the truth; the methods get a sixteenth.")] = 1024,
) -> None:
    """Any Mitsuba scene as a place: photograph it, insert objects, compare with path tracing it with the objects.

    The figures are printed and kept in bench/results/foreign.json, from where the page takes them.

    Example: python -m bench truth --scene living-room/scene_patched.xml --capture 0,1.4,3 --objects 0,0,1.5
    """
    from bench.foreign import compare, keep
    from bench.run import RESULTS

    stand = _numbers(objects) if objects else None
    table = compare(scene, _numbers(capture), stand, up, width, samples, console)
    keep(table)
    _print_table(table)
    console.print(f"truth and the methods, top to bottom: {RESULTS / table['picture']}", highlight=False, markup=False)


@app.command()
def gloss(quick: Annotated[bool, typer.Option(help="Small sizes.")] = False) -> None:
    """A polished floor from a camera elsewhere, with and without its gloss; the errors are printed and kept."""
    from bench.gloss import table
    from bench.missing_light import keep

    measured = table(quick, console)
    if not quick:
        keep("gloss", [measured])
    _print_table(measured)


@app.command()
def suns() -> None:
    """Rooms whose sun the capture point does not see: bias with the sun declared, recovered and missing, and its cost."""
    from bench.missing_light import keep
    from bench.suns import EFFORT
    from bench.suns import suns as measure_suns

    tables = measure_suns(EFFORT, console)
    keep("suns", tables)
    for table in tables:
        _print_table(table)


@app.command()
def clipped() -> None:
    """Panoramas clipped on purpose: the sun that is recovered, and the depth of its shadows."""
    from bench.clipped import clipped as measure_clipped
    from bench.missing_light import keep

    tables = measure_clipped(console)
    keep("clipped", tables)
    for table in tables:
        _print_table(table)


@app.command()
def boxes(quick: Annotated[bool, typer.Option(help="Only the photographs and six furnished rooms.")] = False) -> None:
    """Fit the first guess of a room's box to virtual, furnished and photographed rooms; write bench/results/boxes.json."""
    from bench.boxes import boxes as measure
    from bench.run import RESULTS

    table = measure(quick, console)
    if not quick:
        (RESULTS / "boxes.json").write_text(json.dumps(table, indent=1, ensure_ascii=False) + "\n")
    _print_table(table)


@app.command()
def fireflies(quick: Annotated[bool, typer.Option(help="Only the first place.")] = False) -> None:
    """Fireflies left in denoised first pictures, and the light that denoising loses; write bench/results/fireflies.json."""
    from bench.fireflies import fireflies as measure
    from bench.run import RESULTS

    table = measure(quick, console)
    if not quick:
        (RESULTS / "fireflies.json").write_text(json.dumps(table, indent=1, ensure_ascii=False) + "\n")
    _print_table(table)


def _print_table(table: dict[str, Any]) -> None:
    console.print(f"\n{table['title']}", markup=False)
    for row in [table["head"], *table["rows"]]:
        console.print("  " + "   ".join(row), highlight=False, markup=False)


def _numbers(text: str) -> tuple[float, float, float]:
    values = tuple(float(part) for part in text.split(","))
    if len(values) != 3:
        raise typer.BadParameter(f"'{text}': three numbers separated by commas are needed")
    return values


if __name__ == "__main__":
    app()
