"""The command `lightdepth`: the list of its commands, and how errors end it."""

from __future__ import annotations

import sys
import warnings
from importlib import metadata
from typing import Annotated, Any

import typer
from rich.console import Console

from lightdepth.cli import capture
from lightdepth.cli.calibrate import calibrate
from lightdepth.cli.check import check
from lightdepth.cli.doctor import doctor
from lightdepth.cli.lightmap import lightmap
from lightdepth.cli.reconstruct import app as reconstruct
from lightdepth.cli.render import render
from lightdepth.errors import InputWarning, LightdepthError

app = typer.Typer(
    name="lightdepth",
    help="Render synthetic objects into 360 degree HDR panoramas that carry depth.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    add_completion=False,
)


@app.callback()
def _options(
    version: Annotated[bool, typer.Option("--version", is_eager=True, help="Print the version and exit.")] = False,
) -> None:
    if version:
        typer.echo(metadata.version("lightdepth"))
        raise typer.Exit


# Every command is listed here. The modules load nothing heavy before the command runs.
app.add_typer(capture.app, name="capture")
app.command()(calibrate)
app.add_typer(reconstruct, name="reconstruct", help="Meshes of the real place, and where its lamps are.")
app.command()(lightmap)
app.command()(check)
app.command()(render)
app.command()(doctor)


def main() -> None:
    """Run the command line; a known problem ends in one message and its exit status, without a traceback."""
    shown_by_python = warnings.showwarning

    def show(message: Warning | str, category: type[Warning], *place: Any, **more: Any) -> None:
        if issubclass(category, InputWarning):
            _console().print(f"[yellow]warning:[/] {_plain(str(message))}")
        else:
            shown_by_python(message, category, *place, **more)

    warnings.showwarning = show
    try:
        app()
    except LightdepthError as error:
        _console().print(f"[bold red]error:[/] {_plain(str(error))}")
        sys.exit(error.exit_status)
    finally:
        warnings.showwarning = shown_by_python


def _console() -> Console:
    return Console(stderr=True, soft_wrap=True, highlight=False)


def _plain(message: str) -> str:
    """The message with rich's markup switched off."""
    return message.replace("[", r"\[")
