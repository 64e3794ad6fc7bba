"""`lightdepth calibrate second`: the pose of a further panorama of a place."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lightdepth.cli.calibration_report import numbers, print_result, rounded

if TYPE_CHECKING:
    from lightdepth.calibration.relative_pose import RelativePose, SharedPoints
    from lightdepth.scene.model import Scene


def second(
    panorama: Annotated[Path, typer.Argument(help="The second panorama: 360 x 180 degrees, .exr .hdr .jpg .png .tif.")],
    scene: Annotated[Path, typer.Option(help="Scene file whose first panorama has its pose already.")],
    match: Annotated[
        list[str] | None,
        typer.Option(
            help='A point that both show: "x,y = u,v", pixels of the first panorama and of the second. Repeat it.',
            metavar="POINT=POINT",
        ),
    ] = None,
    floor_match: Annotated[
        list[str] | None,
        typer.Option(help="The same, of a point on the floor (z = 0), which needs no model.", metavar="POINT=POINT"),
    ] = None,
    snap: Annotated[
        bool,
        typer.Option(
            "--snap",
            help="Move the clicks on the second panorama to where it shows what the first one shows around its clicks.",
        ),
    ] = False,
    auto: Annotated[bool, typer.Option("--auto", help="Find shared points by features.")] = False,
    baseline: Annotated[
        float | None,
        typer.Option(min=1e-3, help="Distance between the two capture points, where no surface gives it.", metavar="M"),
    ] = None,
    click_error: Annotated[
        float, typer.Option(min=1e-3, help="How far clicks may be off (standard deviation), pixels of the panorama.")
    ] = 1.0,
    write: Annotated[
        Path | None,
        typer.Option(
            help=r"Scene file to write the pose into, as a further [\[panorama]]; the rest stays.", metavar="SCENE"
        ),
    ] = None,
    picture: Annotated[
        Path | None, typer.Option(help="Check picture (.png): both panoramas with epipolar lines.", metavar="PNG")
    ] = None,
    json_output: Annotated[bool, typer.Option("--json", help="Print the result as JSON.")] = False,
) -> None:
    """Relate a second panorama to the first: its rotation and position in the same world.

    Click points that both panoramas show: four or more on modelled surfaces or on
    the floor, or eight anywhere and the distance between the tripods; or let
    features find them. Level and scale are those of the first panorama.

    lightdepth calibrate second kitchen.exr --scene flat.toml
    --match "812,655 = 3020,1401" --match "1204,700 = 2511,1180"
    --match "640,811 = 3410,1500" --match "990,420 = 2790,700"
    --write flat.toml --picture check.png

    lightdepth calibrate second kitchen.exr --scene flat.toml --auto --write flat.toml --picture check.png
    """
    import math

    from lightdepth.calibration.epipolar_picture import draw_epipolar_picture
    from lightdepth.calibration.relative_pose import relate
    from lightdepth.calibration.scene_file import write_further_pose
    from lightdepth.errors import InputError
    from lightdepth.images.panorama_file import read_panorama
    from lightdepth.images.png import write_png
    from lightdepth.images.validation import validate_panorama
    from lightdepth.images.writing import check_writable
    from lightdepth.scene.load import load_scene

    if picture is not None:
        if picture.suffix.lower() != ".png":
            raise InputError(f"--picture {picture}: the check picture must be a .png file")
        check_writable(picture)
    if write is not None:
        check_writable(write)
    if auto == bool(match or floor_match):
        raise InputError("give either shared points (--match, --floor-match), or --auto")
    if snap and auto:
        raise InputError("--snap moves clicked points; the features of --auto are precise")
    loaded = load_scene(scene)
    image = read_panorama(panorama)
    radiance = validate_panorama(image.radiance, panorama, repair=True)
    degrees = click_error * 360.0 / min(radiance.shape[1], loaded.panorama.radiance.shape[1])
    if auto:
        (points, pose, matched), moved = _by_features(loaded, radiance, panorama, baseline), None
    else:
        points = _clicked(loaded, radiance.shape[:2], match or [], floor_match or [], baseline, math.radians(degrees))
        pose, matched, moved = relate(points), None, None
        if snap:
            points, pose, moved = _snapped(loaded, radiance, points, pose)
    report = _report(points, pose, matched, moved)
    report["warnings"] += list(image.notes) + _doubts(points, pose, report)
    if write is not None:
        write_further_pose(write, panorama, report["rotation"], report["position"])
    if picture is not None:
        write_png(
            picture, draw_epipolar_picture(loaded.panorama.radiance, radiance, loaded.panorama.rotation, points, pose)
        )
    print_result(report, _rows(report), json_output)


def _clicked(
    loaded: Scene,
    size: tuple[int, int],
    matches: list[str],
    floor_matches: list[str],
    baseline: float | None,
    click_error: float,
) -> SharedPoints:
    import numpy as np

    from lightdepth.calibration.clicks import read_clicks
    from lightdepth.calibration.relative_pose import SharedPoints
    from lightdepth.errors import InputError
    from lightdepth.scene.spot import find_spot

    first = loaded.panorama
    names, ones, others, places, normals = [], [], [], [], []
    for option, texts in (("--match", matches), ("--floor-match", floor_matches)):
        for number, text in enumerate(texts, start=1):
            name = f"{option} {number}"
            here, equals, there = text.partition("=")
            if not equals:
                raise InputError(
                    f"{name}: '{text}' is not understood; write \"x,y = u,v\": pixels of the first panorama and the second"
                )
            one = read_clicks(here, first.radiance.shape[:2], f"{name}, first panorama", 1)[0]
            others.append(read_clicks(there, size, f"{name}, second panorama", 1)[0])
            ray = first.rotation @ one
            if option == "--floor-match":
                if ray[2] > -0.01 or first.position[2] <= 0.0:
                    raise InputError(f"{name}: {here.strip()} is not below the horizon of the first panorama")
                places.append(first.position - ray * first.position[2] / ray[2])
                normals.append(np.array([0.0, 0.0, 1.0]))
            else:
                spot = find_spot(first, loaded.real, one)
                places.append(np.full(3, np.nan) if spot is None else spot.point)
                normals.append(-ray if spot is None else spot.normal)
            names.append(name)
            ones.append(ray)
    shown = np.array(ones), np.array(others), np.array(places)
    errors = np.full(len(names), click_error)
    return SharedPoints(tuple(names), *shown, first.position, errors, baseline, np.array(normals))


def _snapped(
    loaded: Scene, radiance: Any, points: SharedPoints, pose: RelativePose
) -> tuple[SharedPoints, RelativePose, Any]:
    """The points with the second clicks moved, the pose, and which were moved."""
    from lightdepth.calibration.shared_point_snapping import snap_shared_points
    from lightdepth.kernel.raycasting import RayCaster

    first, caster = loaded.panorama, RayCaster([surface.mesh for surface in loaded.real])
    return snap_shared_points(points, pose, first.radiance, first.rotation, radiance, caster)


def _by_features(
    loaded: Scene, radiance: Any, panorama: Path, baseline: float | None
) -> tuple[SharedPoints, RelativePose, int]:
    """Shared points that agree, the pose, and how many features matched."""
    import numpy as np

    from lightdepth.calibration.feature_matches import shared_features
    from lightdepth.calibration.relative_pose import SharedPoints, check_enough, relate_robustly
    from lightdepth.errors import InputError
    from lightdepth.kernel.raycasting import RayCaster
    from lightdepth.parameters.calibration import DEFAULT

    least, share, tolerance = DEFAULT.feature_fewest, DEFAULT.feature_share, DEFAULT.feature_tolerance
    first = loaded.panorama
    here, there = shared_features(first.radiance, radiance)
    advice = "click shared points (--match) instead, or take a panorama between the two"
    if len(here) < least:
        raise InputError(
            f"{panorama}: only {len(here)} features look alike in the two panoramas; {least} are needed: {advice}"
        )
    rays = here @ first.rotation.T
    places = np.full_like(rays, np.nan)
    if loaded.real:
        caster = RayCaster([surface.mesh for surface in loaded.real])
        origins = np.repeat(first.position[None], len(rays), axis=0)
        distance = np.asarray(caster.cast(origins, rays).distance, np.float64)
        met = np.isfinite(distance)
        places[met] = origins[met] + rays[met] * distance[met, None]
    names = tuple(f"feature {number}" for number in range(1, len(here) + 1))
    errors = np.full(len(rays), np.radians(DEFAULT.feature_error))
    points = SharedPoints(names, rays, there, places, first.position, errors, baseline)
    check_enough(points)
    pose, agree = relate_robustly(points, np.radians(tolerance))
    count = int(agree.sum())
    if pose is None or count < max(least, share * len(here)):
        raise InputError(
            f"{panorama}: of {len(here)} features that look alike, {count} agree on a pose within {tolerance} degrees; "
            f"{max(least, int(np.ceil(share * len(here))))} are needed, as fewer agree by chance: {advice}"
        )
    return points.some(agree), pose, len(here)


def _doubts(points: SharedPoints, pose: RelativePose, report: dict[str, Any]) -> list[str]:
    """What is said where the position is not known well, or clicks could not be moved."""
    import math

    from lightdepth.parameters.calibration import DEFAULT

    doubts, good = [], DEFAULT.doubtful_position
    still = [] if report["snapped"] is None else [name for name, moved in report["snapped"].items() if not moved]
    if still:
        doubts.append(
            f"--snap left {', '.join(still)} where clicked: the second panorama does not show clearly one place there that "
            "looks as in the first, or no surface is known there"
        )
    error = 2.0 * pose.position_error
    share = error / max(report["baseline"], 1e-6)
    if share > good:
        # Errors fall with the square root of the number of points.
        enough = math.ceil(len(points.names) * (share / good) ** 2)
        remedy = "add near points all around" + ("" if report["snapped"] else ", or --snap them")
        doubts.append(
            f"the position may be off by {100.0 * error:.0f} cm, {100.0 * share:.0f} % of the baseline: {remedy}; about "
            f"{enough} points like these make it {100.0 * good:.0f} %"
        )
    return doubts


def _report(points: SharedPoints, pose: RelativePose, matched: int | None, moved: Any) -> dict[str, Any]:
    """The result as plain numbers: what ``--json`` prints."""
    import numpy as np

    from lightdepth.directions import rotation_to_euler

    degrees = np.degrees(pose.residuals)
    return {
        "rotation": rounded(rotation_to_euler(pose.rotation)),
        "position": rounded(pose.position),
        "baseline": round(float(np.linalg.norm(pose.position - points.origin)), 5),
        "points": len(points.names),
        "on_surfaces": int(points.placed.sum()),
        "matched": matched,
        "snapped": None if moved is None else dict(zip(points.names, moved.tolist(), strict=True)),
        "residual_degrees": round(float(np.sqrt(np.mean(degrees**2))), 4),
        "residual_centimetres": round(float(np.sqrt(np.mean(pose.centimetres**2))), 3),
        "residuals": {
            name: [round(float(angle), 4), round(float(length), 3)]
            for name, angle, length in zip(points.names, degrees, pose.centimetres, strict=True)
        },
        "direction_error": round(pose.direction_error, 4),
        "position_error": round(pose.position_error, 4),
        "warnings": [],
    }


def _rows(report: dict[str, Any]) -> Iterator[tuple[str, str, str]]:
    """The result as the table shows it."""
    yield "rotation", numbers(report["rotation"]), f"degrees, XYZ Euler, +-{report['direction_error']:.2f}"
    yield "position", numbers(report["position"]), f"metres, world, +-{report['position_error']:.3f}"
    yield "baseline", f"{report['baseline']:.3f}", "metres from the first capture point"
    found = "" if report["matched"] is None else f" of {report['matched']} features that look alike"
    if report["snapped"] is not None:
        found = f", {sum(report['snapped'].values())} moved to where the second panorama shows them"
    yield "points", f"{report['points']}", f"{report['on_surfaces']} on surfaces{found}"
    centimetres = f"{report['residual_centimetres']:.1f} cm"
    yield "residual", f"{report['residual_degrees']:.3f}", f"degrees, {centimetres}, root mean square"
    if report["matched"] is None:
        for name, (angle, length) in report["residuals"].items():
            yield f"  {name}", f"{angle:.3f}", f"degrees, {length:.1f} cm"
