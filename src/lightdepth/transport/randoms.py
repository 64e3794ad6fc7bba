"""Random numbers for one camera path: well spread over a pixel's samples where it pays, independent elsewhere."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

STEPS = {
    "film": (0.7548776662, 0.5698402910),
    "lens": (0.7548776662, 0.5698402910),
    "light": (0.6180339887,),
    "candidate": (0.4142135624,),
    "direction": (0.8191725134, 0.6710436067, 0.5497004779),
}
"""Additive recurrences by what they are for: the golden ratio and its relatives in two and three dimensions."""


@dataclass
class Randoms:
    """Random numbers of a path.

    The first scattering decides most of a pixel's noise, so its choices step through low-discrepancy sequences along
    the pixel's samples, shifted at random from pixel to pixel; all later choices are independent.

    Attributes:
        generator: independent numbers.
        pixel: of the path.
        index: of the path's sample within its pixel.
    """

    generator: mi.PCG32
    pixel: mi.UInt32
    index: mi.UInt32

    def next(self, active: mi.Bool | bool = True) -> mi.Float:
        """An independent number, uniform in [0, 1)."""
        return self.generator.next_float32(active)

    def direction(self, first: mi.Bool, active: mi.Bool) -> tuple[mi.Float, mi.Float, mi.Float]:
        """Three numbers to draw a direction with, well spread at the ``first`` scattering."""
        x, y, z = self.spread("direction")
        choice = dr.select(first, x, self.next(active))
        return choice, dr.select(first, y, self.next(active)), dr.select(first, z, self.next(active))

    def spread(self, name: str) -> list[mi.Float]:
        """Numbers in [0, 1) that are well spread over the pixel's samples.

        Args:
            name: what they are for, a key of ``STEPS``.
        """
        numbers = []
        for dimension, step in enumerate(STEPS[name]):
            salt = 16 * list(STEPS).index(name) + dimension
            shift, _ = mi.sample_tea_32(self.pixel, mi.UInt32(salt))
            fixed_point = shift + self.index * mi.UInt32(round(step * 2**32))
            numbers.append(mi.Float(fixed_point >> 8) * (1.0 / 2**24))
        return numbers


def begin_path(pixel: mi.UInt32, index: mi.UInt32, seed: mi.UInt32) -> Randoms:
    """Random numbers for sample ``index`` of ``pixel``; the same arguments give the same numbers."""
    first, second = mi.sample_tea_32(pixel, index)
    third, fourth = mi.sample_tea_32(seed, mi.UInt32(0))
    generator = mi.PCG32()
    generator.seed(mi.UInt64(first ^ third), mi.UInt64(second ^ fourth))
    return Randoms(generator, pixel ^ third, index)
