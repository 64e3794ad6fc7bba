"""`lightdepth where`: what pixels of the panorama show."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from lightdepth.cli.options import SceneFile

if TYPE_CHECKING:
    from lightdepth.scene.model import Scene
    from lightdepth.scene.spot import Spot


def where(
    scene: SceneFile,
    points: Annotated[
        list[str], typer.Argument(metavar="X,Y...", help="Pixels of the panorama: x to the right, y down.")
    ],
    angles: Annotated[
        bool,
        typer.Option("--angles", help="Points are degrees right of the centre and above the horizon, not pixels."),
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print the report as JSON.")] = False,
) -> None:
    r"""Report what surface pixels of the panorama show, and where it is in the world.

    For each point: the real surface, the place in metres, its normal, its distance from the capture point, the
    irradiance there (what of it comes from places that the panorama shows) and the albedo that follows.
    In the scene file, `at = \[x, y]` puts an object there.

    Example: lightdepth where room.toml 512,400 700,380
    """
    import json

    from lightdepth.calibration.clicks import read_clicks
    from lightdepth.scene.load import load_scene
    from lightdepth.scene.spot import find_spot

    loaded = load_scene(scene)
    size = loaded.panorama.radiance.shape[:2]
    directions = read_clicks(" ".join(points), None if angles else (size[0], size[1]), "X,Y")
    spots = [find_spot(loaded.panorama, loaded.real, direction) for direction in directions]
    light = iter(_light(loaded, [spot for spot in spots if spot is not None]))
    words = [word for text in points for word in text.replace(";", " ").split()]
    rows: list[dict[str, Any]] = []
    for word, spot in zip(words, spots, strict=False):
        row: dict[str, Any] = {"point": word, "surface": None}
        if spot is not None:
            row |= {
                "surface": spot.surface,
                "position": [float(x) for x in spot.point],
                "normal": [float(x) for x in spot.normal],
                "distance": spot.distance,
                **next(light),
            }
        rows.append(row)
    if as_json:
        typer.echo(json.dumps({"points": rows}, indent=2))
    else:
        _print(rows, loaded.panorama.sky)


def _light(scene: Scene, spots: list[Spot]) -> list[dict[str, list[float]]]:
    from lightdepth.kernel.raycasting import RayCaster
    from lightdepth.lightmap.building import build_light_depth_map
    from lightdepth.lightmap.depth_mesh import mesh_from_depth
    from lightdepth.lightmap.spot_light import spot_light

    if not spots:
        return []
    panorama = scene.panorama
    meshes = [surface.mesh for surface in scene.real]
    tuned = scene.render.parameters.place
    if not meshes and panorama.depth is not None:
        meshes = [mesh_from_depth(panorama.depth, panorama.position, panorama.rotation, tuned=tuned)]
    return spot_light(build_light_depth_map(scene), RayCaster(meshes), spots)


def _print(rows: list[dict[str, Any]], sky: bool) -> None:
    from rich.console import Console
    from rich.markup import escape

    def numbers(values: list[float], decimals: int) -> str:
        return "  ".join(f"{round(value, decimals) + 0.0:.{decimals}f}" for value in values)

    console = Console(soft_wrap=True, highlight=False)
    for row in rows:
        if row["surface"] is None:
            console.print(f"[bold]{row['point']}[/]  {'sky' if sky else 'no real surface'}")
            continue
        console.print(f"[bold]{row['point']}[/]  {escape(row['surface'])}")
        albedo = numbers(row["albedo"], 2) + ("  (gives light of its own)" if max(row["albedo"]) > 1.2 else "")
        for name, value in (
            ("position", numbers(row["position"], 3) + "  metres, world"),
            ("normal", numbers(row["normal"], 3)),
            ("distance", f"{row['distance']:.3f}  metres from the capture point"),
            ("irradiance", "  ".join(f"{part:.3g}" for part in row["irradiance"]) + "  as far as the panorama shows"),
            ("albedo", albedo),
        ):
            console.print(f"  {name:<11}{value}")
