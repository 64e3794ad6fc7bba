"""`lightdepth calibrate`: the panorama's pose in the world."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from lightdepth.cli.calibrate_second import second
from lightdepth.cli.calibrate_view import view
from lightdepth.cli.calibration_report import numbers, print_result, rounded

if TYPE_CHECKING:
    from lightdepth.calibration.room_frame import RoomFrame
    from lightdepth.calibration.solve import Calibration


class _PanoramaByDefault(TyperGroup):
    """Takes what is not the name of a command for the panorama's."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Parse, with the default command's name put in where none is given."""
        return super().parse_args(ctx, args if args and args[0] in self.commands else ["panorama", *args])


app = typer.Typer(cls=_PanoramaByDefault)
app.command("view")(view)
app.command("second")(second)


@app.command("panorama")
def calibrate(
    panorama: Annotated[Path, typer.Argument(help="The panorama: 360 x 180 degrees, .exr .hdr .jpg .png .tif.")],
    rectangle: Annotated[
        str | None,
        typer.Option(
            help='Four corners of a rectangle on the floor, counter-clockwise seen from above: "x,y x,y x,y x,y". '
            "Its first side becomes the world's x axis.",
            metavar="POINTS",
        ),
    ] = None,
    width: Annotated[
        float | None, typer.Option(help="Length of the rectangle's side from corner 1 to 2, metres.", metavar="M")
    ] = None,
    length: Annotated[
        float | None, typer.Option(help="Length of the rectangle's side from corner 2 to 3, metres.", metavar="M")
    ] = None,
    camera_height: Annotated[
        float | None, typer.Option(help="Height of the camera's lens above the floor, metres.", metavar="M")
    ] = None,
    vertical: Annotated[
        list[str] | None,
        typer.Option(
            help='Two points of a plumb edge, far apart: "x,y x,y". Repeat it; three or more where no other option '
            "gives the level.",
            metavar="POINTS",
        ),
    ] = None,
    scale_from: Annotated[
        str | None,
        typer.Option(
            help='Instead of the height, a known length: "x,y x,y = 2.0 m", from the foot of a plumb edge (a door) to its '
            "top, or between two points on the floor.",
            metavar="POINTS=M",
        ),
    ] = None,
    heading: Annotated[
        str | None,
        typer.Option(help='A point in the direction of the world\'s y axis: "x,y".', metavar="POINT"),
    ] = None,
    bearing: Annotated[
        float, typer.Option(help="Degrees by which --heading lies clockwise of the y axis, seen from above.")
    ] = 0.0,
    auto: Annotated[
        bool, typer.Option("--auto", help="Level, and align with the walls, from straight edges found in the panorama.")
    ] = False,
    snap: Annotated[
        bool,
        typer.Option(
            "--snap", help="Move the rectangle's corners to where the edges seen along its sides meet, near the clicks."
        ),
    ] = False,
    origin: Annotated[
        str,
        typer.Option(
            help="The world's origin on the floor: the rectangle's first corner, its centre, or under the camera.",
            metavar="corner|centre|camera",
        ),
    ] = "corner",
    angles: Annotated[
        bool,
        typer.Option(
            "--angles",
            help="Points are degrees right of the panorama's centre column and above its middle row, not pixels "
            "(x to the right, y down, 0,0 the upper left corner of the picture).",
        ),
    ] = False,
    click_error: Annotated[
        float | None,
        typer.Option(
            help="How far clicks may be off (standard deviation), in pixels (default 1), with --angles in "
            "degrees (default 0.2)."
        ),
    ] = None,
    write: Annotated[
        Path | None,
        typer.Option(help="Scene file to write the pose into, or to begin; the rest stays.", metavar="SCENE"),
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option(help="Check picture (.png): the world's grid and axes drawn over the panorama.", metavar="PNG"),
    ] = None,
    json_output: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Find a panorama's pose in the world: rotation, capture position and scale.

    Give what you know, several things at once if you can: a rectangle on the
    floor with one known length, plumb edges, a heading, or --auto for a room.
    With the camera's height (or --scale-from) alone, the panorama is taken as level.
    Look at the check picture before you trust the result.

    With a rug of 2 by 3 metres, clicked at its corners:

    lightdepth calibrate lounge.exr --width 2 --length 3
    --rectangle "310,700 705,702 640,610 400,609"
    --write lounge.toml --picture check.png

    Without clicks:

    lightdepth calibrate lounge.exr --auto --camera-height 1.6 --picture check.png

    The camera of an ordinary photograph: lightdepth calibrate view --help
    A second panorama of the same place: lightdepth calibrate second --help
    """
    import math
    from dataclasses import replace

    import numpy as np

    from lightdepth.calibration.arcs import Arcs
    from lightdepth.calibration.check_picture import draw_check_picture
    from lightdepth.calibration.clicks import read_clicks
    from lightdepth.calibration.rectangle import FloorRectangle
    from lightdepth.calibration.scale import height_from_length, read_known_length
    from lightdepth.calibration.scene_file import write_pose
    from lightdepth.calibration.snapping import snap_rectangle
    from lightdepth.calibration.solve import Cues, taken_as_level
    from lightdepth.calibration.solve import calibrate as solve
    from lightdepth.errors import InputError
    from lightdepth.images.panorama_file import read_panorama
    from lightdepth.images.png import write_png
    from lightdepth.images.validation import validate_panorama
    from lightdepth.images.writing import check_writable
    from lightdepth.parameters.calibration import DEFAULT

    if rectangle is None and (width is not None or length is not None):
        raise InputError("--width and --length are those of a floor rectangle: give --rectangle as well")
    if rectangle is None and snap:
        raise InputError("--snap moves the corners of a floor rectangle: give --rectangle as well")
    if not math.isfinite(bearing):
        raise InputError(f"--bearing {bearing}: a finite number of degrees is needed")
    if picture is not None:
        if picture.suffix.lower() != ".png":
            raise InputError(f"--picture {picture}: the check picture must be a .png file")
        check_writable(picture)
    if scale_from is not None and (camera_height is not None or rectangle is not None):
        raise InputError("--scale-from gives the camera's height: leave out --camera-height and --rectangle")
    if write is not None:
        check_writable(write)
        if not write.exists():
            typer.echo(f"{write} does not exist and will be created with this panorama", err=True)

    image = read_panorama(panorama)
    radiance = validate_panorama(image.radiance, panorama, repair=True)
    size = None if angles else (radiance.shape[0], radiance.shape[1])
    corners = read_clicks(rectangle, size, "--rectangle", 4) if rectangle is not None else None
    verticals = [read_clicks(text, size, "--vertical", 2) for text in vertical or []]
    toward = read_clicks(heading, size, "--heading", 1)[0] if heading is not None else None
    if click_error is None:
        click_error = 0.2 if angles else 1.0
    known = read_known_length(scale_from, size) if scale_from is not None else None
    click_degrees = click_error * (1.0 if angles else 360.0 / radiance.shape[1])
    floor = FloorRectangle(corners, width, length) if corners is not None else None
    unmoved: list[str] = []
    if snap and floor is not None:
        floor, unmoved = snap_rectangle(radiance, floor, camera_height, click_degrees)
    room = _find_room(radiance, show_progress=not json_output) if auto else None
    alone = floor is None and room is None and not verticals
    if alone and (camera_height is not None or known is not None):
        result = taken_as_level(image.rotation, camera_height, toward, bearing)
    else:
        result = solve(
            Cues(
                rectangle=floor,
                verticals=Arcs(verticals) if verticals else None,
                heading=toward,
                bearing=bearing,
                room=room,
                camera_height=camera_height,
                click_error=click_degrees,
            ),
            origin,
        )
    if known is not None:
        result = replace(result, position=np.array([0.0, 0.0, height_from_length(known, result.rotation)]))
    report = _report(result)
    report["warnings"] += unmoved + list(image.notes)
    if write is not None:
        sure = not (
            room is not None and room.confidence < DEFAULT.sure_directions and floor is None and len(verticals) < 3
        )
        named = write_pose(write, report["rotation"] if sure else None, report["position"], panorama)
        if not sure:
            numbers = ", ".join(f"{angle:g}" for angle in report["rotation"])
            report["warnings"].append(
                f"{write}: the rotation is too uncertain and was not written; where the check picture is right, write "
                f"`rotation = [{numbers}]` yourself"
            )
        if named.resolve() != panorama.resolve():
            report["warnings"].append(f"{write}: its panorama is {named}, not {panorama}")
    if picture is not None:
        clicks = [points.reshape(-1, 3) for points in (corners, *verticals, toward) if points is not None]
        write_png(picture, draw_check_picture(radiance, result, room, clicks))
    print_result(report, _rows(report), json_output)


