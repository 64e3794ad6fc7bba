"""Weights of the photographs at a point of the place: docs/theory.md, section 9, eq. (10) to (12).

The weights add up to 1. They are the one place where photographs are compared: plate, albedo and light all use them.
"""

from __future__ import annotations

import operator
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce

import drjit as dr
import mitsuba as mi

from lightdepth.parameters.place import DEFAULT

SAME_DIRECTION = 1e-13
"""Squared angle below which a photograph is taken to have been made from where the point is looked at."""
WRONG_SIDE = 1e-6
"""Where no photograph sees a point, one that looks at it from the other side counts if there is no better one."""
SMALLEST = 1e-30


@dataclass
class Sighting:
    """How one photograph sees points of the place.

    Attributes:
        toward: from its capture point to the points, unit, world.
        direction: the same in light space.
        solid_angle: at the capture point, of a square metre of the surface; 1 for sky.
        texels: for each square metre of the surface, or each steradian of the sky.
        seen: whether its light samples lie there.
        unseen: whether the capture point certainly does not see the points.
        clarity: in [0, 1]: 0 where it does not see them, little beside edges of what hides something.
        counts: share to which the photograph's mask lets them count.
    """

    toward: mi.Vector3f
    direction: mi.Vector3f
    solid_angle: mi.Float
    texels: mi.Float
    seen: mi.Bool
    unseen: mi.Bool
    clarity: mi.Float
    counts: mi.Float


@dataclass
class Weights:
    """How much each photograph counts.

    Attributes:
        shares: of each photograph; they add up to 1.
        sides: which photographs look at the points from the same side.
        seen: whether any of these counts.
        unseen: whether certainly none does.
    """

    shares: list[mi.Float]
    sides: list[mi.Bool]
    seen: mi.Bool
    unseen: mi.Bool


def weigh(
    sightings: Sequence[Sighting],
    normal: mi.Vector3f,
    finite: mi.Bool,
    direction: mi.Vector3f | None = None,
    origin: mi.Point3f | None = None,
    captures: Sequence[mi.Point3f] = (),
    sky_distance: float = DEFAULT.sky_distance,
) -> Weights:
    """Weigh the photographs for points.

    Args:
        sightings: of the points, by each photograph.
        normal: of the surface there, either side, unit, world.
        finite: false for sky.
        direction: of view toward the points, unit, world; ``None``: from any side.
        origin: of the camera that sees them, world, metres; the nearer its direction is to a photograph's, the more this
            one counts. ``None``: what they send to surfaces, in which the direction plays no part.
        captures: capture points of the photographs; needed with ``origin``.
        sky_distance: metres to which the sky is brought for comparing directions.
    """
    sides = [mi.Bool(True) for _ in sightings]
    if direction is not None:
        side = dr.dot(normal, direction)
        sides = [~finite | (side * dr.dot(normal, sighting.toward) > 0.0) for sighting in sightings]
    texels = [dr.maximum(sighting.texels, SMALLEST) for sighting in sightings]
    quality = texels
    if origin is not None and direction is not None:
        quality = [
            value
            * dr.rsqrt(_squared_angle(sighting, finite, direction, origin, capture, sky_distance) + SAME_DIRECTION)
            for value, sighting, capture in zip(texels, sightings, captures, strict=True)
        ]
    counting = [
        dr.select(same_side & (sighting.counts > 0.0), sighting.clarity, 0.0)
        for same_side, sighting in zip(sides, sightings, strict=True)
    ]
    best, any_seen = _shares(quality, counting)
    # What a mask takes from one photograph goes to the others, whichever is looked from.
    masked = [value * sighting.counts for value, sighting in zip(counting, sightings, strict=True)]
    others, _ = _shares(texels, masked)
    kept = [share * sighting.counts for share, sighting in zip(best, sightings, strict=True)]
    rest = dr.maximum(1.0 - reduce(operator.add, kept), 0.0)
    unhidden, _ = _shares(quality, [mi.Float(dr.select(same_side, 1.0, WRONG_SIDE)) for same_side in sides])
    shares = [
        dr.select(any_seen, share + rest * other, fallback)
        for share, other, fallback in zip(kept, others, unhidden, strict=True)
    ]
    unseen = mi.Bool(True)
    for same_side, sighting in zip(sides, sightings, strict=True):
        unseen &= sighting.unseen | ~same_side | (sighting.counts <= 0.0)
    return Weights(shares, sides, any_seen, unseen & ~any_seen)


def _shares(quality: Sequence[mi.Float], factor: Sequence[mi.Float]) -> tuple[list[mi.Float], mi.Bool]:
    """Shares in proportion to the square of a quality, times a factor; and whether any factor is above 0."""
    best = mi.Float(SMALLEST)
    for value, share in zip(quality, factor, strict=True):
        best = dr.maximum(best, dr.select(share > 0.0, value, 0.0))
    relative = [share * dr.square(value / best) for value, share in zip(quality, factor, strict=True)]
    total = reduce(operator.add, relative)
    # By division, so that one photograph that counts alone has exactly 1.
    return [value / dr.maximum(total, SMALLEST) for value in relative], total > 0.0


def _squared_angle(
    sighting: Sighting,
    finite: mi.Bool,
    direction: mi.Vector3f,
    origin: mi.Point3f,
    capture: mi.Point3f,
    sky_distance: float,
) -> mi.Float:
    """Between the direction of looking and the photograph's own, for small angles; 4 where they are opposite."""
    near = dr.squared_norm(direction - sighting.toward)
    far = dr.squared_norm(origin - capture) * (1.0 / sky_distance**2)
    return dr.select(finite, near, far)
