"""The command `lightdepth`: the list of its commands, and how errors end it."""

from __future__ import annotations

import logging
import sys
import warnings
from importlib import metadata
from typing import Annotated, Any, Literal

import typer
from rich.console import Console

from lightdepth.cli import capture
from lightdepth.cli.cache import cache
from lightdepth.cli.calibrate import app as calibrate
from lightdepth.cli.check import check
from lightdepth.cli.deliver import deliver
from lightdepth.cli.doctor import doctor
from lightdepth.cli.farm import app as farm
from lightdepth.cli.lightmap import lightmap
from lightdepth.cli.merge import merge
from lightdepth.cli.mirror_ball import mirror_ball
from lightdepth.cli.new import new
from lightdepth.cli.preview import preview
from lightdepth.cli.reconstruct import app as reconstruct
from lightdepth.cli.recover import app as recover
from lightdepth.cli.render import render
from lightdepth.cli.serve import serve
from lightdepth.cli.stmap import app as stmap
from lightdepth.cli.where import where
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
    log_level: Annotated[
        Literal["debug", "info", "warning", "error"] | None,
        typer.Option(help="Log at this level to standard error; nothing by default."),
    ] = None,
) -> None:
    if log_level is not None:
        logger, handler = logging.getLogger("lightdepth"), logging.StreamHandler()
        handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(name)s %(message)s"))
        logger.addHandler(handler)
        logger.setLevel(log_level.upper())
    if version:
        typer.echo(metadata.version("lightdepth"))
        raise typer.Exit


# Every command is listed here. The modules load nothing heavy before the command runs.
app.command()(new)
capture.app.command("mirror-ball")(mirror_ball)
app.add_typer(capture.app, name="capture")
app.command()(preview)
app.add_typer(
    calibrate,
    name="calibrate",
    help="Poses from clicks: of the panorama, of a photograph (view), of a further panorama (second).",
)
app.add_typer(reconstruct, name="reconstruct", help="Meshes of the real place, and where its lamps are.")
app.add_typer(
    recover,
    name="recover",
    help="Suns, clipped lamps and gloss, recovered from what the photograph shows of their light.",
)
app.command()(lightmap)
app.command(context_settings={"ignore_unknown_options": True})(where)  # Points may begin with a minus.
app.command()(check)
app.add_typer(stmap, name="stmap", help="Lens distortion as ST maps, for compositing programs.")
app.command()(render)
app.command()(merge)
app.add_typer(farm, name="farm", help="Frames of a sequence as a job for a farm.")
app.command()(deliver)
app.command()(serve)
app.command()(cache)
app.command()(doctor)


def main() -> None:
    """Run the command line; a known problem ends in one message and its exit status, without a traceback."""
    shown_by_python = warnings.showwarning

    def show(message: Warning | str, category: type[Warning], *_: Any, **more: Any) -> None:
        if issubclass(category, InputWarning):
            _console().print(f"[yellow]warning:[/] {_plain(str(message))}")
        else:  # Of a package, about what a user can do nothing with.
            logging.getLogger("lightdepth").info("%s: %s", category.__name__, message)

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
