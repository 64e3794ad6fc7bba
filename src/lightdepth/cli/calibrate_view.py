"""`lightdepth calibrate view`: the camera of an ordinary photograph."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lightdepth.cli.calibration_report import numbers, print_result, rounded

if TYPE_CHECKING:
    from lightdepth.calibration.view_cues import Point
    from lightdepth.calibration.view_solve import ViewCalibration
    from lightdepth.images.picture_file import Picture


def view(
    photo: Annotated[
        Path,
        typer.Argument(help="The photograph (.jpg .png .tif .exr .hdr), or a project of fSpy (.fspy) with its lines."),
    ],
    x_line: Annotated[
        list[str] | None,
        typer.Option(
            help='Points along an edge parallel to x, from minus to plus: "x,y x,y". Repeat it.', metavar="POINTS"
        ),
    ] = None,
    y_line: Annotated[
        list[str] | None, typer.Option(help="The same, parallel to the y axis.", metavar="POINTS")
    ] = None,
    z_line: Annotated[list[str] | None, typer.Option(help="The same, plumb: upwards.", metavar="POINTS")] = None,
    point: Annotated[
        list[str] | None,
        typer.Option(
            help='A point of known place: "x,y = X,Y,Z", pixels and metres. Repeat it.', metavar="POINT=WORLD"
        ),
    ] = None,
    match: Annotated[
        list[str] | None,
        typer.Option(
            help='A point seen in the photograph and in the panorama of --scene: "x,y = u,v", pixels of both. Repeat it.',
            metavar="POINT=POINT",
        ),
    ] = None,
    scene: Annotated[
        Path | None, typer.Option(help="Scene file whose panorama and real surfaces say where --match is.")
    ] = None,
    distance: Annotated[
        list[str] | None,
        typer.Option(
            help='A known length: "x,y x,y = 2.0 m along z", from a point on the floor along an axis; without "along", '
            "between two points on the floor.",
            metavar="POINTS=M",
        ),
    ] = None,
    origin: Annotated[
        str | None, typer.Option(help='The world\'s origin: "x,y". Else it is under the camera.', metavar="POINT")
    ] = None,
    camera_height: Annotated[
        float | None, typer.Option(min=1e-3, help="Height of the lens above the floor, metres.", metavar="M")
    ] = None,
    fov: Annotated[
        str,
        typer.Option(help="Horizontal field of view: degrees, free, or exif.", metavar="DEGREES|free|exif"),
    ] = "free",
    principal_point: Annotated[
        str,
        typer.Option(help="Where the lens's axis meets the picture, pixels, or free.", metavar="POINT|centre|free"),
    ] = "centre",
    distortion: Annotated[
        str, typer.Option(help='Radial distortion: "k1,k2", none or free.', metavar="K1,K2|none|free")
    ] = "none",
    click_error: Annotated[
        float, typer.Option(min=1e-3, help="How far clicks may be off (standard deviation), pixels.")
    ] = 1.0,
    write: Annotated[
        Path | None, typer.Option(help="Scene file to write the camera into; the rest stays.", metavar="SCENE")
    ] = None,
    name: Annotated[str, typer.Option(help="Name of the camera in the scene file.")] = "plate",
    picture: Annotated[
        Path | None,
        typer.Option(help="Check picture (.png): grid, axes and lines drawn over the photograph.", metavar="PNG"),
    ] = None,
    fspy: Annotated[
        Path | None, typer.Option(help="Project of fSpy (.fspy) to write, with lines as solved.", metavar="FSPY")
    ] = None,
    json_output: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Find the camera of an ordinary photograph: rotation, position, field of view, distortion.

    Click edges that are parallel to the world's axes, points whose place you
    know, points that the panorama shows as well: as many as you like, all are
    solved at once. Pixels count from the upper left corner of the upright picture.

    lightdepth calibrate view plate.jpg
    --x-line "120,900 1410,830" --x-line "80,410 1500,370"
    --z-line "400,800 396,200" --z-line "1200,790 1206,240"
    --match "812,655 = 3020,1401" --scene room.toml
    --write room.toml --name plate --picture check.png
    """
    from lightdepth.calibration.fspy import fspy_cues, read_fspy, write_fspy
    from lightdepth.calibration.scene_file import write_camera
    from lightdepth.calibration.view_cues import Point, ViewCues, read_distance, read_line, read_pair, read_point
    from lightdepth.calibration.view_picture import draw_view_picture
    from lightdepth.calibration.view_solve import calibrate_view
    from lightdepth.errors import InputError
    from lightdepth.images.picture_file import read_picture
    from lightdepth.images.png import write_png
    from lightdepth.images.writing import check_writable

    for path, suffix, option in ((picture, ".png", "--picture"), (fspy, ".fspy", "--fspy")):
        if path is not None:
            if path.suffix.lower() != suffix:
                raise InputError(f"{option} {path}: must be a {suffix} file")
            check_writable(path)
    if write is not None:
        check_writable(write)
    if bool(match) != (scene is not None):
        raise InputError("--match and --scene go together: the scene's panorama and surfaces say where the points are")
    project = read_fspy(photo) if photo.suffix.lower() == ".fspy" else None
    if project is not None and not project.image:
        raise InputError(f"{photo}: this fSpy project holds no photograph")
    image = read_picture(photo, project.image if project is not None else None)
    size = image.pixels.shape[1], image.pixels.shape[0]
    begun = fspy_cues(project, size) if project is not None else ViewCues(size)
    lines = [
        read_line(text, axis, number, size)
        for axis, texts in enumerate((x_line, y_line, z_line))
        for number, text in enumerate(texts or [], start=1)
    ]
    points = [read_point(text, number, size) for number, text in enumerate(point or [], start=1)]
    if origin is not None:
        points.append(Point("--origin", read_pair(origin, "--origin", size), _zero()))
    if match and scene is not None:
        points += _matches(match, scene, size)
    given_fov = _field_of_view(fov, image, photo) if fov != "free" else begun.fov
    cues = ViewCues(
        size,
        (*begun.lines, *lines),
        (*begun.points, *points),
        (*begun.distances, *(read_distance(text, number, size) for number, text in enumerate(distance or [], start=1))),
        camera_height=camera_height,
        fov=given_fov,
        principal_point=begun.principal_point
        if principal_point == "centre"
        else _free_or_pair(principal_point, "--principal-point", size),
        distortion=(0.0, 0.0) if distortion == "none" else _free_or_pair(distortion, "--distortion", None),
        click_error=click_error,
    )
    result = calibrate_view(cues)
    report = _report(result)
    if given_fov is None and image.fov is not None and abs(result.camera.fov / image.fov - 1.0) > 0.1:
        report["warnings"].append(
            f"{photo}: its EXIF data say {image.fov:.1f} degrees, the clicks {result.camera.fov:.1f}: is the picture "
            "cropped, or the wrong edge clicked? --fov exif holds to the former"
        )
    if write is not None:
        values = {key: report[key] for key in ("width", "height", "fov", "principal_point", "distortion")}
        values["rotation"] = report["rotation"]
        if report["position"] is not None:
            values["position"] = report["position"]
        write_camera(write, name, values)
        if report["position"] is None:
            report["warnings"].append(
                f"{write}: the position is unknown and was not written; give known points, --distance or --camera-height"
            )
    if picture is not None:
        write_png(picture, draw_view_picture(image.pixels, result, cues))
    if fspy is not None:
        report["warnings"] += write_fspy(fspy, result, project.image if project is not None else photo.read_bytes())
    print_result(report, _rows(report), json_output)


