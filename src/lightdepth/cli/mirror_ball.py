"""`lightdepth capture mirror-ball`: photographs of a mirror ball to one HDR panorama."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from rich.console import Console
from rich.table import Table

from lightdepth.cli.capture import (
    Align,
    Bracket,
    Deghost,
    Exposures,
    Output,
    Report,
    ResponseFile,
    SaveResponse,
    shown_progress,
)
from lightdepth.errors import InputError

if TYPE_CHECKING:
    from lightdepth.capture.mirror_ball.finding import Optics
    from lightdepth.capture.mirror_ball.grey_ball import GreyBall
    from lightdepth.capture.mirror_ball.unwrapping import Place
    from lightdepth.capture.shoot import Shoot


def mirror_ball(
    photographs: Annotated[
        list[Path],
        typer.Argument(
            help="A photograph of the ball, or several from different sides; brackets one after the other, or HDR images."
        ),
    ],
    output: Output,
    circle: Annotated[
        list[str] | None,
        typer.Option(help="The ball's outline: auto, or x,y,r in pixels; once, or once for each photograph."),
    ] = None,
    fov: Annotated[
        float | None, typer.Option(min=0.5, max=150.0, help="Degrees across the photograph. From EXIF by default.")
    ] = None,
    distance: Annotated[
        float | None, typer.Option(min=0.01, help="Or metres from the camera to the ball's centre.")
    ] = None,
    ball_diameter: Annotated[
        float | None, typer.Option(min=0.001, help="Of the mirror ball, metres; for --distance and --scene.")
    ] = None,
    reflectance: Annotated[
        str | None,
        typer.Option(help="Of the ball, seen head-on: one number or red,green,blue. By default chromium's 0.55."),
    ] = None,
    turn: Annotated[
        list[float] | None,
        typer.Option(
            help="About how far the camera went around the ball for each further photograph, degrees from the first, "
            "counter-clockwise seen from above; found by default."
        ),
    ] = None,
    photographer: Annotated[
        float, typer.Option(min=0.0, max=60.0, help="Degrees around the camera's reflection that others replace.")
    ] = 12.0,
    scene: Annotated[
        Path | None,
        typer.Option(help="Scene file of the place: its surfaces say where what the ball mirrors really is."),
    ] = None,
    position: Annotated[
        str | None,
        typer.Option(metavar="X,Y,Z", help="Of the ball's centre in that scene; its panorama's by default."),
    ] = None,
    width: Annotated[
        int | None, typer.Option(min=64, help="Width of the panorama; by default as fine as the photographs.")
    ] = None,
    uncovered: Annotated[
        Literal["fill", "mark", "black"], typer.Option(help="What becomes of directions without a photograph.")
    ] = "fill",
    grey_circle: Annotated[
        str | None, typer.Option(help="Outline x,y,r of a grey ball in the first photograph: solves clipped sources.")
    ] = None,
    grey_albedo: Annotated[str, typer.Option(help="Of the grey ball: one number or red,green,blue.")] = "0.18",
    sun_diameter: Annotated[
        float | None,
        typer.Option(min=0.01, max=30.0, help="Diameter of the strongest clipped source in degrees: 0.53 for the sun."),
    ] = None,
    write: Annotated[
        Path | None, typer.Option(help="Put the clipped sources into this scene file; it is begun where it is missing.")
    ] = None,
    exposures: Exposures = None,
    bracket: Bracket = None,
    response: ResponseFile = None,
    save_response: SaveResponse = None,
    align: Align = False,
    deghost: Deghost = False,
    picture: Annotated[
        Path | None, typer.Option(help="A check picture (PNG): the outlines over the photographs.")
    ] = None,
    report: Report = None,
) -> None:
    """Unwrap photographs of a mirror ball to one equirectangular HDR panorama.

    The panorama's centre is the direction in which the first camera looked. What lies exactly behind the ball and the
    photographer come from a second photograph, from another side.

    Example: lightdepth capture mirror-ball ball-1.jpg ball-2.jpg -o ball.exr --picture outlines.png
    """
    import numpy as np

    from lightdepth.capture.mirror_ball.finding import Optics, check_inside, find_ball
    from lightdepth.capture.mirror_ball.grey_ball import recover_from_grey_ball
    from lightdepth.capture.mirror_ball.picture import draw_outlines
    from lightdepth.capture.mirror_ball.reflectance import CHROMIUM, parse_reflectance
    from lightdepth.capture.mirror_ball.registration import Registration, register
    from lightdepth.capture.mirror_ball.report import ball_report
    from lightdepth.capture.mirror_ball.shoot import outline_given, read_balls
    from lightdepth.capture.mirror_ball.unwrapping import Ball, natural_width, unwrap
    from lightdepth.capture.output import check_output, write_image
    from lightdepth.capture.report import write_report
    from lightdepth.capture.response import load_response
    from lightdepth.capture.response import save_response as save
    from lightdepth.capture.shoot import MergeOptions
    from lightdepth.images.filling import fill, mark
    from lightdepth.images.png import write_png
    from lightdepth.images.writing import check_writable

    check_output(output, save_response, report, picture)
    if write is not None:
        check_writable(write)
        if grey_circle is None:
            raise InputError("--write is for clipped sources, which --grey-circle recovers: give it as well")
    if width is not None and width % 2:
        raise InputError(f"--width is {width}; a panorama is twice as wide as high, so it must be even")
    reflects = parse_reflectance(reflectance or f"{CHROMIUM}", "--reflectance")
    albedo = parse_reflectance(grey_albedo, "--grey-albedo")
    if scene is None and position is not None:
        raise InputError("--position is the ball's in a scene; give --scene too")
    place = _place(scene, position, ball_diameter) if scene is not None else None
    options = MergeOptions(
        response=load_response(response) if response else None,
        exposures=exposures,
        bracket=bracket,
        align=align,
        deghost=deghost,
    )
    with shown_progress() as progress:
        shoot, pictures = read_balls(photographs, options, progress)
        given = _per_photograph(circle, len(pictures), "--circle")
        further = len(pictures) - 1
        if turn is not None and len(turn) != further:
            raise InputError(f"--turn is given {len(turn)} times; there are {further} photographs after the first")
        optics = _optics(shoot, pictures[0].radiance.shape, fov, distance, ball_diameter)
        balls = []
        for index, (each, outline) in enumerate(zip(pictures, given, strict=True)):
            if outline == "auto":
                view = find_ball(each.name, each.radiance, optics, reflects)
            else:
                view = outline_given(each, outline, optics, "--circle")
                check_inside(each.name, view)
            balls.append(Ball(each.name, each.radiance, each.clipped, view, reflects))
            progress("finding the ball", index + 1, len(pictures))
        if picture is not None:
            write_png(picture, draw_outlines(balls))
        registered: list[Registration] = []
        for index, ball in enumerate(balls[1:]):
            registered.append(register(balls[0], ball, turn[index] if turn else None, place))
            progress("turning", index + 1, len(balls) - 1)
        balls = [balls[0], *(each.ball for each in registered)]
        unwrapped = unwrap(balls, width or natural_width(balls), place, photographer if registered else 0.0, progress)
    filled = fill(unwrapped.radiance, unwrapped.covered)
    light = {"fill": filled, "black": unwrapped.radiance}.get(uncovered)
    light = mark(unwrapped.radiance, unwrapped.covered) if light is None else light
    grey = None
    if grey_circle is not None:
        lens = Optics(focal_length=balls[0].view.focal_length)
        grey_view = outline_given(pictures[0], grey_circle, lens, "--grey-circle")
        check_inside(pictures[0].name, grey_view)
        grey = recover_from_grey_ball(balls[0], grey_view, albedo, filled, unwrapped.clipped)
    png = write_image(output, np.asarray(light), unwrapped.covered, panorama=True)
    if save_response and shoot.response:
        save(save_response, shoot.response)
    lights = _lights(grey, sun_diameter, unwrapped.covered.shape[0]) if grey is not None else []
    if write is not None:
        _write_lights(write, output, lights)
    figures = ball_report(shoot, balls, registered, unwrapped, reflects, reflectance is None, place is not None, grey)
    if grey is not None:
        figures["grey_ball"]["lights"] = lights
    if report:
        write_report(report, figures)
    _print(figures, output, png)


def _per_photograph(values: list[str] | None, count: int, option: str) -> list[str]:
    values = values or ["auto"]
    if len(values) not in (1, count):
        raise InputError(
            f"{option} is given {len(values)} times; allowed is once, or once for each of {count} photographs"
        )
    return values * count if len(values) == 1 else values


def _optics(
    shoot: Shoot, shape: tuple[int, ...], fov: float | None, distance: float | None, diameter: float | None
) -> Optics:
    import math

    from lightdepth.capture.lens import horizontal_fov
    from lightdepth.capture.mirror_ball.finding import Optics
    from lightdepth.capture.mirror_ball.geometry import FARTHEST, NEAREST

    height, width = shape[:2]
    if distance is not None:
        if fov is not None:
            raise InputError("give either --fov or --distance: with the ball's circle, each follows from the other")
        if diameter is None:
            raise InputError("--distance needs the ball's size: state --ball-diameter in metres")
        radii = 2.0 * distance / diameter
        if not NEAREST < radii < FARTHEST:
            raise InputError(
                f"--distance {distance:g} is {radii:.3g} times the ball's radius; {NEAREST:g} to {FARTHEST:g} are allowed"
            )
        return Optics(distance=radii)
    if fov is None:
        focal_length = shoot.exposure.focal_length_35mm if shoot.exposure else None
        if focal_length is None:
            raise InputError(
                f"{shoot.orientations[0].name}: the field of view is not in the EXIF data; state it as --fov DEGREES "
                "(across the photograph's width), or --distance and --ball-diameter in metres"
            )
        fov = horizontal_fov(focal_length, width, height)
    return Optics(focal_length=0.5 * width / math.tan(math.radians(0.5 * fov)))


def _place(scene: Path, position: str | None, diameter: float | None) -> Place:
    """The surfaces of a scene around the ball, in its panorama's light space."""
    import numpy as np

    from lightdepth.capture.mirror_ball.unwrapping import Place
    from lightdepth.directions import FloatArray
    from lightdepth.kernel.raycasting import RayCaster
    from lightdepth.reconstruction.posed_panorama import parse_three
    from lightdepth.scene.load import load_scene

    if diameter is None:
        raise InputError("--scene needs the ball's size: state --ball-diameter in metres")
    loaded = load_scene(scene)
    if not loaded.real:
        raise InputError(f"{scene}: has no [[real]] surfaces; without them everything is taken to be infinitely far")
    given = parse_three(position, "--position")
    centre = loaded.panorama.position if given is None else np.asarray(given)
    rotation = loaded.panorama.rotation
    caster = RayCaster([surface.mesh for surface in loaded.real])

    def rays(origins: FloatArray, directions: FloatArray) -> Any:
        return caster.cast(centre + origins @ rotation.T, directions @ rotation.T).distance

    return Place(rays, 0.5 * diameter)


