"""`lightdepth recover`: light that the photograph lacks, found from what it lights."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from lightdepth.lighting.gloss import RecoveredGloss
    from lightdepth.lighting.sun import RecoveredSun

app = typer.Typer(no_args_is_help=True)

Scene = Annotated[Path, typer.Argument(metavar="SCENE", help="Scene file (.toml).")]
Write = Annotated[bool, typer.Option("--write", help="Put the result into the scene file; the rest of it stays.")]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]


@app.callback()
def _group() -> None:
    """Keeps the commands' own names where there is one alone."""


@app.command()
def sun(
    scene: Scene,
    patch: Annotated[
        list[str] | None,
        typer.Option(
            "--patch",
            metavar='"X,Y X,Y ..."',
            help="Outline of a patch of sun in the panorama's pixels, or one or two places in it; else it is found. "
            "Repeatable.",
        ),
    ] = None,
    direction: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,Z", help="Toward the sun, world, where it is known; its strength alone is recovered."
        ),
    ] = None,
    azimuth: Annotated[
        float | None, typer.Option(help="Or its azimuth, degrees clockwise from +y seen from above,")
    ] = None,
    elevation: Annotated[float | None, typer.Option(help="and its elevation, degrees.")] = None,
    diameter: Annotated[float, typer.Option(min=0.01, max=10.0, help="Of the sun's disc, degrees.")] = 0.53,
    name: Annotated[str, typer.Option(help="Of the light in the scene file.")] = "sun",
    mask: Annotated[
        Path | None,
        typer.Option(
            "--mask",
            help="Recover from the patch the pattern of what is not modelled (bars, curtains, trees), as an image (.exr).",
        ),
    ] = None,
    picture: Annotated[
        Path | None, typer.Option("--picture", help="A check picture (PNG): what the sun lights, over the panorama.")
    ] = None,
    write: Write = False,
    as_json: Json = False,
) -> None:
    """The sun that shines in through a window which the camera did not look out of: direction and irradiance.

    It is found from the patch of sun that the photograph shows, and from the openings of the modelled place: surfaces with
    opening = true, and holes. In the check picture the outlines must lie on the patch's edges.

    Example: lightdepth recover sun lounge.toml --picture sun.png --write
    """
    from lightdepth.errors import InputError
    from lightdepth.images.png import write_png
    from lightdepth.images.radiance import WRITERS, write_radiance
    from lightdepth.images.writing import check_writable
    from lightdepth.lighting.scene_file import write_light
    from lightdepth.lighting.sun import recover_sun
    from lightdepth.reconstruction.posed_panorama import parse_three
    from lightdepth.scene.lights.frame import sun_direction
    from lightdepth.scene.load import load_scene

    if (azimuth is None) != (elevation is None):
        raise InputError("--azimuth and --elevation go together")
    toward = parse_three(direction, "--direction")
    if toward is not None and azimuth is not None:
        raise InputError("give either --direction or --azimuth and --elevation")
    if toward is not None and not any(toward):
        raise InputError("--direction: must not be 0,0,0")
    if azimuth is not None and elevation is not None:
        toward = tuple(sun_direction(azimuth, elevation))
    if mask is not None and mask.suffix.lower() not in WRITERS:
        raise InputError(f"{mask}: '{mask.suffix}' is not a format for masks; allowed are {', '.join(WRITERS)}")
    for path in (picture, mask):
        if path is not None:
            check_writable(path)
    loaded = load_scene(scene)
    found = recover_sun(loaded, patch or [], None if toward is None else _array(toward), diameter)
    values = _sun_values(found)
    if mask is not None:
        from lightdepth.lighting.sun_mask import recover_mask

        pattern = recover_mask(loaded, found.light())
        write_radiance(mask, pattern.transmittance)
        values["irradiance"] = [float(f"{value:.5g}") for value in pattern.irradiance]
        values["mask"] = _relative(mask, scene)
        values["mask_extent"] = [round(edge, 4) for edge in pattern.extent]
    if picture is not None:
        from lightdepth.lighting.sun_picture import draw_sun

        write_png(picture, draw_sun(loaded, found))
    if write:
        write_light(scene, name, values)
    _report_sun(found, values, as_json)


