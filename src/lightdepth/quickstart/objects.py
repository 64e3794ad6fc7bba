"""The new objects: how large they are, and side by side on the floor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lightdepth.directions import FloatArray
from lightdepth.errors import InputError
from lightdepth.parameters.quickstart import DEFAULT, QuickstartParameters
from lightdepth.scene.meshes import read_mesh_file
from lightdepth.scene.spot import extents

UNITS = {
    0.001: "millimetres",
    0.01: "centimetres",
    0.0254: "inches",
    0.3048: "feet",
    100.0: "hundreds of metres",
    1000.0: "kilometres",
    10.0: "tens of metres",
    0.1: "decimetres",
}


@dataclass(frozen=True)
class NewObject:
    """An object to put into the place.

    Attributes:
        name: unique.
        keys: those of its ``[[synthetic]]`` table, but for the place.
        scale: to be applied to the mesh; 1 for shapes.
        size: width, depth and height as it will stand, metres, shape (3,).
        words: what was changed about its size, or empty.
    """

    name: str
    keys: dict[str, Any]
    scale: float
    size: FloatArray
    words: str


def default_objects(tuned: QuickstartParameters = DEFAULT) -> list[NewObject]:
    """A chrome ball and a grey ball, by which light is judged on a film set."""
    size = np.full(3, 2.0 * tuned.ball)
    chrome = {"type": "metal", "name": "Cr", "roughness": 0.02}
    grey = {"type": "diffuse", "color": 0.18}
    return [
        NewObject(name, {"shape": "sphere", "radius": tuned.ball, "material": material}, 1.0, size, "")
        for name, material in (("chrome", chrome), ("grey", grey))
    ]


def read_objects(paths: Sequence[Path], largest: float, tuned: QuickstartParameters = DEFAULT) -> list[NewObject]:
    """Read the objects' sizes, and scale those whose size cannot be meant.

    Args:
        paths: mesh files.
        largest: longest side that the place holds, metres.
        tuned: what size is plausible.

    Raises:
        InputError: a file is missing or unreadable, or its mesh has no size.
    """
    objects: list[NewObject] = []
    for path in paths:
        meshes = [part.mesh for part in read_mesh_file(path, with_materials=False)]
        low, high = extents(meshes, np.eye(3), np.eye(3))
        longest = float((high - low).max())
        if not longest > 0.0:
            raise InputError(f"{path}: the mesh has no size")
        scale, words = plausible_scale(longest, min(tuned.largest_object, largest), tuned)
        names = [thing.name for thing in objects]
        stem = path.stem or "object"
        name = next(n for k in range(1, len(paths) + 2) if (n := stem if k == 1 else f"{stem}-{k}") not in names)
        objects.append(NewObject(name, {"mesh": path}, scale, (high - low) * scale, words))
    return objects


def plausible_scale(
    longest: float, largest: float = DEFAULT.largest_object, tuned: QuickstartParameters = DEFAULT
) -> tuple[float, str]:
    """A factor that makes a size plausible, 1 where it is, and what was done.

    Args:
        longest: the longest side as the file has it, taken for metres.
        largest: longest side that can be meant, metres.
        tuned: the shortest and the usual one.
    """
    if tuned.smallest_object <= longest <= largest:
        return 1.0, ""
    # Of the units that explain it, the one that gives the most usual size.
    fits = [unit for unit in UNITS if tuned.smallest_object <= longest * unit <= largest]
    found = f"its longest side is {_length(longest)} as the file has it, which cannot be meant"
    if fits:
        unit = min(fits, key=lambda unit: abs(np.log(longest * unit / tuned.usual_object)))
        return unit, f"guess: {found}; scaled as if it were in {UNITS[unit]}"
    scale = float(f"{min(tuned.usual_object, largest) / longest:.3g}")
    return scale, f"guess: {found}; scaled to {_length(longest * scale)}"


def _length(metres: float) -> str:
    return f"{1000.0 * metres:.3g} mm" if metres < 0.1 else f"{metres:.3g} m"


def offsets(objects: Sequence[NewObject], tuned: QuickstartParameters = DEFAULT) -> list[float]:
    """How far right of the group's middle each stands, metres, side by side in their order."""
    widths = [float(max(thing.size[0], thing.size[1])) for thing in objects]
    places, right = [], 0.0
    for index, width in enumerate(widths):
        right += tuned.gap * max(width, widths[index - 1]) if index else 0.0
        places.append(right + width / 2.0)
        right += width
    return [place - right / 2.0 for place in places]
