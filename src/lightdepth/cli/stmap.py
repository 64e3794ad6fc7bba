"""`lightdepth stmap`: lens distortion exchanged with compositing programs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from lightdepth.cli.options import SceneFile

app = typer.Typer(no_args_is_help=True)


@app.command("write")
def write(
    scene: SceneFile,
    camera: Annotated[str | None, typer.Option(help="The perspective camera; the file's first by default.")] = None,
    undistort: Annotated[
        Path | None, typer.Option(help="The map that removes the distortion of a picture (.exr).")
    ] = None,
    redistort: Annotated[Path | None, typer.Option(help="The map that distorts an undistorted picture (.exr).")] = None,
    overscan: Annotated[
        float, typer.Option(min=1.0, max=3.0, help="By how much the undistorted picture is wider and higher.")
    ] = 1.0,
) -> None:
    """Write the distortion of a camera as ST maps.

    Red and green say where to read the other picture, in shares of its size from the lower left corner, as Nuke's STMap
    node takes them.

    Example: lightdepth stmap write room.toml --camera plate --undistort u.exr --redistort r.exr
    """
    import numpy as np
    from pydantic import TypeAdapter, ValidationError

    from lightdepth.calibration.stmap import distortion, needed_overscan, undistortion
    from lightdepth.cameras import CameraSettings, Perspective
    from lightdepth.errors import InputError
    from lightdepth.images.stmap import write_stmap
    from lightdepth.images.writing import check_writable
    from lightdepth.scene.problems import nearest
    from lightdepth.toml_file import read_toml

    if undistort is None and redistort is None:
        raise InputError("give --undistort or --redistort, or both: the files to write")
    for path in (undistort, redistort):
        if path is not None and path.suffix.lower() != ".exr":
            raise InputError(f"{path}: an ST map is an OpenEXR file (.exr)")
        if path is not None:
            check_writable(path)
    _, document = read_toml(scene)
    cameras = document.get("camera")
    if not isinstance(cameras, dict) or not cameras:
        raise InputError(f"{scene}: has no [camera.NAME] table")
    name = camera if camera is not None else next(iter(cameras))
    if name not in cameras:
        raise InputError(f"{scene}: has no camera '{name}'{nearest(name, cameras)}")
    try:
        settings = TypeAdapter(CameraSettings).validate_python(cameras[name])
    except ValidationError as error:
        raise InputError(f"{scene}: camera '{name}': {error.errors()[0]['msg']}") from error
    if not isinstance(settings, Perspective):
        raise InputError(f"{scene}: camera '{name}' is of type '{settings.type}'; ST maps are of perspective cameras")
    if undistort is not None:
        write_stmap(undistort, undistortion(settings, overscan))
    if redistort is not None:
        write_stmap(redistort, distortion(settings, overscan))
    needed = needed_overscan(settings)
    if needed > overscan * (1.0 + 1e-6):
        typer.echo(
            f"the undistorted picture does not hold all that camera '{name}' shows: --overscan "
            f"{np.ceil(needed * 1000.0) / 1000.0:g} would",
            err=True,
        )
    size = settings.without_distortion(overscan)
    typer.echo(
        f"distorted picture {settings.width} x {settings.height}, undistorted {size.width} x {size.height} pixels, "
        f"fov {size.fov:.5f} degrees"
    )


@app.command("read")
def read(
    stmap: Annotated[Path, typer.Argument(help="The ST map (.exr), without overscan.")],
    fov: Annotated[
        float,
        typer.Option(min=0.1, max=179.0, help="The camera's horizontal field of view without distortion, degrees."),
    ],
    undistorts: Annotated[
        bool, typer.Option("--undistorts/--distorts", help="What the map does with a picture.")
    ] = True,
) -> None:
    """Find a camera's `distortion` and `principal_point` from an ST map of another program.

    Example: lightdepth stmap read undistort.exr --fov 62
    """
    from lightdepth.calibration.stmap import fit_lens
    from lightdepth.errors import warn
    from lightdepth.images.stmap import read_stmap
    from lightdepth.parameters.calibration import DEFAULT

    film = read_stmap(stmap)
    lens = fit_lens(film, fov, undistorts)
    typer.echo(f"width = {film.shape[1]}")
    typer.echo(f"height = {film.shape[0]}")
    typer.echo(f"fov = {fov:g}")
    typer.echo("principal_point = [{:.6f}, {:.6f}]".format(*lens.principal_point))
    typer.echo("distortion = [{:.6f}, {:.6f}]".format(*lens.distortion))
    typer.echo(f"# misses the map by {lens.residual:.3f} pixels (root mean square), at most {lens.largest:.3f}")
    if lens.largest > DEFAULT.map_error:
        warn(
            f"{stmap}: k1 and k2 around one point miss this map by up to {lens.largest:.2f} pixels: it distorts in another "
            "way (fisheye, anamorphic, decentred), or the field of view or --distorts is wrong"
        )
