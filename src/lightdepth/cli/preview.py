"""`lightdepth preview`: the panorama as a PNG with a grid, to read points off."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer


def preview(
    panorama: Annotated[Path, typer.Argument(help="The panorama, 360 x 180 degrees.")],
    output: Annotated[
        Path | None, typer.Option("-o", "--output", help="The PNG file; PANORAMA-preview.png by default.")
    ] = None,
) -> None:
    """Write a panorama as a PNG that any viewer shows, with a grid of pixels (yellow) and degrees (blue).

    The PNG has the panorama's size, so that the coordinates that a viewer shows are those that `where`, `calibrate`,
    `reconstruct layout` and `at` in the scene file take. What the file does not show of the sphere is hatched.

    Example: lightdepth preview room.exr -o room.png
    """
    from rich.console import Console
    from rich.markup import escape

    from lightdepth.calibration.grid_picture import draw_grid
    from lightdepth.errors import InputError
    from lightdepth.images.panorama_file import read_panorama
    from lightdepth.images.png import write_png
    from lightdepth.images.validation import validate_panorama
    from lightdepth.images.writing import check_writable

    target = output or Path(f"{panorama.stem}-preview.png")
    if target.suffix.lower() != ".png":
        raise InputError(f"-o {target}: the preview is a .png file")
    check_writable(target)
    image = read_panorama(panorama)
    radiance = validate_panorama(image.radiance, panorama, repair=True)
    write_png(target, draw_grid(radiance, image.unknown))
    console = Console(stderr=True, soft_wrap=True, highlight=False)
    for note in image.notes:
        console.print(f"[yellow]warning:[/] {escape(note)}")
    console.print(f"wrote {target}, {radiance.shape[1]} x {radiance.shape[0]} pixels", markup=False)
