"""Options that several commands share, with the same words in the help of each."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

SceneFile = Annotated[Path, typer.Argument(help="The scene file (TOML).")]
Device = Annotated[Literal["auto", "cpu", "cuda"], typer.Option(help="Where to compute.")]
Denoise = Annotated[bool, typer.Option("--denoise", help="Denoise the change and the new objects only.")]
Exposure = Annotated[
    float,
    typer.Option(help="Stops by which the graded picture is lighter than the panorama's own brightness asks for."),
]
Ocio = Annotated[
    str | None,
    typer.Option(
        "--ocio", help="OpenColorIO configuration that grades the picture: a file, or ocio://default; $OCIO by default."
    ),
]
OcioDisplay = Annotated[str | None, typer.Option("--display", help="Display of the OpenColorIO configuration.")]
OcioView = Annotated[str | None, typer.Option("--view", help="View of the OpenColorIO configuration.")]
ExrStructure = Annotated[
    Literal["multipart", "single"],
    typer.Option("--exr", help="Layers as parts of the EXR file, or all channels in one part."),
]
Repair = Annotated[bool, typer.Option("--repair", help="Replace NaN, infinite and negative radiance.")]
Progress = Annotated[Literal["bar", "json", "none"], typer.Option(help="How progress is reported.")]
