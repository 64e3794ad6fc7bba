"""`lightdepth lightmap`: the light-depth map of a scene as a file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from lightdepth.cli.options import SceneFile

if TYPE_CHECKING:
    from lightdepth.lightmap.file import LightDepthMap


def lightmap(
    scene: SceneFile,
    output: Annotated[Path, typer.Option("-o", "--output", help="The OpenEXR file to write.")],
    median_cut: Annotated[
        int | None,
        typer.Option(
            min=1,
            metavar="K",
            help="Also cut the map into K point lights of equal energy (Debevec 2005): *-lights.csv, .json and .png.",
        ),
    ] = None,
) -> None:
    """Write a scene's light-depth map: its panorama with the distance to the real surface in every pixel.

    The file is OpenEXR with the channels R G B (radiance) and Z (metres along the ray, inf for sky) and the capture
    pose. A picture of the depth is written beside it as PNG.

    Example: lightdepth lightmap lounge.toml -o lounge-map.exr --median-cut 64
    """
    from rich.console import Console
    from rich.progress import Progress

    from lightdepth.errors import InputError
    from lightdepth.images.png import write_png
    from lightdepth.images.writing import check_writable
    from lightdepth.lightmap.building import build_light_depth_map
    from lightdepth.lightmap.depth_picture import depth_picture
    from lightdepth.lightmap.file import write_light_depth_map
    from lightdepth.scene.load import load_scene

    if output.suffix.lower() != ".exr":
        raise InputError(f"{output}: a light-depth map is an OpenEXR file; its name must end in .exr")
    picture = output.with_suffix(".png")
    check_writable(output)
    check_writable(picture)
    for path in _light_files(output) if median_cut is not None else []:
        check_writable(path)
    console = Console(stderr=True)
    with Progress(console=console, transient=True) as progress:
        task = progress.add_task("Distances", total=1.0)
        result = build_light_depth_map(load_scene(scene), lambda share: progress.update(task, completed=share))
    pixels, nearest, farthest = depth_picture(result.depth)
    write_light_depth_map(output, result)
    write_png(picture, pixels)
    if median_cut is not None:
        _write_lights(result, median_cut, output)
    height, width = result.depth.shape
    console.print(f"{output}: {width} x {height}, {nearest:.2f} to {farthest:.2f} m", highlight=False)
    console.print(f"{picture}: the depth; near is bright, sky is black", highlight=False)
    if median_cut is not None:
        console.print(f"{', '.join(map(str, _light_files(output)))}: the median cut's lights", highlight=False)


def _light_files(output: Path) -> list[Path]:
    """Table, table and picture of a median cut, beside the map."""
    return [output.with_name(f"{output.stem}-lights{suffix}") for suffix in (".csv", ".json", ".png")]


def _write_lights(light_depth_map: LightDepthMap, count: int, output: Path) -> None:
    from lightdepth.images.png import write_png
    from lightdepth.lightmap.median_cut import median_cut
    from lightdepth.lightmap.median_cut_picture import draw_median_cut
    from lightdepth.tables import write_table

    lights = median_cut(light_depth_map.radiance, light_depth_map.depth, count)
    *tables, picture = _light_files(output)
    for table in tables:
        write_table(table, lights.as_rows(light_depth_map.position, light_depth_map.rotation))
    write_png(picture, draw_median_cut(light_depth_map.radiance, lights))