def _zero() -> Any:
    import numpy as np

    return np.zeros(3)


def _matches(texts: list[str], scene: Path, size: tuple[int, int]) -> list[Point]:
    """Points seen in the panorama too, on the real surfaces that it shows there."""
    from lightdepth.calibration.clicks import read_clicks
    from lightdepth.calibration.view_cues import Point, read_match
    from lightdepth.errors import InputError
    from lightdepth.scene.load import load_scene
    from lightdepth.scene.spot import find_spot

    loaded = load_scene(scene)
    height, width = loaded.panorama.radiance.shape[:2]
    points = []
    for number, text in enumerate(texts, start=1):
        name, click, there = read_match(text, number, size)
        spot = find_spot(loaded.panorama, loaded.real, read_clicks(there, (height, width), name, 1)[0])
        if spot is None:
            raise InputError(
                f"{name}: {there} shows no real surface of {scene}: model it, or give --point with its position"
            )
        points.append(Point(name, click, spot.point))
    return points


def _field_of_view(text: str, image: Picture, photo: Path) -> float:
    from lightdepth.errors import InputError

    if text == "exif":
        if image.fov is None:
            raise InputError(
                f"{photo}: its EXIF data hold no focal length in terms of 35 mm film; give --fov in degrees"
            )
        return image.fov
    try:
        degrees = float(text)
    except ValueError:
        degrees = 0.0
    if not 1.0 <= degrees <= 170.0:
        raise InputError(f"--fov {text}: degrees from 1 to 170 are allowed, or free, or exif")
    return degrees


