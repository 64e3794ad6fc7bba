"""`lightdepth capture`: photographs to one HDR panorama."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
from rich.table import Table

from lightdepth.errors import InputError, warn

if TYPE_CHECKING:
    from lightdepth.capture.fisheye import Circle
    from lightdepth.capture.shoot import MergeOptions, Shoot

app = typer.Typer(help="Photographs to one HDR panorama: merge brackets, stitch orientations.", no_args_is_help=True)

Output = Annotated[Path, typer.Option("-o", "--output", help="The EXR file to write; a PNG is written beside it.")]
Exposures = Annotated[
    Path | None, typer.Option(help="CSV with the columns file, time, aperture, iso, in place of EXIF data.")
]
Bracket = Annotated[int | None, typer.Option(min=1, help="Photographs in a bracket; found by default.")]
ResponseFile = Annotated[Path | None, typer.Option(help="Use the camera response that --save-response wrote.")]
SaveResponse = Annotated[Path | None, typer.Option(help="Write the camera response (JSON) for the next shoot.")]
Report = Annotated[Path | None, typer.Option(help="Write the figures as JSON.")]
Align = Annotated[bool, typer.Option("--align", help="Hand-held: move the exposures of a bracket onto each other.")]
Deghost = Annotated[bool, typer.Option("--deghost", help="Leave out what moved between the exposures.")]
CircleOption = Annotated[str | None, typer.Option(help="Fisheye circle: auto, or x,y,r in pixels; crops to it.")]


@app.command()
def merge(
    photographs: Annotated[list[Path], typer.Argument(help="Photographs of one view in several exposures.")],
    output: Output,
    exposures: Exposures = None,
    response: ResponseFile = None,
    save_response: SaveResponse = None,
    circle: CircleOption = None,
    align: Align = False,
    deghost: Deghost = False,
    report: Report = None,
) -> None:
    """Merge bracketed exposures to one HDR image.

    JPEG, PNG, TIFF and camera RAW; the exposure is read from EXIF data or a table, the camera's response is recovered
    from the photographs themselves (Debevec and Malik's method).

    Example: lightdepth capture merge IMG_69*.JPG -o office.exr --circle auto --save-response canon.json
    """
    from lightdepth.capture.exposure import read_exposures
    from lightdepth.capture.merging import merge as merge_bracket
    from lightdepth.capture.merging import shared_response
    from lightdepth.capture.output import check_output, write_image
    from lightdepth.capture.photograph import unlike_srgb
    from lightdepth.capture.report import merge_report, write_report
    from lightdepth.capture.response import load_response
    from lightdepth.capture.response import save_response as save

    check_output(output, save_response, report)
    colours = unlike_srgb(photographs)
    if colours:
        warn(colours)
    bracket = list(zip(photographs, read_exposures(photographs, exposures), strict=True))
    given = load_response(response) if response else None
    with shown_progress() as progress:
        found, source = (given, f"given ({response})") if given else shared_response([bracket], progress)
        merged = merge_bracket(bracket, found, _circle(circle), align, deghost, progress=progress)
    picture = write_image(output, merged.radiance, merged.seen)
    if save_response:
        save(save_response, found)
    amounts = [exposure.amount for _, exposure in bracket]
    figures = merge_report(merged, [path.name for path in photographs], amounts, source)
    if report:
        write_report(report, figures)
    _print_merge(figures, output, picture)


@app.command()
def stitch(
    images: Annotated[
        list[Path],
        typer.Argument(
            help="HDR images, or photographs, in several orientations; or a folder of (bracketed) photographs."
        ),
    ],
    output: Output,
    rig: Annotated[
        str | None,
        typer.Option(help='Known orientations: paper, four, ..., a file, or pairs "yaw,pitch yaw,pitch".'),
    ] = None,
    lens: Annotated[
        Literal["rectilinear", "fisheye", "equisolid", "stereographic"] | None,
        typer.Option(help="Kind of lens; fisheye (equidistant) where --circle is given, else rectilinear."),
    ] = None,
    fov: Annotated[
        float | None,
        typer.Option(min=5.0, max=300.0, help="Degrees across the picture or circle; refined. From EXIF by default."),
    ] = None,
    circle: CircleOption = None,
    exposures: Exposures = None,
    bracket: Bracket = None,
    response: ResponseFile = None,
    save_response: SaveResponse = None,
    align: Align = False,
    deghost: Deghost = False,
    width: Annotated[
        int | None, typer.Option(min=64, help="Width of the panorama; by default as fine as the images.")
    ] = None,
    blend: Annotated[
        Literal["feather", "enblend"],
        typer.Option(help="feather: most exact; enblend: seams that go round what moved (slow)."),
    ] = "feather",
    uncovered: Annotated[
        Literal["fill", "mark", "black"], typer.Option(help="What becomes of directions without a photograph.")
    ] = "fill",
    gains: Annotated[bool, typer.Option(help="Compensate for differences of exposure between the images.")] = True,
    dual: Annotated[
        bool, typer.Option("--dual", help="One picture (or bracket) of two fisheye circles side by side.")
    ] = False,
    circles: Annotated[
        str | None, typer.Option(help='With --dual, the circles as "x,y,r x,y,r" in pixels; found by default.')
    ] = None,
    turn: Annotated[
        float, typer.Option(help="With --dual, degrees by which the first circle is turned clockwise to stand upright.")
    ] = 0.0,
    distortion: Annotated[
        str | None, typer.Option(help="With --dual, the calibrated polynomial of the lenses: a,b,c as Hugin has it.")
    ] = None,
    report: Report = None,
) -> None:
    """Stitch images in several orientations to one equirectangular HDR panorama.

    Needs Hugin's command-line tools (Debian: hugin-tools, and enblend for --blend enblend). A folder of brackets is
    merged first, with one camera response for all.

    `--dual` stitches what cameras with two lenses back to back write (Theta, Insta360, Gear 360), without Hugin:
    lightdepth capture stitch R0010023.JPG -o pano.exr --dual

    Example: lightdepth capture stitch shoot/ -o lounge.exr --circle auto --fov 185 --rig paper
    """
    from lightdepth.capture.hugin import ALIGNMENT_TOOLS, require
    from lightdepth.capture.output import check_output, write_image
    from lightdepth.capture.report import stitch_report, write_report
    from lightdepth.capture.response import load_response
    from lightdepth.capture.response import save_response as save
    from lightdepth.capture.rig import parse_rig
    from lightdepth.capture.shoot import MergeOptions, read_shoot
    from lightdepth.capture.stitching import Options
    from lightdepth.capture.stitching import stitch as stitch_orientations

    check_output(output, save_response, report)
    if width is not None and width % 2:
        raise InputError(f"--width is {width}; a panorama is twice as wide as high, so it must be even")
    if not dual and (circles or distortion or turn):
        raise InputError("--circles, --turn and --distortion go with --dual")
    if dual:
        _stitch_dual(
            images,
            output,
            MergeOptions(
                response=load_response(response) if response else None,
                exposures=exposures,
                align=align,
                deghost=deghost,
            ),
            {
                "projection": lens or "fisheye",
                "fov": fov,
                "circles": _circles(circles),
                "distortion": _distortion(distortion),
                "turn": turn,
                "width": width,
                "uncovered": uncovered,
                "gains": gains,
            },
            report,
        )
        return
    require((*ALIGNMENT_TOOLS, *(("nona", "enblend") if blend == "enblend" else ())))
    merging = MergeOptions(
        circle=_circle(circle),
        response=load_response(response) if response else None,
        exposures=exposures,
        bracket=bracket,
        align=align,
        deghost=deghost,
        several=True,
    )
    with shown_progress() as progress:
        shoot = read_shoot(images, merging, progress)
        options = Options(
            projection=lens or ("fisheye" if circle else "rectilinear"),
            fov=fov or _fov(shoot, circle is not None),
            circular=circle is not None or not shoot.orientations[0].seen.all(),
            rig=parse_rig(rig, len(shoot.orientations)) if rig else None,
            width=width,
            blender=blend,
            uncovered=uncovered,
            gains=gains,
        )
        stitched = stitch_orientations(shoot.orientations, options, progress)
    picture = write_image(output, stitched.panorama.radiance, stitched.panorama.covered, panorama=True)
    if save_response and shoot.response:
        save(save_response, shoot.response)
    figures = stitch_report(shoot, stitched)
    if report:
        write_report(report, figures)
    _print_stitch(figures, output, picture)


def _stitch_dual(
    images: list[Path], output: Path, merging: MergeOptions, options: dict[str, Any], report: Path | None
) -> None:
    """Stitch one picture, or one bracket, of two circles."""
    from lightdepth.capture.dual_fisheye import DualOptions, stitch_dual
    from lightdepth.capture.output import write_image
    from lightdepth.capture.report import dual_report, write_report
    from lightdepth.capture.shoot import read_shoot

    if options["projection"] == "rectilinear":
        raise InputError(
            "--lens rectilinear: shows no circle; allowed with --dual are fisheye, equisolid, stereographic"
        )
    with shown_progress() as progress:
        shoot = read_shoot(images, merging, progress)
        if len(shoot.orientations) != 1:
            raise InputError(f"--dual takes one picture, or one bracket; there are {len(shoot.orientations)}")
        stitched = stitch_dual(shoot.orientations[0], DualOptions(**options), progress)
    picture = write_image(output, stitched.panorama.radiance, stitched.panorama.covered, panorama=True)
    figures = dual_report(shoot, stitched)
    if report:
        write_report(report, figures)
    console, summary = Console(), Table(show_header=False, box=None)
    for index, circle in enumerate(figures["circles"]):
        summary.add_row(f"circle {index + 1}", "{x:.1f},{y:.1f},{radius:.1f}".format(**circle))
    summary.add_row("lens", f"{figures['lens']['projection']}, {figures['lens']['fov']:.2f}° across a circle")
    summary.add_row("second lens", "yaw {yaw:.2f}°, pitch {pitch:.2f}°, roll {roll:.2f}°".format(**figures["second"]))
    summary.add_row(
        "seam", f"correlation {figures['agreement']:.3f}; differs by {figures['exposure']['disagreement']:.1%}"
    )
    summary.add_row("covered", f"{figures['covered']:.2%} of the sphere")
    summary.add_row("panorama", "{} x {}".format(*figures["size"]))
    console.print(summary)
    for warning in figures["warnings"]:
        console.print(f"[yellow]warning:[/] {warning}", soft_wrap=True)
    console.print(f"{output} and {picture} written", soft_wrap=True)


def _circles(text: str | None) -> tuple[Circle, Circle] | None:
    from lightdepth.capture.fisheye import parse_circle

    if text is None:
        return None
    parts = text.split()
    if len(parts) != 2:
        raise InputError(f"--circles is '{text}'; allowed are two circles, \"x,y,r x,y,r\", in pixels")
    return parse_circle(parts[0]), parse_circle(parts[1])


def _distortion(text: str | None) -> tuple[float, float, float]:
    try:
        a, b, c = (float(part) for part in (text or "0,0,0").split(","))
    except ValueError:
        raise InputError(f"--distortion is '{text}'; allowed are three numbers a,b,c") from None
    if not max(abs(a), abs(b), abs(c)) < 1.0:
        raise InputError(f"--distortion is '{text}'; lenses have values between -1 and 1")
    return a, b, c


@contextmanager
def shown_progress() -> Iterator[Callable[[str, int, int], None]]:
    """A bar on a terminal; elsewhere, as in a log, a line for every step and every tenth of one."""
    console = Console(stderr=True)
    if not console.is_terminal:
        yield _log_lines(console)
        return
    columns = (TextColumn("{task.description:28}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("reading")
        yield lambda what, done, total: bar.update(task, description=what, completed=done, total=total)


def _log_lines(console: Console) -> Callable[[str, int, int], None]:
    written: tuple[str, int] | None = None

    def progress(what: str, done: int, total: int) -> None:
        nonlocal written
        now = (what, 10 * done // max(total, 1))
        if now != written:
            console.print(f"{what}: {done} of {total}", highlight=False, markup=False)
            written = now

    return progress


def _circle(text: str | None) -> Circle | str | None:
    from lightdepth.capture.fisheye import parse_circle

    return text if text in (None, "auto") else parse_circle(text)


def _fov(shoot: Shoot, circular: bool) -> float:
    """Field of view in degrees from the EXIF data, or what circular fisheyes have."""
    from lightdepth.capture.lens import horizontal_fov

    if circular:
        return 180.0
    height, width = shoot.orientations[0].radiance.shape[:2]
    focal_length = shoot.exposure.focal_length_35mm if shoot.exposure else None
    if focal_length is None:
        raise InputError(
            f"{shoot.orientations[0].name}: the field of view is not in the EXIF data; state it as --fov DEGREES "
            "(across the picture's width), and the kind of lens as --lens"
        )
    return horizontal_fov(focal_length, width, height)


def _print_merge(figures: dict[str, Any], output: Path, picture: Path) -> None:
    table = Table(show_header=False, box=None)
    table.add_row("photographs", f"{len(figures['photographs'])} over {figures['exposure_range_stops']:.1f} stops")
    table.add_row("camera response", figures["response"])
    if figures["circle"]:
        table.add_row("fisheye circle", "{x:.1f},{y:.1f},{radius:.1f}".format(**figures["circle"]))
    clipped, black = figures["clipped_in_every_exposure"], figures["black_in_every_exposure"]
    table.add_row("clipped in every exposure", f"{clipped} pixels ({figures['clipped_share']:.2%})")
    table.add_row("black in every exposure", f"{black} pixels ({figures['black_share']:.2%})")
    if figures["ghost_share"]:
        table.add_row("something moved at", f"{figures['ghost_share']:.2%}")
    table.add_row("radiance spans", f"{figures['orders_of_magnitude']:.1f} orders of magnitude")
    console = Console()
    console.print(table)
    if clipped:
        console.print("[yellow]Clipped pixels are lower bounds: add a shorter exposure where lamps matter.[/]")
    console.print(f"{output} and {picture} written", soft_wrap=True)


def _print_stitch(figures: dict[str, Any], output: Path, picture: Path) -> None:
    console = Console()
    table = Table(title="Images")
    for heading in ("image", "yaw", "pitch", "roll", "points", "error", "exposure", "unreliable"):
        table.add_column(heading, justify="left" if heading == "image" else "right")
    for image in figures["images"]:
        error = image["control_point_error_degrees"]
        table.add_row(
            image["name"],
            *(f"{image[angle]:.1f}" for angle in ("yaw", "pitch", "roll")),
            str(image["control_points"]),
            "-" if error is None else f"{error:.2f}°",
            f"{image['exposure_correction_stops']:+.2f} EV",
            f"{image['unreliable_share']:.2%}",
        )
    console.print(table)
    points, coverage, exposure = figures["control_points"], figures["coverage"], figures["exposure"]
    lens = figures["lens"]
    summary = Table(show_header=False, box=None)
    if points["kept"]:
        summary.add_row(
            "control points",
            f"{points['kept']} of {points['found']} kept; error {points['median_error_degrees']:.2f}° median, "
            f"{points['p95_error_degrees']:.2f}° (95 %), {points['largest_error_degrees']:.2f}° largest",
        )
    summary.add_row(
        "lens", f"{lens['projection']}, {lens['fov']:.2f}°, {exposure['light_at_edge']:.0%} light at the edge"
    )
    summary.add_row(
        "overlaps differ by", f"{exposure['disagreement']:.1%} (as photographed {exposure['disagreement_before']:.1%})"
    )
    summary.add_row(
        "covered", f"{coverage['share']:.2%} of the sphere; missing below {coverage['uncovered_below']:.2%}"
    )
    summary.add_row("panorama", "{} x {}".format(*figures["size"]))
    console.print(summary)
    for warning in figures["warnings"]:
        console.print(f"[yellow]warning:[/] {warning}", soft_wrap=True)
    console.print(f"{output} and {picture} written", soft_wrap=True)