def _find_room(radiance: Any, show_progress: bool) -> RoomFrame:
    from rich.console import Console
    from rich.progress import Progress

    from lightdepth.calibration.line_detection import detect_arcs
    from lightdepth.calibration.room_frame import find_room_frame

    with Progress(console=Console(stderr=True), transient=True, disable=not show_progress) as bar:
        edges = bar.add_task("finding straight edges", total=1.0)
        arcs = detect_arcs(radiance, lambda share: bar.update(edges, completed=share))
        frame = bar.add_task("finding the room's directions", total=1.0)
        return find_room_frame(arcs, lambda share: bar.update(frame, completed=share))


def _report(result: Calibration) -> dict[str, Any]:
    """The result as plain numbers: what ``--json`` prints."""
    from lightdepth.directions import rotation_to_euler

    def one(value: float | None) -> float | None:
        return None if value is None else rounded([value])[0]

    return {
        "rotation": rounded(rotation_to_euler(result.rotation)),
        "position": None if result.position is None else rounded(result.position),
        "residual": one(result.residual),
        "residuals": {cue: one(value) for cue, value in result.residuals.items()},
        "expected_error": one(result.expected_error),
        "tilt": one(result.tilt),
        "rectangle_size": rounded(result.rectangle_size) if result.rectangle_size else None,
        "confidence": one(result.confidence),
        "warnings": list(result.warnings),
    }


def _rows(report: dict[str, Any]) -> Iterator[tuple[str, str, str]]:
    """The result as the table shows it."""
    yield "rotation", numbers(report["rotation"]), "degrees, XYZ Euler, light to world"
    if report["position"]:
        yield "position", numbers(report["position"]), "metres, world"
    else:
        yield "position", "unknown", "give --camera-height or a floor rectangle"
    if report["rectangle_size"]:
        yield "rectangle", numbers(report["rectangle_size"]), "metres, width and length"
    yield "tilt", f"{report['tilt']:.2f}", "degrees from the panorama's zenith"
    cues = ", ".join(f"{name} {value:.3f}" for name, value in report["residuals"].items())
    if cues:
        yield "residual", f"{report['residual']:.3f}", f"degrees ({cues})"
    if report["expected_error"] is None:
        yield "expected error", "unknown", "the rotation was not measured"
    else:
        yield "expected error", f"{report['expected_error']:.2f}", "degrees, one standard deviation"
    if report["confidence"] is not None:
        yield "confidence", f"{report['confidence']:.2f}", "of the automatic directions, 0 to 1"
