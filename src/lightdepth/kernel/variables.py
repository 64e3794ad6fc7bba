"""Values that may change from rendering to rendering without compiling a kernel again."""

from __future__ import annotations

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import ArrayLike, NDArray

from lightdepth.kernel.arrays import aligned_columns


def as_vectors(rows: NDArray) -> mi.Vector3f:
    """Vectors or points of shape (n, 3)."""
    return mi.Vector3f(*map(mi.Float, aligned_columns(rows)))


def as_point(point: ArrayLike) -> mi.Point3f:
    """A point of shape (3,)."""
    result = mi.Point3f([float(value) for value in np.asarray(point)])
    dr.make_opaque(result)
    return result


def as_matrix(matrix: ArrayLike) -> mi.Matrix3f:
    """A matrix of shape (3, 3)."""
    result = mi.Matrix3f(np.asarray(matrix, dtype=np.float32))
    dr.make_opaque(result)
    return result