@app.command()
def clipped(
    scene: Scene,
    pair: Annotated[
        list[str] | None,
        typer.Option(
            "--pair",
            metavar='"X,Y X,Y"',
            help="A place in the source's light and one of the same material in its shadow, in pixels. Repeatable.",
        ),
    ] = None,
    grey: Annotated[
        list[str] | None,
        typer.Option(
            "--grey",
            metavar='"X,Y ALBEDO"',
            help="A place in the source's light whose albedo is known (one number or three), such as a grey card. "
            "Repeatable.",
        ),
    ] = None,
    diameter: Annotated[float, typer.Option(min=0.01, max=10.0, help="Of the sun's disc, degrees.")] = 0.53,
    write: Write = False,
    as_json: Json = False,
) -> None:
    """Lamps and suns that the panorama clipped: what they really send, from what they light.

    A sun is recovered from both sides of the shadows that the modelled place throws, a lamp from how its light falls off
    over surfaces of one material; or either from clicks. What the photograph does not determine stays as it is, with
    bounds. The panorama's file and the plate stay.

    Example: lightdepth recover clipped court.toml --write
    """
    import json

    from rich.console import Console

    from lightdepth.lighting.clipped import recover_clipped
    from lightdepth.lighting.scene_file import write_light
    from lightdepth.scene.load import load_scene

    found = recover_clipped(load_scene(scene), pair or [], grey or [], diameter)
    tables: list[dict[str, Any]] = []
    for number, each in enumerate(found, start=1):
        values: dict[str, Any] | None = None
        if each.source is not None:
            values = {
                "type": "clipped",
                "pixel": [round(x, 2) for x in each.source.pixel],
                "radiance": [float(f"{value:.5g}") for value in each.source.radiance],
                "diameter": each.source.diameter,
            }
            if write:
                write_light(scene, f"clipped {number}", values)
        tables.append(
            {
                "light": values,
                "pixel": [round(x, 1) for x in each.plateau.pixel],
                "method": each.method,
                "confidence": each.confidence,
                **{name: _rounded(getattr(each, name)) for name in ("irradiance", "clipped_irradiance", "low", "high")},
                "uncertainty": _rounded(each.uncertainty),
            }
        )
    if as_json:
        typer.echo(json.dumps({"sources": tables}, indent=2))
        return
    console = Console(soft_wrap=True, highlight=False)
    if not tables:
        console.print("nothing in this panorama was clipped, as far as can be seen", markup=False)
    for number, table in enumerate(tables, start=1):
        gains = [
            a / b if a and b else 1.0 for a, b in zip(table["irradiance"], table["clipped_irradiance"], strict=True)
        ]
        console.print(
            f"{number}: at pixel {table['pixel'][0]:g},{table['pixel'][1]:g}: "
            + (
                f"{', '.join(f'{gain:.3g}' for gain in gains)} times its clipped light ({table['method']}, "
                f"confidence {table['confidence']})"
                if table["light"]
                else "was not clipped: it gives no more light than the panorama shows"
                if table["method"] == "not clipped"
                else "the photograph does not determine its strength (give --pair or --grey)"
            ),
            markup=False,
        )
        console.print(
            f"   irradiance of a surface that faces it: {table['irradiance']}; between {table['low']} and {table['high']} "
            "for matte surfaces to have albedos from 0.02 to 0.95",
            markup=False,
        )


