"""`lightdepth serve`: one process that renders for another program and keeps scenes prepared."""

from __future__ import annotations

import os
import sys
from typing import Annotated

import typer

from lightdepth.cli.options import Device


def serve(
    stdio: Annotated[bool, typer.Option("--stdio", help="Communicate by standard input and output.")] = False,
    device: Device = "auto",
) -> None:
    """Render requests that come as JSON, one a line, and answer with events; see docs/session.md.

    Example: lightdepth serve --stdio
    """
    from lightdepth.errors import InputError
    from lightdepth.serve.worker import Worker
    from lightdepth.session.events import Failure

    if not stdio:
        raise InputError("give --stdio, the only kind of connection so far")
    # The protocol has a descriptor of its own: whatever else prints goes to standard error.
    with os.fdopen(os.dup(1), "w", buffering=1, encoding="utf-8") as answers:
        os.dup2(2, 1)

        def answer(line: str) -> None:
            answers.write(line + "\n")

        try:
            Worker(answer, device).serve(sys.stdin)
        except InputError as error:
            answer(Failure(str(error)).to_json())
            raise
        except KeyboardInterrupt:
            raise typer.Exit(130) from None
