"""Light samples that many paths share: drawn once, traced once, and then picked by uniform random numbers ``u``.

This is the presampled light list of resampled importance sampling (Talbot et al. 2005): paths take their RIS candidates
from it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from lightdepth.kernel.arrays import aligned


@dataclass
class LightSample:
    """Points that emit light, drawn from the map.

    Attributes:
        position: world, metres where ``finite``, else the unit direction toward the sky, world.
        normal: of the real surface there, unit, world.
        density: per square metre of that surface where ``finite``, else per steradian; 0: the sample is void.
        radiance: M there.
        finite: false for sky.
        on_relit: on a surface that is relit in full, so that its light is no light of the new scene.
        light: index of its light among those of the place; 0 is the photograph.
    """

    position: mi.Vector3f
    normal: mi.Vector3f
    density: mi.Float
    radiance: mi.Color3f
    finite: mi.Bool
    on_relit: mi.Bool
    light: mi.UInt32


class LightList:
    """Light samples laid out for lookups by uniform random numbers; immutable, so that renderings cannot interfere.

    In two packets of four, so that one is fetched with two loads from one line of the processor's cache: RIS
    candidates lie far apart. Signs mark the sky and relit surfaces. The radiance lies by itself, since few of
    them need it.

    Args:
        samples: the light samples.
        count: how many.
    """

    def __init__(self, samples: LightSample, count: int) -> None:
        largest = dr.max(samples.radiance)
        packets = (
            mi.Vector4f(*samples.position, dr.select(samples.finite, samples.density, -samples.density)),
            mi.Vector4f(*samples.normal, dr.select(samples.on_relit, -largest, largest)),
            mi.Vector4f(*samples.radiance, 0.0),
        )
        dr.eval(packets)
        index = dr.arange(mi.UInt32, count)
        self._outlines, self._radiance = dr.zeros(mi.Float, 8 * count), dr.zeros(mi.Float, 4 * count)
        dr.scatter(self._outlines, packets[0], 2 * index)
        dr.scatter(self._outlines, packets[1], 2 * index + 1)
        dr.scatter(self._radiance, packets[2], index)
        dr.eval(self._outlines, self._radiance)
        self._count = dr.opaque(mi.UInt32, count)

    def sample(self, u: mi.Float, active: mi.Bool) -> LightSample:
        """Pick light samples by uniform random numbers in [0, 1)."""
        light = self.outline(u, active)
        radiance = dr.gather(mi.Vector4f, self._radiance, self._index(u), active)
        return replace(light, radiance=mi.Color3f(radiance.x, radiance.y, radiance.z))

    def outline(self, u: mi.Float, active: mi.Bool) -> LightSample:
        """The same without their colour, which takes less time: every channel of their radiance is the largest one."""
        index = 2 * self._index(u)
        first = dr.gather(mi.Vector4f, self._outlines, index, active)
        second = dr.gather(mi.Vector4f, self._outlines, index + 1, active)
        finite = first.w >= 0.0
        return LightSample(
            mi.Vector3f(first.x, first.y, first.z),
            mi.Vector3f(second.x, second.y, second.z),
            dr.abs(first.w),
            mi.Color3f(dr.abs(second.w)),
            finite,
            finite & (second.w < 0.0),
            mi.UInt32(0),
        )

    def _index(self, u: mi.Float) -> mi.UInt32:
        """Where in the list the light samples are that uniform random numbers pick."""
        return dr.minimum(mi.UInt32(u * mi.Float(self._count)), self._count - 1)


def joined(samples: Sequence[LightSample], counts: Sequence[int]) -> LightSample:
    """Light samples one after the other, ``counts`` of each."""

    def joined(name: str) -> Any:
        values = [getattr(sample, name) for sample in samples]
        kind, scalar = type(values[0]), type(values[0]) in (mi.Float, mi.Bool, mi.UInt32)
        rows = [np.asarray(value.numpy()).reshape(1 if scalar else 3, -1) for value in values]
        wide = [np.broadcast_to(row, (len(row), count)) for row, count in zip(rows, counts, strict=True)]
        columns = [aligned(column, column.dtype) for column in np.concatenate(wide, axis=1)]
        return kind(columns[0]) if scalar else kind(*map(mi.Float, columns))

    return LightSample(*(joined(field.name) for field in fields(LightSample)))
