"""Are the new objects of a size that can be meant?"""

from __future__ import annotations

from collections.abc import Sequence

from lightdepth.checks.objects import is_lamp
from lightdepth.checks.problem import Problem, Severity
from lightdepth.checks.sampling import object_mesh
from lightdepth.parameters.checks import DEFAULT, ChecksParameters
from lightdepth.scene.model import SyntheticObject


def size_problems(objects: Sequence[SyntheticObject], tuned: ChecksParameters = DEFAULT) -> list[Problem]:
    """Find objects that are a few millimetres or many metres large; lamps may be, as suns are.

    Args:
        objects: the new objects.
        tuned: which sizes can be meant.
    """
    problems = []
    for thing in objects:
        if is_lamp(thing):
            continue
        vertices = object_mesh(thing).vertices
        sides = vertices.max(axis=0) - vertices.min(axis=0)
        longest = float(sides.max())
        if longest == 0.0 or tuned.smallest_object <= longest <= tuned.largest_object:
            continue
        unit, factor = ("mm", 1000.0) if longest < tuned.smallest_object else ("m", 1.0)
        x, y, z = (f"{factor * float(side):.3g}" for side in sides)
        problems.append(
            Problem(
                Severity.WARNING,
                f'[[synthetic]] "{thing.name}": is {x} x {y} x {z} {unit} large; is that meant? Lengths are metres: for a '
                "file in millimetres write `scale = 0.001`, in centimetres `scale = 0.01`",
            )
        )
    return problems