def _lights(grey: GreyBall, sun_diameter: float | None, height: int) -> list[dict[str, Any]]:
    """The sources as ``[[light]]`` tables."""
    from lightdepth.capture.mirror_ball.grey_ball import pixel_of

    tables = []
    for index, source in enumerate(grey.sources):
        disc = sun_diameter if index == 0 else None
        radiance = source.radiance if disc is None else source.disc_radiance(disc)
        pixel = source.pixel if disc is None else pixel_of(source.direction, height)
        table: dict[str, Any] = {
            "type": "clipped",
            "pixel": [round(x, 2) for x in pixel],
            "radiance": [float(f"{value:.5g}") for value in radiance],
        }
        if disc is not None:
            table["diameter"] = disc
        tables.append(table)
    return tables


def _write_lights(path: Path, panorama: Path, lights: list[dict[str, Any]]) -> None:
    import os

    from lightdepth.images.writing import whole_file
    from lightdepth.lighting.scene_file import write_light
    from lightdepth.toml_file import first_panorama, read_toml

    if not path.exists():
        image = Path(os.path.relpath(panorama.resolve(), path.resolve().parent)).as_posix()
        with whole_file(path) as temporary:
            temporary.write_text(f'[panorama]\nimage = "{image}"\n')
    table = first_panorama(read_toml(path)[1])
    scale = table.get("scale", 1.0) if isinstance(table, dict) else 1.0
    factor = float(scale) if isinstance(scale, int | float) else 1.0
    for number, light in enumerate(lights, start=1):
        # Declared radiance is in the panorama's unit with its scale applied.
        radiance = [float(f"{factor * value:.5g}") for value in light["radiance"]]
        write_light(path, f"clipped {number}", {"diameter": None, **light, "radiance": radiance})


