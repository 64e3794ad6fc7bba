"""A lamp of the photograph that clipped: a point lamp marked real as a ``[[light]]`` table of the scene file, and back.

The lamp stands where the capture point sees the source. Its power and radius give the radiance, as of any lamp of Blender.
"""

import math
from collections.abc import Mapping
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix, Vector

from . import lights, roles
from .images import from_rec709
from .picking import capture_pose, panorama_coordinates, panorama_direction

FAR = 50.0
"""Metres from the capture point at which a source stands that no real surface is behind."""
BEFORE = 0.98
"""Share of the way to the real surface behind it at which a lamp stands."""
SMALLEST_ANGLE = math.radians(0.5)
"""Half the angle that a lamp gets which stands for all that clipped around its middle."""
DIGITS = 6
"""Significant ones that Blender's numbers have."""


def clipped_table(name: str, item, to_world: Matrix, settings) -> tuple[dict[str, Any] | None, list[str]]:
    """The ``[[light]]`` table of a point lamp that is marked real.

    Args:
        name: unique.
        item: the lamp's object, evaluated.
        to_world: its matrix.
        settings: of the scene.

    Returns:
        The table, ``None`` where the lamp gives no light or has no size, and notes on what is not supported.
    """
    power, notes = lights.strength(name, item.data)
    if max(power) <= 0.0:
        return None, notes
    radius = item.data.shadow_soft_size
    if radius <= 0.0 and lights.normalized(item.data):
        return None, [*notes, f"Light '{name}': a real lamp needs a radius, which gives its radiance; it is left out"]
    pose, (width, height) = capture_pose(settings), settings.image.size
    u, v = panorama_coordinates(pose.to_3x3().transposed() @ (to_world.translation - pose.translation))
    factor = lights.sphere_radiance(item.data, radius)
    table: dict[str, Any] = {
        "type": "clipped",
        "name": name,
        "pixel": [round(min(share * size, size - 0.001), 3) for share, size in ((u, width), (v, height))],
        "radiance": [_rounded(channel * factor) for channel in power],
    }
    if item.lightdepth.clipped_diameter > 0.0:
        table["diameter"] = _rounded(math.degrees(item.lightdepth.clipped_diameter))
    return table, notes


def show_clipped(context, name: str, table: Mapping[str, Any]) -> None:
    """Make or change the point lamp that stands for a clipped source.

    Args:
        context: Blender's.
        name: of the lamp.
        table: of the scene file.
    """
    settings = context.scene.lightdepth
    item = context.scene.objects.get(name)
    if item is None or item.type != "LIGHT" or item.data.type != "POINT":
        item = bpy.data.objects.new(name, bpy.data.lights.new(name, "POINT"))
        context.scene.collection.objects.link(item)
    pose, (width, height) = capture_pose(settings), settings.image.size
    x, y = (float(value) for value in table["pixel"])
    direction = pose.to_3x3() @ panorama_direction(x / width, y / height)
    distance = BEFORE * _distance(context, pose.translation, direction)
    diameter = math.radians(table.get("diameter") or 0.0)
    light = item.data
    item.location = pose.translation + distance * direction
    light.shadow_soft_size = distance * math.tan(0.5 * diameter or SMALLEST_ANGLE)
    lights.make_plain(light)
    radiance = from_rec709(np.array(table["radiance"], np.float32))
    strongest = max(float(radiance.max()), 1e-30)
    light.color, light.energy = radiance / strongest, strongest / lights.sphere_radiance(light, light.shadow_soft_size)
    item.lightdepth.real_light, item.lightdepth.clipped_diameter = True, diameter


def _distance(context, origin: Vector, direction: Vector) -> float:
    """Metres to the first real surface, or ``FAR``."""
    graph, start = context.evaluated_depsgraph_get(), origin
    while True:
        hit, place, _, _, item, _ = context.scene.ray_cast(graph, start, direction)
        if not hit:
            return FAR
        if item.lightdepth.role in roles.REAL:
            return (place - origin).length
        start = place + 1e-4 * direction


def _rounded(value: float) -> float:
    return float(f"{value:.{DIGITS}g}")
