"""A sun of the real place: a lamp marked real as a ``[[light]]`` table of the scene file."""

import math
import os
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix, Vector

from . import lights

SMALLEST, LARGEST = 0.05, 10.0
"""Diameters in degrees that a sun can have."""
SAME_DIRECTION = 0.05
"""Degrees by which a sun may be turned and keep its mask."""


def toward(to_world: Matrix) -> Vector:
    """The direction toward the sun of a lamp's matrix: lamps shine along their -z."""
    return (to_world.to_quaternion() @ Vector((0.0, 0.0, 1.0))).normalized()


def across(direction: Vector, point) -> tuple[float, float]:
    """Coordinates of a point in the plane across a direction, in which masks lie: to the right, which is level, and up."""
    right = Vector((0.0, 0.0, 1.0)).cross(direction)
    right = Vector((1.0, 0.0, 0.0)) if right.length < 1e-6 else right.normalized()
    return float(right.dot(Vector(point))), float(direction.cross(right).dot(Vector(point)))


def sun_table(
    name: str, item, to_world: Matrix, folder: Path, origin: np.ndarray
) -> tuple[dict[str, Any] | None, list[str]]:
    """The ``[[light]]`` table of a lamp that is marked real.

    Args:
        name: unique.
        item: the lamp's object, evaluated.
        to_world: its matrix.
        folder: of the scene file.
        origin: of the scene file in Blender's world, shape (3,).

    Returns:
        The table, ``None`` where the lamp gives no light or cannot be real, and notes on what is not supported.
    """
    light, settings = item.data, item.lightdepth
    irradiance, notes = lights.strength(name, light)
    if max(irradiance) <= 0.0:
        return None, notes
    diameter = min(max(math.degrees(light.angle), SMALLEST), LARGEST)
    if abs(diameter - math.degrees(light.angle)) > 1e-4:
        notes.append(f"Light '{name}': its angle became {diameter:g} degrees")
    if not lights.normalized(light):
        irradiance = [value * math.pi * math.sin(math.radians(0.5 * diameter)) ** 2 for value in irradiance]
    direction = toward(to_world)
    table = {"type": "sun", "name": name, "direction": list(direction), "diameter": diameter, "irradiance": irradiance}
    if settings.recover_mask:
        table["mask"] = "recover"
    elif settings.mask:
        if direction.angle(Vector(settings.mask_direction), math.pi) > math.radians(SAME_DIRECTION):
            notes.append(
                f"Light '{name}': it was rotated after its mask was made; the mask no longer fits and is left out"
            )
        else:
            path = Path(bpy.path.abspath(settings.mask))
            shift = across(direction, origin)
            table["mask"] = Path(os.path.relpath(path, folder)).as_posix()
            table["mask_extent"] = [edge - shift[index % 2] for index, edge in enumerate(settings.mask_extent)]
    return table, notes
