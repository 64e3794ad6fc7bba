"""The new objects made ready: shapes, bounds, and the scenes that rays meet them in."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import mitsuba as mi

from lightdepth.kernel.shapes import SyntheticShapes, is_polished, synthetic_shapes
from lightdepth.parameters.transport import TransportParameters
from lightdepth.place.object_bounds import ObjectBounds
from lightdepth.place.object_outline import ObjectOutline
from lightdepth.preparation.removed import removed_shape
from lightdepth.scene.model import Scene


@dataclass(frozen=True, eq=False)
class PreparedObjects:
    """The synthetic objects of a scene.

    Attributes:
        shapes: of them.
        bounds: spheres around them; ``None`` without objects.
        polished: spheres around those with a narrow specular lobe; ``None`` where there are none.
        outline: spheres around their parts; ``None`` without objects.
        removed: stands for the real surfaces that are removed, of which ``bounds`` has spheres too; ``None`` without.
    """

    shapes: SyntheticShapes
    bounds: ObjectBounds | None
    polished: ObjectBounds | None
    outline: ObjectOutline | None = None
    removed: mi.Shape | None = None


def prepare_objects(scene: Scene) -> PreparedObjects:
    """Make the objects of a scene ready.

    Raises:
        InputError: Mitsuba refuses a material.
    """
    shapes = synthetic_shapes(scene)
    tuned = scene.render.parameters.transport
    spheres = shapes.spheres
    polished = [sphere for sphere, (_, shape) in zip(spheres, shapes.numbered, strict=True) if is_polished(shape)]
    removed, around = removed_shape(scene)
    outline = None
    if spheres or around:
        parts = [*shapes.parts, *((sphere, None) for sphere in around)]
        outline = ObjectOutline(parts, shapes.around_instances, tuned)
    return PreparedObjects(shapes, _bounds([*spheres, *around], tuned), _bounds(polished, tuned), outline, removed)


def _bounds(spheres: Sequence[tuple], tuned: TransportParameters) -> ObjectBounds | None:
    return ObjectBounds(spheres, tuned) if spheres else None
