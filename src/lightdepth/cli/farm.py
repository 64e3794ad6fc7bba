"""`lightdepth farm`: the frames of a sequence as a job for a farm."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console

from lightdepth.cli.render import INTERRUPTED
from lightdepth.cli.reporting import own_command
from lightdepth.errors import InputError

if TYPE_CHECKING:
    from lightdepth.farm.shot import Shot

app = typer.Typer(no_args_is_help=True)
PASSED_ON = {"allow_extra_args": True, "ignore_unknown_options": True}
OWN = ("--progress", "--share", "--resume", "--region", "--verify", "--checkpoint-seconds", "--preview-seconds")
"""Options of ``render`` that make no sense for a chunk."""

UsageError: type[Exception] = typer.BadParameter.__bases__[0]
"""Typer exports this class of its parser's only as the base of its own."""

SceneFile = Annotated[Path, typer.Argument(help="The scene file (TOML), where the machines find it as well.")]
Frames = Annotated[str, typer.Option(help="Frames to render, as 1-240 or 7,10-20.")]
Output = Annotated[Path, typer.Option("-o", "--output", help="The frames to write, as shot.####.exr.")]
Step = Annotated[int, typer.Option(min=1, help="Render only every N-th of --frames.")]
Chunk = Annotated[int, typer.Option(min=1, help="Frames that a machine renders at a time.")]


@app.command(context_settings=PASSED_ON)
def openjd(
    context: typer.Context,
    scene: SceneFile,
    bundle: Annotated[Path, typer.Argument(help="The folder to write.")],
    frames: Frames,
    output: Output,
    step: Step = 1,
    chunk: Chunk = 10,
) -> None:
    """Write an Open Job Description bundle, as AWS Deadline Cloud takes it.

    All other options are those of `lightdepth render`.

    Example: lightdepth farm openjd shot.toml job --frames 1-240 -o out/shot.####.exr --camera travel --samples 64
    """
    from lightdepth.farm.openjd import write_bundle

    shot = _shot(context.args, scene, frames, output, step, chunk)
    write_bundle(bundle, shot)
    _wrote(bundle / "template.json", shot)


@app.command(context_settings=PASSED_ON)
def slurm(
    context: typer.Context,
    scene: SceneFile,
    script: Annotated[Path, typer.Argument(help="The script to write.")],
    frames: Frames,
    output: Output,
    step: Step = 1,
    chunk: Chunk = 10,
) -> None:
    """Write a script for Slurm's `sbatch`, with an array of tasks.

    All other options are those of `lightdepth render`.

    Example: lightdepth farm slurm shot.toml shot.sh --frames 1-240 -o out/shot.####.exr --camera travel --samples 64
    """
    from lightdepth.farm.slurm import write_script

    shot = _shot(context.args, scene, frames, output, step, chunk)
    write_script(script, shot)
    _wrote(script, shot)


@app.command(context_settings=PASSED_ON)
def dask(
    context: typer.Context,
    scene: SceneFile,
    frames: Frames,
    output: Output,
    scheduler: Annotated[
        str, typer.Option(help="Address of the Dask scheduler, as tcp://host:8786, or the file that it writes.")
    ],
    step: Step = 1,
    chunk: Chunk = 10,
) -> None:
    """Render on the workers of a Dask scheduler, and wait for them.

    All other options are those of `lightdepth render`. Ctrl-C withdraws what no worker has begun.

    Example: lightdepth farm dask shot.toml --scheduler tcp://host:8786 --frames 1-240 -o out/shot.####.exr --samples 64
    """
    from lightdepth.farm.dask import run_on_dask
    from lightdepth.packages import require_package

    require_package("distributed", "farm")
    shot = _shot(context.args, scene, frames, output, step, chunk)
    console, total = _console(), len(shot.chunks)
    failed: list[str] = []
    try:
        with closing(run_on_dask(shot, scheduler)) as ends:
            for number, end in enumerate(ends, start=1):
                state = "are there" if end.failure is None else "failed"
                console.print(f"frames {end.frames} {state}, {number} of {total} chunks", markup=False)
                if end.failure is not None:
                    failed.append(f"frames {end.frames}: {end.failure}")
    except KeyboardInterrupt:
        console.print(
            f"interrupted; workers finish their chunk; continue with: {own_command()}", style="yellow", markup=False
        )
        raise typer.Exit(INTERRUPTED) from None
    if failed:
        raise InputError("\n".join(failed))
    console.print(f"rendered {len(shot.frames)} frames: {shot.files.pattern}", markup=False)


def _shot(options: list[str], scene: Path, frames: str, output: Path, step: int, chunk: int) -> Shot:
    from lightdepth.farm.shot import Shot
    from lightdepth.scene.frames import SceneFrames
    from lightdepth.sequence.numbering import FrameFiles, parsed_frames

    _check_options(options, scene)
    numbers = parsed_frames(frames, step, SceneFrames(scene).sequence)
    return Shot(scene.absolute(), numbers, FrameFiles(output.absolute()), tuple(options), chunk)


def _check_options(options: list[str], scene: Path) -> None:
    """Find out here what every machine would stumble over."""
    from lightdepth.cli.render import render

    own = [option for option in options if option.split("=")[0] in OWN]
    if own:
        raise InputError(f"{own[0]}: cannot be given for a farm")
    alone = typer.Typer(add_completion=False)
    alone.command()(render)
    try:
        with typer.main.get_command(alone).make_context("render", [str(scene), *options]):
            pass
    except typer.BadParameter as error:
        raise InputError(f"lightdepth render: {error.format_message()}") from error
    except UsageError as error:
        raise InputError(f"lightdepth render: {error}") from error


def _console() -> Console:
    return Console(stderr=True, highlight=False, soft_wrap=True)


def _wrote(path: Path, shot: Shot) -> None:
    _console().print(f"wrote {path}: {len(shot.frames)} frames in {len(shot.chunks)} chunks", markup=False)
