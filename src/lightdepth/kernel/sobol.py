"""Sobol's sequence, whose points are even in every dimension and every pair of them."""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

POLYNOMIALS = (
    (1, 0, (1,)),
    (2, 1, (1, 3)),
    (3, 1, (1, 3, 1)),
    (3, 2, (1, 1, 1)),
    (4, 1, (1, 1, 3, 3)),
    (4, 4, (1, 3, 5, 13)),
    (5, 2, (1, 1, 5, 5, 17)),
    (5, 4, (1, 1, 5, 5, 5)),
    (5, 7, (1, 1, 7, 11, 19)),
    (5, 11, (1, 1, 5, 1, 1)),
)
"""Degree, coefficients and initial direction numbers of the dimensions from 1 on, by Joe and Kuo 2008."""
BITS = 16
"""Of a point's number, and of its coordinates; after 2^16 points, the sequence begins again."""


def sobol_points(count: int, dimensions: int, seed: int | None = None) -> NDArray[np.float64]:
    """The first points of the sequence, in [0, 1), shape (count, dimensions).

    Args:
        count: how many; powers of two are even.
        dimensions: how many, at most one more than ``POLYNOMIALS``.
        seed: of a random shift of their binary digits (Kollig and Keller 2002), which keeps them even; by default there
            is none, and the first point is 0.
    """
    index = np.arange(count, dtype=np.uint32)
    digits = np.zeros((count, dimensions), np.uint32)
    for bit in range(BITS):
        numbers = [1 << bit, *(direction_numbers(*POLYNOMIALS[other])[bit] for other in range(dimensions - 1))]
        digits ^= (index >> bit & 1)[:, None] * np.array(numbers, np.uint32)
    below = np.zeros(dimensions)
    if seed is not None:
        generator = np.random.default_rng(seed)
        digits ^= generator.integers(0, 1 << BITS, dimensions, np.uint32)
        below = generator.random(dimensions)
    places = 0.5 ** np.arange(1, BITS + 1)
    return (digits[..., None] >> np.arange(BITS, dtype=np.uint32) & 1) @ places + below * places[-1]


@cache  # Every kernel that is traced asks for them.
def direction_numbers(degree: int, coefficients: int, first: tuple[int, ...]) -> tuple[int, ...]:
    """What each bit of an index changes in a dimension's binary digits, the first of these in the lowest bit.

    Args:
        degree: of the dimension's polynomial.
        coefficients: its inner ones as bits, that of the second highest power first.
        first: the numbers that its recurrence begins with, as many as its degree.
    """
    numbers = list(first)
    for bit in range(degree, BITS):
        number = numbers[bit - degree] ^ (numbers[bit - degree] << degree)
        for power in range(1, degree):
            if coefficients >> (degree - 1 - power) & 1:
                number ^= numbers[bit - power] << power
        numbers.append(number)
    # The n-th has n + 1 digits, which are the first ones behind the point.
    return tuple(int(f"{number:0{bit + 1}b}"[::-1], 2) for bit, number in enumerate(numbers))
