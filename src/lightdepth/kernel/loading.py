"""Making Mitsuba's objects, so that the same scene always gives the same kernels.

The module is imported after ``kernel.start``.
"""

from __future__ import annotations

from typing import Any

import mitsuba as mi


def load(description: dict[str, Any]) -> Any:
    """``mi.load_dict``, one object after the other.

    In parallel, Mitsuba's default, objects are numbered in the order in which threads happen to finish. The numbers go
    into the kernels, which then are compiled again in the next process instead of being found in Dr.Jit's cache.

    Args:
        description: Mitsuba's description of a scene, shape, material, texture or emitter.

    Raises:
        RuntimeError, ValueError, TypeError: Mitsuba does not accept it.
    """
    return mi.load_dict(description, parallel=False, optimize=False)