@app.command()
def gloss(
    scene: Scene,
    surface: Annotated[
        list[str] | None,
        typer.Option("--surface", metavar="NAME", help="A surface that shines; all support by default. Repeatable."),
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option(
            "--picture",
            help="A check picture (PNG): what is photographed, what is mirrored, and what stays without it.",
        ),
    ] = None,
    write: Write = False,
    as_json: Json = False,
) -> None:
    """How glossy real surfaces are: roughness and specular level, from windows and lamps that they mirror.

    The lobe is found with which the albedo beneath varies least where highlights come and go. Where the photograph does
    not show any, or does not determine it, nothing is written. In the check picture the mirrored highlights must lie on
    the photographed ones.

    Example: lightdepth recover gloss lounge.toml --surface floor --picture gloss.png --write
    """
    import json

    from rich.console import Console

    from lightdepth.images.png import write_png
    from lightdepth.images.writing import check_writable
    from lightdepth.lighting.gloss import recover_gloss
    from lightdepth.lighting.scene_file import write_gloss
    from lightdepth.scene.load import load_scene

    if picture is not None:
        check_writable(picture)
    loaded = load_scene(scene)
    found = recover_gloss(loaded, surface or [])
    if picture is not None:
        from lightdepth.lighting.gloss_picture import draw_gloss

        write_png(picture, draw_gloss(loaded, found))
    if write:
        for each in found:
            if each.gloss is not None:
                write_gloss(scene, each.name, {"roughness": each.gloss.roughness, "specular": each.gloss.specular})
    if as_json:
        typer.echo(json.dumps({"surfaces": [_gloss_values(each) for each in found]}, indent=2))
        return
    console = Console(soft_wrap=True, highlight=False)
    for each in found:
        for line in _gloss_lines(each):
            console.print(line, markup=False)


def _gloss_values(found: RecoveredGloss) -> dict[str, Any]:
    """All that was found, for JSON."""
    from lightdepth.scene.lights.frame import azimuth_and_elevation

    fit = found.fit
    values: dict[str, Any] = {
        "name": found.name,
        "gloss": found.gloss and {"roughness": found.gloss.roughness, "specular": found.gloss.specular},
        "finding": found.finding,
        "confidence": found.confidence,
    }
    if fit is not None:
        values |= {
            "roughness_bounds": _rounded(fit.roughness_bounds),
            "specular_bounds": _rounded(fit.specular_bounds),
            "explained": round(fit.explained, 4),
        }
    if found.gloss is not None:
        values["albedo"] = _rounded(found.gloss.albedo)
    values["sources"] = [
        {
            **dict(zip(("azimuth", "elevation"), _rounded(azimuth_and_elevation(each.direction)), strict=True)),
            "roughness": round(each.fit.roughness, 3),
            "specular": round(each.fit.specular, 3),
        }
        for each in found.by_source
    ]
    return values


def _gloss_lines(found: RecoveredGloss) -> list[str]:
    """The same in words."""
    from lightdepth.scene.lights.frame import azimuth_and_elevation

    fit, name = found.fit, found.name
    nothing = "; nothing is recovered"
    if found.finding == "unseen":
        return [f"{name}: the capture point does not see it, or only at a grazing angle{nothing}"]
    if found.finding == "no source" or fit is None:
        return [f"{name}: nothing bright is mirrored where the capture point sees it{nothing}"]
    if found.finding == "matte":
        return [
            f"{name}: matte as far as the photograph shows: a polished surface would mirror bright sources there, but no "
            f"highlight stands out from its colours{nothing}"
        ]
    (low, high), (least, most) = fit.roughness_bounds, fit.specular_bounds
    bounds = f"roughness between {low:.3g} and {high:.3g}, specular between {least:.3g} and {most:.3g}"
    if found.finding == "undetermined":
        return [f"{name}: glossy, but the photograph does not determine how: {bounds}{nothing}"]
    assert found.gloss is not None
    too_bright = [
        f"{name}: roughness {found.gloss.roughness:.3g}, specular {found.gloss.specular:.3g}",
        f"  its highlights are brighter than glass or lacquer makes them ({bounds}): it is metal, or the sources are "
        "clipped (see recover clipped), hidden from the capture point, or in the wrong place; this is the closest",
    ]
    recovered = [
        f"{name}: roughness {found.gloss.roughness:.3g} ({low:.3g} to {high:.3g}), "
        f"specular {found.gloss.specular:.3g} ({least:.3g} to {most:.3g})"
    ]
    return [
        *(too_bright if found.finding == "too bright" else recovered),
        f"  {100 * fit.explained:.0f} % of what varies between places of different highlights goes with them",
        *(
            "  from the source at azimuth {:.1f}, elevation {:.1f} alone: ".format(
                *azimuth_and_elevation(each.direction)
            )
            + f"{each.fit.roughness:.3g}, {each.fit.specular:.3g}"
            for each in found.by_source
        ),
        f"  albedo beneath: {', '.join(f'{value:.3g}' for value in found.gloss.albedo)}",
        f"confidence: {found.confidence}",
    ]