def _free_or_pair(text: str, option: str, size: tuple[int, int] | None) -> tuple[float, float] | None:
    """Two numbers, of pixels as shares of the size, or ``None`` for free."""
    from lightdepth.calibration.view_cues import read_pair
    from lightdepth.errors import InputError

    if text == "free":
        return None
    if size is not None:
        x, y = read_pair(text, option, size)
        return float(x / size[0]), float(y / size[1])
    try:
        first, second = (float(word) for word in text.split(","))
    except ValueError:
        raise InputError(f"{option} {text}: two numbers k1,k2 are needed, or none, or free") from None
    if not (abs(first) < 3.0 and abs(second) < 3.0):
        raise InputError(f"{option} {text}: coefficients must be between -3 and 3")
    return first, second


def _report(result: ViewCalibration) -> dict[str, Any]:
    """The result as plain numbers: what ``--json`` prints."""
    import math

    from lightdepth.directions import rotation_to_euler

    camera = result.camera

    return {
        "width": camera.width,
        "height": camera.height,
        "fov": round(camera.fov, 5),
        "focal_length_35mm": round(18.0 / math.tan(math.radians(0.5 * camera.fov)), 3),
        "principal_point": None if camera.principal_point is None else rounded(camera.principal_point, 6),
        "distortion": None if camera.distortion == (0.0, 0.0) else rounded(camera.distortion, 6),
        "rotation": rounded(rotation_to_euler(result.rotation)),
        "position": None if result.position is None else rounded(result.position),
        "residual": round(result.residual, 4),
        "residuals": {cue: round(value, 4) for cue, value in result.residuals.items()},
        "direction_error": round(result.direction_error, 5),
        "fov_error": round(result.fov_error, 5),
        "position_error": None if result.position_error is None else round(result.position_error, 5),
        "warnings": list(result.warnings),
    }


def _rows(report: dict[str, Any]) -> Iterator[tuple[str, str, str]]:
    """The result as the table shows it."""
    yield "rotation", numbers(report["rotation"]), f"degrees, XYZ Euler, +-{report['direction_error']:.2f}"
    if report["position"] is not None:
        error = report["position_error"]
        yield (
            "position",
            numbers(report["position"]),
            "metres, world" + (f", +-{error:.3f}" if error is not None else ""),
        )
    else:
        yield "position", "unknown", "give known points, --distance or --camera-height"
    lens = f"degrees, +-{report['fov_error']:.3f} ({report['focal_length_35mm']:.1f} mm on 36 mm)"
    yield "fov", f"{report['fov']:.3f}", lens
    if report["principal_point"] is not None:
        yield "principal point", numbers(report["principal_point"], 4), "shares of width and height"
    if report["distortion"] is not None:
        yield "distortion", numbers(report["distortion"], 4), "k1, k2"
    yield "residual", f"{report['residual']:.2f}", "pixels, root mean square"
    for name, value in report["residuals"].items():
        yield f"  {name}", f"{value:.2f}", ""
