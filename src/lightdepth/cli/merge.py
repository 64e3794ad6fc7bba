"""`lightdepth merge`: the parts of a still that several processes rendered, to one picture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from lightdepth.cli.options import (
    Denoise,
    Device,
    Exposure,
    ExrStructure,
    Ocio,
    OcioDisplay,
    OcioView,
    Progress,
    Repair,
)
from lightdepth.cli.render import INTERRUPTED, Interruption, Reporter, check_output, chosen_layers, run
from lightdepth.errors import InputError


def merge(
    parts: Annotated[list[Path], typer.Argument(help="Files of `render --share`.", show_default=False)],
    output: Annotated[
        Path, typer.Option("-o", "--output", help="The EXR file to write, or a .sums file to merge again.")
    ],
    scene: Annotated[Path | None, typer.Option(help="The scene file, if it has moved.")] = None,
    device: Device = "auto",
    denoise: Denoise = False,
    exposure: Exposure = 0.0,
    ocio: Ocio = None,
    display: OcioDisplay = None,
    view: OcioView = None,
    layers: Annotated[
        str,
        typer.Option(help="Layers to write beside the picture, comma-separated; 'all' or 'none'."),
    ] = "all",
    exr: ExrStructure = "multipart",
    repair: Repair = False,
    progress: Progress = "none",
) -> None:
    """Merge the shares of a still that `lightdepth render --share` has computed.

    The picture is that of one process. All shares must be of the same scene, camera, seed and number of samples.

    Example: lightdepth merge part1.sums part2.sums -o view.exr
    """
    from lightdepth.api import load_scene
    from lightdepth.film.sums import PixelSums
    from lightdepth.film.sums import merge as merged
    from lightdepth.images.look import chosen_look
    from lightdepth.session.displays import ExrDisplay, PngDisplay
    from lightdepth.session.session import Job, Session

    to_sums = output.suffix.lower() == ".sums"
    chosen, look = chosen_layers(layers), chosen_look(None, ocio, display, view)
    files = [output] if to_sums else [output, output.with_suffix(".png")]
    check_output(output, files, ".sums" if to_sums else ".exr")
    sums = merged([PixelSums.load(part) for part in parts], [str(part) for part in parts])
    if to_sums:
        sums.save(output)
        Console(stderr=True, highlight=False, soft_wrap=True).print(f"wrote {output}")
        return
    if not sums.complete:
        raise InputError(
            f"{', '.join(map(str, parts))}: the picture is not complete; missing: {', '.join(sums.missing)}"
        )
    if scene is None and not sums.origin.path:
        raise InputError(f"{parts[0]}: does not state its scene file; give it with --scene")
    origin = sums.origin
    with Interruption() as interruption:
        try:
            loaded = load_scene(scene or origin.path, repair)
            job = Job(origin.camera, None, None, origin.method, origin.seed, origin.draft, denoise, merged=sums)
            session = Session(loaded, device, keep=False)
            session.display(ExrDisplay(output, chosen, exr))
            session.display(PngDisplay(files[1], exposure, look))
            with Reporter(progress, files) as reporter:
                run(session, job, reporter, interruption)
        except KeyboardInterrupt:
            Console(stderr=True).print("interrupted; nothing was written", style="yellow")
            raise typer.Exit(INTERRUPTED) from None
