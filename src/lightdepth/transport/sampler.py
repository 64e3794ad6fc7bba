"""Random numbers for one camera path: stratified over a pixel's samples where it pays, independent elsewhere."""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from lightdepth.kernel.sobol import BITS, POLYNOMIALS, direction_numbers

DIMENSIONS = {"film": (0, 1), "light": (2,), "candidate": (3,), "direction": (4, 5, 6), "lens": (7, 8)}
"""Dimensions of the sequence by what they are for."""


@dataclass
class Sampler:
    """Random numbers of a path.

    The first scattering decides most of a pixel's noise, so its choices, with the position on the film, are the dimensions
    of one Sobol sequence along the pixel's samples, shuffled and scrambled from pixel to pixel (Owen 1995); all later
    choices are independent.

    Attributes:
        generator: independent random numbers.
        pixel: of the path.
        index: of the path's sample within its pixel.
    """

    generator: mi.PCG32
    pixel: mi.UInt32
    index: mi.UInt32

    def next_1d(self, active: mi.Bool | bool = True) -> mi.Float:
        """An independent random number, uniform in [0, 1)."""
        return self.generator.next_float32(active)

    def direction(self, first: mi.Bool, active: mi.Bool) -> tuple[mi.Float, mi.Float, mi.Float]:
        """Three random numbers to draw a direction with, stratified at the ``first`` scattering."""
        x, y, z = self.stratified("direction")
        choice = dr.select(first, x, self.next_1d(active))
        return choice, dr.select(first, y, self.next_1d(active)), dr.select(first, z, self.next_1d(active))

    def stratified(self, name: str) -> list[mi.Float]:
        """Random numbers in [0, 1), stratified over the pixel's samples.

        Args:
            name: their use, a key of ``DIMENSIONS``.
        """
        sequence, shuffle = mi.sample_tea_32(self.pixel, self.index >> BITS)
        index = dr.brev(_scrambled(dr.brev(self.index & ((1 << BITS) - 1)), shuffle))
        values = []
        for dimension in DIMENSIONS[name]:
            scramble, _ = mi.sample_tea_32(sequence, mi.UInt32(dimension))
            digits = dr.brev(_scrambled(_reversed_sobol(index, dimension), scramble))
            values.append(mi.Float(digits >> 8) * (1.0 / 2**24))
        return values


def begin_path(pixel: mi.UInt32, index: mi.UInt32, seed: mi.UInt32) -> Sampler:
    """Random numbers for sample ``index`` of ``pixel``; the same arguments give the same."""
    first, second = mi.sample_tea_32(pixel, index)
    third, fourth = mi.sample_tea_32(seed, mi.UInt32(0))
    generator = mi.PCG32()
    generator.seed(mi.UInt64(first ^ third), mi.UInt64(second ^ fourth))
    return Sampler(generator, pixel ^ third, index)


def _scrambled(digits: mi.UInt32, seed: mi.UInt32) -> mi.UInt32:
    """A random permutation that changes each bit by the lower ones alone: Laine and Karras 2011, as Vegdahl 2021 has it.

    Of binary digits in reverse order it is the scrambling of Owen 1995, in which each depends on those before it.
    """
    digits = digits ^ (digits * 0x3D20ADEA)
    digits = (digits + seed) * ((seed >> 16) | 1)
    digits ^= digits * 0x05526C56
    return digits ^ (digits * 0x53A22864)


def _reversed_sobol(index: mi.UInt32, dimension: int) -> mi.UInt32:
    """Binary digits of points of the Sobol sequence, the first in the lowest bit."""
    if dimension == 0:
        return index & ((1 << BITS) - 1)
    digits = mi.UInt32(0)
    for bit, number in enumerate(direction_numbers(*POLYNOMIALS[dimension - 1])):
        digits = dr.select((index & (1 << bit)) != 0, digits ^ number, digits)
    return digits
