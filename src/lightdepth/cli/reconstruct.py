"""`lightdepth reconstruct`: meshes of the real place, and where its lamps are."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.progress import Progress, TaskID
    from rich.table import Table

    from lightdepth.reconstruction.depth_unit import Estimate
    from lightdepth.reconstruction.lights import Source
    from lightdepth.reconstruction.posed_panorama import PosedPanorama
    from lightdepth.reconstruction.result import Reconstruction

app = typer.Typer(no_args_is_help=True)


class Up(StrEnum):
    """The axis of a file that points up."""

    Y = "y"
    Z = "z"


Output = Annotated[Path, typer.Option("-o", "--output", help="The folder for the meshes (PLY).")]
Write = Annotated[
    Path | None,
    typer.Option("--write", help=r"Put the [\[real]] tables into this scene file (TOML), or begin it; the rest stays."),
]
Picture = Annotated[
    Path | None, typer.Option("--picture", help="A check picture (PNG): the surfaces' edges over the panorama.")
]
Json = Annotated[bool, typer.Option("--json", help="Print the report as JSON.")]
Position = Annotated[
    str | None, typer.Option("--position", metavar="X,Y,Z", help="Capture point, world, metres; else the scene file's.")
]
Rotation = Annotated[
    str | None,
    typer.Option(
        "--rotation", metavar="X,Y,Z", help="Light space to world, XYZ Euler, degrees; else the scene file's."
    ),
]
Panorama = Annotated[
    Path | None,
    typer.Option("--panorama", help="The panorama, or the scene file (.toml) that gives it and its pose."),
]
FloorTolerance = Annotated[
    float, typer.Option(min=0.001, help="Farthest that a floor point lies from its plane, metres.")
]
NoFloor = Annotated[bool, typer.Option("--no-floor", help="Look for no floor; everything becomes environment.")]


@app.command()
def layout(
    source: Annotated[Path, typer.Argument(metavar="PANORAMA|SCENE", help="Panorama or scene file (.toml).")],
    output: Output,
    floor: Annotated[
        str | None, typer.Option("--floor", metavar='"X,Y X,Y ..."', help="The floor's corners, in order around it.")
    ] = None,
    angles: Annotated[
        bool,
        typer.Option("--angles", help="Clicks are degrees right of the centre and above the horizon, not pixels."),
    ] = False,
    camera_height: Annotated[
        float | None,
        typer.Option(min=0.01, help="Of the camera above the floor, metres; else its z in the scene file."),
    ] = None,
    ceiling: Annotated[float | None, typer.Option(min=0.01, help="Height above the floor, metres.")] = None,
    ceiling_corner: Annotated[
        str | None, typer.Option(metavar="X,Y", help="Or one clicked ceiling corner, vertically above a floor corner.")
    ] = None,
    box: Annotated[
        list[str] | None,
        typer.Option(
            metavar='"NAME: X,Y X,Y X,Y height=H"',
            help="Furniture by the corners of its foot (three make a parallelogram). 'top=support': its top receives "
            "shadows. 'clicked=top': the clicks are its top's corners. Repeatable.",
        ),
    ] = None,
    table: Annotated[
        list[str] | None,
        typer.Option(
            metavar='"NAME: X,Y X,Y X,Y height=H"',
            help="A table top by its own corners; it receives shadows. Repeatable.",
        ),
    ] = None,
    panel: Annotated[
        list[str] | None,
        typer.Option(
            metavar='"NAME: X,Y X,Y height=H"', help="An upright sheet (screen, curtain) by its foot line. Repeatable."
        ),
    ] = None,
    slope: Annotated[
        list[str] | None,
        typer.Option(
            metavar='"X,Y X,Y X,Y ..."',
            help="A sloped ceiling by three points or more, not in one line, where it meets walls. The ceiling is the "
            "lowest of the slopes and of --ceiling. Repeatable.",
        ),
    ] = None,
    lamp: Annotated[
        list[str] | None,
        typer.Option(
            metavar='"NAME: at=X,Y from=X,Y rim=X,Y"',
            help="A hanging lamp by the pixels of its middle, of where it hangs from the ceiling, and of its rim; or "
            "'height=H' of its middle instead of 'from', 'radius=R' or 'size=X,Y,Z' (a box) instead of 'rim'. Repeatable.",
        ),
    ] = None,
    outdoor: Annotated[
        bool, typer.Option("--outdoor", help="No room: a ground disk that receives shadows; the sky is far away.")
    ] = False,
    radius: Annotated[float, typer.Option(min=0.1, help="Of the ground disk, metres.")] = 50.0,
    position: Position = None,
    rotation: Rotation = None,
    write: Write = None,
    picture: Picture = None,
    as_json: Json = False,
) -> None:
    """Meshes from a floor plan clicked on the panorama, the ceiling's height, and boxes for furniture.

    Floor, tables and chosen tops receive shadows (support), the rest is environment. Pixels count from the picture's
    upper left corner, x to the right, y down.

    Example: lightdepth reconstruct layout lounge.exr --floor "212,390 498,371 733,402 981,455" --camera-height 1.6
    --ceiling 2.6 --table "desk: 610,330 660,332 655,350 height=0.74" -o meshes --write lounge.toml --picture check.png
    """
    from lightdepth.errors import InputError
    from lightdepth.reconstruction.layout import Clicked, surfaces_from_layout
    from lightdepth.reconstruction.posed_panorama import parse_three, read_posed_panorama
    from lightdepth.reconstruction.result import closed

    if outdoor == (floor is not None):
        raise InputError("give either --floor (a room) or --outdoor (a ground disk)")
    if ceiling is not None and ceiling_corner is not None:
        raise InputError("give either --ceiling (metres) or --ceiling-corner (one click)")
    if not outdoor and ceiling is None and ceiling_corner is None and not slope:
        raise InputError("give --ceiling (metres), --ceiling-corner (one click), or the ceiling's slopes by --slope")
    place = read_posed_panorama(
        source, parse_three(position, "--position"), parse_three(rotation, "--rotation"), camera_height
    )
    _announce(write)
    if camera_height is not None and abs(place.pose.position[2] - camera_height) > 1e-6:
        floor_level = place.pose.position[2] - camera_height
        typer.echo(
            f"warning: the pose puts the capture point at height {place.pose.position[2]:g} m, --camera-height says "
            f"{camera_height:g} m: the floor comes to lie at height {floor_level:.3g} m instead of 0",
            err=True,
        )
    surfaces = surfaces_from_layout(
        Clicked(floor, ceiling_corner, box or [], table or [], panel or [], slope or [], lamp or []),
        place,
        camera_height=camera_height,
        ceiling=ceiling,
        ground_radius=radius if outdoor else None,
        angles=angles,
    )
    _finish(closed(surfaces, place, outdoor), place, output, write, picture, as_json)


@app.command()
def from_depth(
    depth: Annotated[Path, typer.Argument(help="Equirectangular distances: .exr (channel Z), .png, .npy.")],
    output: Output,
    panorama: Panorama = None,
    estimated: Annotated[
        bool,
        typer.Option(
            "--estimated",
            help="A network made it: find its unit by the floor, and make floor, walls and ceiling plane.",
        ),
    ] = False,
    camera_height: Annotated[
        float | None,
        typer.Option(
            min=0.01, help="With --estimated: of the camera above the floor, metres; else its z in the scene file."
        ),
    ] = None,
    scale: Annotated[
        float | None, typer.Option(min=1e-9, help="Metres per unit of the file; whole numbers must have it.")
    ] = None,
    channel: Annotated[str | None, typer.Option(help="Of an OpenEXR file; found by default.")] = None,
    kind: Annotated[
        Literal["ray", "z", "disparity"] | None,
        typer.Option(
            help="Distances along the ray (the default), along the viewing axis, or reciprocal ones. With --estimated it "
            "is found."
        ),
    ] = None,
    inverse: Annotated[bool, typer.Option("--inverse", help="The same as --kind disparity.")] = False,
    shift: Annotated[
        bool | None,
        typer.Option(
            "--shift/--no-shift", help="With --estimated: whether there is an unknown shift; found by default."
        ),
    ] = None,
    sky: Annotated[bool, typer.Option("--sky", help="What was not measured is sky, not a hole.")] = False,
    sky_beyond: Annotated[float | None, typer.Option(min=0.0, help="Distances from here on are sky, metres.")] = None,
    max_width: Annotated[int, typer.Option(min=64, max=4096, help="Wider images are reduced to this.")] = 1024,
    faces: Annotated[int, typer.Option(min=1000, help="Most triangles of all surfaces together.")] = 50_000,
    floor_tolerance: FloorTolerance = 0.03,
    no_floor: NoFloor = False,
    position: Position = None,
    rotation: Rotation = None,
    write: Write = None,
    picture: Picture = None,
    as_json: Json = False,
) -> None:
    """Meshes from a measured or estimated depth image with the panorama's pose.

    Noise is smoothed, holes are closed by going on with the surfaces around them, jumps in depth are cut and closed
    behind. The floor is found and receives shadows. Infinite distances are sky.

    Example: lightdepth reconstruct from-depth depth.png --scale 0.001 --panorama lounge.toml -o meshes
    --write lounge.toml --picture check.png

    A network's depth: lightdepth reconstruct from-depth estimate.png --estimated --panorama lounge.toml -o meshes
    --write lounge.toml --picture check.png
    """
    from typing import cast

    from lightdepth.errors import InputError
    from lightdepth.images.distances import read_estimate
    from lightdepth.reconstruction.depth_image import read_depth_image
    from lightdepth.reconstruction.floor import warn_of_height
    from lightdepth.reconstruction.from_depth import surfaces_from_depth
    from lightdepth.reconstruction.from_estimate import surfaces_from_estimate
    from lightdepth.reconstruction.posed_panorama import check_same_size, parse_three, read_posed_panorama
    from lightdepth.reconstruction.result import closed

    if inverse and kind not in (None, "disparity"):
        raise InputError(f"--inverse means --kind disparity, which contradicts --kind {kind}")
    kind = "disparity" if inverse else kind
    if estimated:
        _check_estimated(kind, scale, no_floor)
    elif shift is not None or camera_height is not None:
        raise InputError("--shift and --camera-height find the unit of an estimate: give --estimated as well")
    place = read_posed_panorama(
        panorama, parse_three(position, "--position"), parse_three(rotation, "--rotation"), camera_height
    )
    _announce(write)
    if estimated:
        estimate = read_estimate(depth, channel)
    else:
        image = read_depth_image(depth, scale, sky, kind, sky_beyond, channel)
    check_same_size(depth, (estimate if estimated else image.depth).shape, place)
    with _progress() as progress:
        task = progress.add_task("Meshing the depth", total=1.0)

        def report(share: float) -> None:
            progress.update(task, completed=share)

        unit: dict[str, object] | None = None
        if estimated:
            found = surfaces_from_estimate(
                estimate,
                place.pose,
                float(place.pose.position[2]) if camera_height is None else camera_height,
                depth,
                kind=cast("Estimate | None", kind),
                shift=shift,
                sky=sky,
                sky_beyond=sky_beyond,
                max_width=max_width,
                most_faces=faces,
                progress=report,
            )
            measured, unit = found.measured, found.as_dict()
        else:
            measured = surfaces_from_depth(
                image, place.pose, max_width, None if no_floor else floor_tolerance, report, faces
            )
            warn_of_height(depth, measured.floor, place.pose)
        progress.add_task("Measuring the coverage", total=None)
        no_sky = measured.sky is None
        result = closed(
            measured.surfaces,
            place,
            False if measured.sky is None else measured.sky,
            measured.floor,
            open_from_elsewhere=no_sky,
        )
    _finish(result, place, output, write, picture, as_json, unit)


def _check_estimated(kind: str | None, scale: float | None, no_floor: bool) -> None:
    from lightdepth.errors import InputError

    if scale is not None:
        raise InputError("--estimated finds the scale by the floor: leave out --scale, or --estimated if it is known")
    if no_floor:
        raise InputError("--estimated finds the scale by the floor: leave out --no-floor")
    if kind == "z":
        raise InputError("--estimated takes distances along the rays (ray) or disparity, not z")


@app.command()
def from_points(
    points: Annotated[Path, typer.Argument(help="Point cloud: .ply, .las, .laz, .e57, .xyz, .txt, .csv or .pts.")],
    output: Output,
    panorama: Panorama = None,
    detail: Annotated[float, typer.Option(min=0.001, help="Size of the finest details, metres.")] = 0.04,
    faces: Annotated[int, typer.Option(min=1000, help="Most triangles of the surface.")] = 300_000,
    scale: Annotated[float, typer.Option(min=1e-9, help="Metres per unit of the file.")] = 1.0,
    up: Annotated[Up, typer.Option(help="The file's axis that points up.")] = Up.Z,
    origin: Annotated[
        str, typer.Option(metavar="X,Y,Z", help="The point in the file's coordinates that is the world's origin.")
    ] = "0,0,0",
    sky: Annotated[bool, typer.Option("--sky", help="What the points leave open is sky, not closed.")] = False,
    floor_tolerance: FloorTolerance = 0.03,
    no_floor: NoFloor = False,
    position: Position = None,
    rotation: Rotation = None,
    write: Write = None,
    picture: Picture = None,
    as_json: Json = False,
) -> None:
    """A closed mesh from a scanner's or photogrammetry's points, by screened Poisson reconstruction.

    Outliers are dropped and noise is smoothed first. The floor is found and receives shadows. The points must be in the
    world of the pose; --scale, --up and --origin bring them there.

    Example: lightdepth reconstruct from-points scan.e57 --panorama lounge.toml -o meshes --write lounge.toml
    --picture check.png
    """
    from lightdepth.packages import require_package
    from lightdepth.reconstruction.floor import warn_of_height
    from lightdepth.reconstruction.from_points import surfaces_from_points
    from lightdepth.reconstruction.point_cloud import read_points
    from lightdepth.reconstruction.posed_panorama import parse_three, read_posed_panorama
    from lightdepth.reconstruction.result import closed

    place = read_posed_panorama(panorama, parse_three(position, "--position"), parse_three(rotation, "--rotation"))
    _announce(write)
    require_package("pymeshlab", "points")  # Not first found out when all points are read and cleaned.
    cloud = read_points(points, scale, up.value, parse_three(origin, "--origin") or (0.0, 0.0, 0.0))
    with _progress() as progress:
        tasks: dict[str, TaskID] = {}

        def report(step: str, share: float) -> None:
            if step not in tasks:
                tasks[step] = progress.add_task(step, total=1.0 if share > 0.0 else None)
            progress.update(tasks[step], total=1.0 if share > 0.0 else None, completed=share)

        measured = surfaces_from_points(
            cloud, place.pose, detail, faces, None if no_floor else floor_tolerance, keep_open=sky, progress=report
        )
        warn_of_height(points, measured.floor, place.pose)
        result = closed(measured.surfaces, place, sky, measured.floor)
    _finish(result, place, output, write, picture, as_json)


@app.command()
def lights(
    source: Annotated[Path, typer.Argument(metavar="MAP|SCENE", help="Light-depth map (.exr) or scene file (.toml).")],
    count: Annotated[int, typer.Option(min=1, help="How many, at most.")] = 10,
    table: Annotated[Path | None, typer.Option("--table", help="Write them as a table (.csv or .json).")] = None,
    picture: Annotated[Path | None, typer.Option("--picture", help="Draw them over the panorama (PNG).")] = None,
    as_json: Json = False,
) -> None:
    """The strongest sources of light: where they are in metres, their size and share of the light.

    This is how you check that the lamps are where the lamps are. A source in the sky has a direction (azimuth clockwise
    of the world's y axis, elevation above the horizon) and a size in degrees.

    Example: lightdepth reconstruct lights lounge.toml --picture lights.png --table lights.csv
    """
    import json

    from rich.console import Console

    from lightdepth.errors import InputError
    from lightdepth.images.png import write_png
    from lightdepth.images.writing import check_writable
    from lightdepth.lightmap.building import build_light_depth_map
    from lightdepth.lightmap.file import read_light_depth_map
    from lightdepth.reconstruction.lights import strongest_sources
    from lightdepth.reconstruction.lights_picture import draw_sources
    from lightdepth.scene.load import load_scene
    from lightdepth.tables import write_table

    for path in (table, picture):
        if path is not None:
            check_writable(path)
    if source.suffix.lower() == ".toml":
        with _progress() as progress:
            task = progress.add_task("Distances", total=1.0)
            light_depth_map = build_light_depth_map(
                load_scene(source), lambda share: progress.update(task, completed=share)
            )
    elif source.suffix.lower() == ".exr":
        light_depth_map = read_light_depth_map(source)
    else:
        raise InputError(f"{source}: '{source.suffix}' is neither a light-depth map (.exr) nor a scene file (.toml)")
    sources = strongest_sources(light_depth_map, count)
    rows = [item.as_dict() for item in sources]
    if table is not None:
        write_table(table, rows)
    if picture is not None:
        write_png(picture, draw_sources(light_depth_map.radiance, sources))
    if as_json:
        typer.echo(json.dumps({"lights": rows}, indent=2))
    else:
        Console().print(_lights_table(sources))


def _lights_table(sources: Sequence[Source]) -> Table:
    from rich.table import Table

    shown = Table("No.", "x [m]", "y [m]", "z [m]", "distance [m]", "size", "share", "radiance")
    for column in shown.columns:
        column.justify = "right"
    for number, item in enumerate(sources, start=1):
        if item.position is None:
            where, unit = ["sky", f"az {item.azimuth:.1f}", f"el {item.elevation:.1f}"], "deg"
            distance = "-"
        else:
            where, unit = [f"{x:.2f}" for x in item.position], "m"
            distance = f"{item.distance:.2f}"
        size = f"{item.size[0]:.2f} x {item.size[1]:.2f} {unit}"
        shown.add_row(str(number), *where, distance, size, f"{100 * item.share:.1f} %", f"{item.luminance:.4g}")
    return shown


def _announce(scene: Path | None) -> None:
    """Say before the work that a scene file will be created, as a wrong name would."""
    if scene is not None and not scene.exists():
        typer.echo(f"{scene} does not exist and will be created with this panorama", err=True)


def _progress() -> Progress:
    from rich.console import Console
    from rich.progress import Progress

    return Progress(console=Console(stderr=True), transient=True)


def _finish(
    result: Reconstruction,
    place: PosedPanorama,
    folder: Path,
    scene: Path | None,
    picture: Path | None,
    as_json: bool,
    estimate: dict[str, object] | None = None,
) -> None:
    """Write what was reconstructed and report it."""
    import json

    from rich.console import Console
    from rich.table import Table

    from lightdepth.reconstruction.result import save

    save(result, place, folder, scene, picture)
    for note in place.notes:
        Console(stderr=True, soft_wrap=True, highlight=False).print(f"warning: {note}", style="yellow", markup=False)
    report = result.as_dict(folder)
    if estimate is not None:
        report["estimate"] = estimate
    if as_json:
        typer.echo(json.dumps(report, indent=2))
        return
    console = Console(soft_wrap=True, highlight=False)
    table = Table("surface", "role", "faces", "area", "mesh")
    for entry in report["surfaces"]:
        table.add_row(entry["name"], entry["role"], str(entry["faces"]), f"{entry['area']:.1f} m2", entry["mesh"])
    console.print(table)
    if estimate is not None:
        console.print(f"estimate: {estimate['words']}")
    if result.floor is not None:
        console.print(f"floor at height {result.floor.offset:.3f} m, tilted {result.floor.tilt:.2f} degrees")
    before, after = result.before, result.after
    console.print(f"of all directions {100 * before.hit:.2f} % meet a surface, {100 * before.sky:.2f} % are sky")
    if before.hole is not None:
        right, up = before.hole
        console.print(
            f"open: {100 * before.open:.3g} %, most of it around {right:.0f} degrees right and {up:.0f} degrees up "
            f"({100 * before.hole_share:.3g} %)"
        )
    if after is not before:
        console.print(
            f"closed by the shell: {100 * (after.hit - before.hit):.3g} %, still open: {100 * after.open:.3g} %"
        )
    if scene is not None:
        console.print(f"{scene}: [[real]] tables written", markup=False)
    if picture is not None:
        console.print(f"{picture}: check that the lines lie on the place's edges")