def _rounded(values: Any) -> list[float | None]:
    """Four digits; ``None`` for what JSON has no number for."""
    import math

    return [float(f"{value:.4g}") if math.isfinite(value) else None for value in values]


def _sun_values(found: RecoveredSun) -> dict[str, Any]:
    """The keys of the ``[[light]]`` table."""
    return {
        "type": "sun",
        "direction": [round(float(x), 6) for x in found.direction],
        "diameter": found.diameter,
        "irradiance": [float(f"{value:.5g}") for value in found.irradiance.value],
    }


def _report_sun(found: RecoveredSun, values: dict[str, Any], as_json: bool) -> None:
    import json

    from rich.console import Console

    from lightdepth.scene.lights.frame import azimuth_and_elevation

    azimuth, elevation = azimuth_and_elevation(found.direction)
    irradiance = found.irradiance
    if as_json:
        report = {
            **values,
            "azimuth": round(azimuth, 3),
            "elevation": round(elevation, 3),
            "direction_uncertainty": round(found.direction_uncertainty, 4),
            "irradiance_uncertainty": [float(f"{value:.3g}") for value in irradiance.uncertainty],
            "agreement": round(found.agreement, 4),
            "found_edges": round(found.found_edges, 4),
            "pairs": len(irradiance.pairs.irradiance),
            "spread": round(irradiance.deviation, 4),
            "by_surface": {name: [float(f"{v:.4g}") for v in value] for name, value in found.by_surface.items()},
            "confidence": found.confidence,
        }
        typer.echo(json.dumps(report, indent=2))
        return
    console = Console(soft_wrap=True, highlight=False)

    def line(text: str) -> None:
        console.print(text, markup=False)

    x, y, z = values["direction"]
    line(f"direction: {x:g}, {y:g}, {z:g} (azimuth {azimuth:.2f}, elevation {elevation:.2f} degrees)")
    if found.direction_uncertainty > 0.0:
        line(f"  standard error {found.direction_uncertainty:.2f} degrees")
    line(
        f"  {100 * found.found_edges:.0f} % of the edges that it predicts are seen, {found.residual:.2f} pixels off; "
        f"correlation with what is bright {found.agreement:.2f}"
    )
    strengths = ", ".join(
        f"{value:.4g} +- {error:.2g}" for value, error in zip(irradiance.value, irradiance.uncertainty, strict=True)
    )
    line(f"irradiance: {strengths}")
    line(
        f"  median of {len(irradiance.pairs.irradiance)} pairs of places, "
        f"of which a single one is {100 * irradiance.deviation:.0f} % off"
    )
    if "mask" in values:
        line(f"  with the mask, where all of it passes: {', '.join(f'{v:.4g}' for v in values['irradiance'])}")
    for name, value in found.by_surface.items():
        line(f"  from {name} alone: {', '.join(f'{v:.4g}' for v in value)}")
    line(f"confidence: {found.confidence}")


def _relative(path: Path, scene: Path) -> str:
    import os

    return Path(os.path.relpath(path.resolve(), scene.resolve().parent)).as_posix()


def _array(values: Any) -> Any:
    import numpy as np

    return np.asarray(values, dtype=np.float64)
