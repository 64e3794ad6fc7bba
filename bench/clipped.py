"""Panoramas clipped on purpose: the sun that `recover clipped` finds, and the depth of its shadows."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console

from bench.places import PLACES
from bench.places.meshes import box, rectangle
from bench.real import DATA
from lightdepth.directions import latlong_to_direction, pixel_directions, pixel_solid_angles
from lightdepth.errors import InputError
from lightdepth.images.radiance import read_radiance
from lightdepth.kernel.start import start
from lightdepth.lighting.clipped import RecoveredSource, recover_clipped
from lightdepth.lighting.explained import ExplainedLight
from lightdepth.lighting.panorama_view import PanoramaView
from lightdepth.scene.lights.clipped import unclipped
from lightdepth.scene.model import Mesh, Panorama, RealSurface, Role, Scene

LEVELS = (1, 2, 4, 8, 16, 32, 64)
"""Times the mean of the panorama at which it is clipped."""
WIDTH, SAMPLES = 512, 64
"""Of the court's photograph."""
EYE = 1.6
GREY = ((500.5, 380.5), (300.5, 400.5), (700.5, 390.5))
"""Pixels of the meadow whose albedo is taken as known: from the whole panorama."""
TREES_TOWARD = 200
"""Column of the meadow's panorama in which the trees stand whose shadow is seen;"""
TREES_FROM = (20.0, 22.0, 24.0)
"""and metres from the capture point at which their crowns may begin: a guess from their pictures."""
SHADE_ROW, LIT_ROW, COLUMNS = 266.5, 277.5, (150.5, 165.5, 180.5, 195.5, 210.5, 225.5, 240.5)
FEW_LEVELS = (1, 8, 64)
Vector = NDArray[np.float64]


def clipped(console: Console) -> list[dict[str, Any]]:
    """Tables of text: the court, and the meadow `noon_grass` where its panorama is there."""
    start()
    tables = [_court(console)]
    if (DATA / "noon_grass_1k.hdr").is_file():
        tables.append(_meadow(console))
    return tables


def cut(scene: Scene, times: float) -> Scene:
    """A scene whose panorama holds nothing brighter than so many times its mean."""
    radiance = scene.panorama.radiance
    limit = np.float32(times * radiance.mean())
    return replace(scene, panorama=replace(scene.panorama, radiance=np.minimum(radiance, limit)))


def _court(console: Console) -> dict[str, Any]:
    place = PLACES["court"]()
    sky = place.sky
    assert sky is not None
    direction = np.array(sky.sun_direction) / np.linalg.norm(sky.sun_direction)
    true = np.array(sky.sun_radiance) * np.pi * np.sin(np.radians(0.5 * sky.sun_diameter)) ** 2
    scene = place.scene(WIDTH, SAMPLES)
    lit, shaded = np.array([[0.0, 1.0, 0.0], [1.5, 2.0, 0.0]]), np.array([[-4.8, 0.0, 0.0], [0.0, -4.8, 0.0]])
    rows = []
    for times in LEVELS:
        console.print(f"court, clipped at {times} times its mean", highlight=False)
        part = cut(scene, times)
        found = recover_clipped(part, diameter=sky.sun_diameter)[0]
        toward = direction
        if found.source is not None:
            u, v = np.array(found.source.pixel) / (WIDTH, WIDTH / 2)
            toward = scene.panorama.rotation @ latlong_to_direction(u, v)
        angle = np.degrees(np.arccos(np.clip(toward @ direction, -1.0, 1.0)))
        depths = [_depth(each, lit, shaded) for each in (scene, part, mended(part, found))]
        rows.append(
            [str(times), found.method, f"{angle:.2f} degrees", _off(found.irradiance / true), *map(_percent, depths)]
        )
    return {
        "title": f"The court, {WIDTH} pixels wide, clipped at multiples of its mean: the sun that is recovered",
        "head": [
            "clipped at",
            "method",
            "direction off by",
            "irradiance off by (red, green, blue)",
            "light that stays in a shadow: true",
            "clipped",
            "recovered",
        ],
        "rows": rows,
    }


def mended(scene: Scene, found: RecoveredSource) -> Scene:
    """The scene with a recovered source in its light."""
    if found.source is None:
        return scene
    light = unclipped(scene.panorama.radiance, found.source)
    return replace(scene, panorama=replace(scene.panorama, unclipped=light))


def _depth(scene: Scene, lit: Vector, shaded: Vector) -> float:
    """Share of the irradiance on level ground in the light that stays in the shadow."""
    light = ExplainedLight(scene.panorama, scene.real)
    means = [light.irradiance(points, np.tile([0.0, 0.0, 1.0], (2, 1)), 1024).mean() for points in (lit, shaded)]
    return float(means[1] / means[0])