def _print(figures: dict[str, Any], output: Path, picture: Path) -> None:
    console = Console()
    table = Table(title="Photographs")
    for heading in ("photograph", "circle", "distance", "turn", "gain", "clipped", "differs"):
        # What --circle takes is shown in full.
        table.add_column(
            heading,
            justify="left" if heading == "photograph" else "right",
            no_wrap=heading == "circle",
            overflow="fold",
        )
    for each in figures["photographs"]:
        table.add_row(
            each["name"],
            "{x:.1f},{y:.1f},{radius:.1f}".format(**each["circle"]),
            f"{each['distance_radii']:.2f} radii",
            f"{each['turn_degrees']:.1f}°",
            f"{each['gain_stops']:+.2f} EV",
            f"{each['clipped_share']:.2%}",
            "-" if each["disagreement"] is None else f"{each['disagreement']:.1%}",
        )
    console.print(table)
    zones = Table(title="Angle from the first camera")
    for heading in ("from", "to", "covered", "degrees a pixel"):
        zones.add_column(heading, justify="right")
    for zone in figures["zones"]:
        zones.add_row(
            f"{zone['from']:g}°",
            f"{zone['to']:g}°",
            f"{zone['covered']:.1%}",
            "-" if zone["degrees_per_pixel"] is None else f"{zone['degrees_per_pixel']:.2f}",
        )
    console.print(zones)
    summary = Table(show_header=False, box=None)
    summary.add_row("camera response", figures["response"])
    share = ", ".join(f"{value:g}" for value in figures["reflectance"])
    summary.add_row("reflectance", share + (" (chromium; --reflectance states another)" if figures["assumed"] else ""))
    summary.add_row(
        "parallax", "corrected by the place" if figures["parallax"] else "everything taken as infinitely far"
    )
    summary.add_row("covered", f"{figures['covered']:.2%} of the sphere")
    summary.add_row("clipped", f"{figures['clipped']:.3%} of the sphere")
    summary.add_row("panorama", "{} x {}".format(*figures["size"]))
    console.print(summary)
    grey = figures.get("grey_ball")
    if grey:
        console.print(f"grey ball: agrees within {grey['disagreement']:.1%} (median)", highlight=False)
        for number, source in enumerate(grey["sources"], start=1):
            gains = ", ".join(f"{value:.3g}" for value in source["gain"])
            console.print(
                f"{number}: at pixel {source['pixel'][0]:g},{source['pixel'][1]:g}: {gains} times its clipped light; "
                f"irradiance of a surface that faces it {', '.join(f'{v:.4g}' for v in source['irradiance'])}",
                soft_wrap=True,
                highlight=False,
            )
        if not grey["sources"]:
            console.print("no clipped source is brighter than the panorama shows", highlight=False)
    for warning in figures["warnings"]:
        console.print(f"[yellow]warning:[/] {warning}", soft_wrap=True)
    console.print(f"{output} and {picture} written", soft_wrap=True)
