"""The command `lightdepth`: the list of its commands, and how errors end it."""

from __future__ import annotations

import sys
from importlib import metadata
from typing import Annotated

import typer
from rich.console import Console

from lightdepth.cli import capture
from lightdepth.cli.calibrate import calibrate
from lightdepth.cli.check import check
from lightdepth.cli.doctor import doctor
from lightdepth.cli.lightmap import lightmap
from lightdepth.cli.new import new
from lightdepth.cli.preview import preview
from lightdepth.cli.reconstruct import app as reconstruct
from lightdepth.cli.render import render
from lightdepth.cli.where import where
from lightdepth.errors import LightdepthError

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
app.command()(new)
app.add_typer(capture.app, name="capture")
app.command()(preview)
app.command()(calibrate)
app.add_typer(reconstruct, name="reconstruct", help="Meshes of the real place, and where its lamps are.")
app.command()(lightmap)
app.command(context_settings={"ignore_unknown_options": True})(where)  # Points may begin with a minus.
app.command()(check)
app.command()(render)
app.command()(doctor)


def main() -> None:
    """Run the command line; a known problem ends in one message and its exit status, without a traceback."""
    try:
        app()
    except LightdepthError as error:
        Console(stderr=True, soft_wrap=True, highlight=False).print(f"[bold red]error:[/] {_plain(str(error))}")
        sys.exit(error.exit_status)


def _plain(message: str) -> str:
    """The message with rich's markup switched off."""
    return message.replace("[", r"\[")