def _meadow(console: Console) -> dict[str, Any]:
    radiance = read_radiance(DATA / "noon_grass_1k.hdr")
    ground = rectangle((-200.0, -200.0, 0.0), (400.0, 0.0, 0.0), (0.0, 400.0, 0.0))
    whole = Scene(
        Panorama(radiance, np.array([0.0, 0.0, EYE]), np.eye(3), sky=True),
        (RealSurface("ground", ground, Role.SUPPORT),),
    )
    true, direction = _sun_of(radiance)
    sky = _horizontal(radiance) - true * direction[2]
    grey = _known_albedo(whole)
    rows = []

    def row(times: int, way: str, found: RecoveredSource) -> None:
        stays = sky / (sky + found.irradiance * direction[2])
        true_stays = sky / (sky + true * direction[2])
        figures = [_off(found.irradiance / true), _percent(float(true_stays.mean())), _percent(float(stays.mean()))]
        rows.append([str(times), way, found.method, *figures])

    for times in LEVELS:
        console.print(f"noon_grass, clipped at {times} times its mean", highlight=False)
        part = cut(whole, times)
        row(times, "three places of known albedo", recover_clipped(part, grey=grey)[0])
        if times in FEW_LEVELS:
            row(times, "nothing", recover_clipped(part)[0])
            pairs = [f"{x},{LIT_ROW} {x},{SHADE_ROW}" for x in COLUMNS]
            for near in TREES_FROM:
                with_trees = replace(part, real=(*part.real, _trees(near)))
                way = f"the trees' shadow, crowns from {near:g} m"
                try:
                    row(times, way, recover_clipped(with_trees, pairs=pairs)[0])
                except InputError:  # Trees in the wrong place: what the pairs say of the sun differs too much.
                    rows.append([str(times), way, "refused: the pairs contradict each other", "", "", ""])
    return {
        "title": "`noon_grass`, a plain with the sun at 85 degrees, clipped at multiples of its mean",
        "head": [
            "clipped at",
            "given",
            "method",
            "irradiance off by (red, green, blue)",
            "light that stays in a shadow: true",
            "recovered",
        ],
        "rows": rows,
    }


def _trees(near: float) -> RealSurface:
    """The crowns of the trees as a box, 4 to 22 m over the ground."""
    toward = latlong_to_direction(TREES_TOWARD / 1024, 0.5)
    crowns = box((-25.0, near, 4.0), (25.0, 70.0, 22.0), "-x+x-y+y-z+z")
    turn = np.array([[toward[1], -toward[0], 0.0], [toward[0], toward[1], 0.0], [0.0, 0.0, 1.0]])
    return RealSurface("trees", Mesh((crowns.vertices @ turn).astype(np.float32), crowns.faces), Role.ENVIRONMENT)


def _known_albedo(scene: Scene) -> list[str]:
    view, places = PanoramaView(scene), np.array(GREY)
    seen = view.look(places)
    light = ExplainedLight(scene.panorama, scene.real).irradiance(seen.point, seen.normal, 1024)
    steps = [np.array([dx, dy]) for dx in (-1, 0, 1) for dy in (-1, 0, 1)]
    albedo = np.pi * np.mean([view.colour(places + step) for step in steps], axis=0) / light
    return [f"{x},{y} {r} {g} {b}" for (x, y), (r, g, b) in zip(GREY, albedo, strict=True)]


def _sun_of(radiance: NDArray[np.float32]) -> tuple[Vector, Vector]:
    """Irradiance from within one degree of the sun, on a surface that faces it, and its direction."""
    height, width = radiance.shape[:2]
    angles, directions = pixel_solid_angles(height, width)[:, None], pixel_directions(height, width)
    brightness = radiance.mean(axis=2)
    bright = brightness > 0.2 * brightness.max()
    middle = (directions * (angles * bright)[..., None]).sum(axis=(0, 1))
    middle /= np.linalg.norm(middle)
    near = directions @ middle > np.cos(np.radians(1.0))
    return (radiance * (angles * near)[..., None]).sum(axis=(0, 1), dtype=np.float64), middle


def _horizontal(radiance: NDArray[np.float32]) -> Vector:
    """Irradiance on level ground under all of a panorama's upper half."""
    height, width = radiance.shape[:2]
    weight = pixel_solid_angles(height, width)[:, None] * pixel_directions(height, width)[..., 2].clip(0.0)
    return np.asarray((radiance * weight[..., None]).sum(axis=(0, 1), dtype=np.float64))


def _off(ratio: Vector) -> str:
    return ", ".join(f"{100.0 * (each - 1.0):+.1f} %" for each in ratio)


def _percent(share: float) -> str:
    return f"{100.0 * share:.1f} %"
