"""A camera that a file describes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Y_UP_TO_Z_UP = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
"""(x, y, z) becomes (x, -z, y)."""
MOST_LISTED = 20
"""Names in a message."""


@dataclass(frozen=True)
class FileCamera:
    """A camera of a file.

    Attributes:
        position: shape (3,), float64, metres, z up.
        rotation: camera space (x to the right, y forward, z up) to the file's, z up, shape (3, 3), float64.
        vertical_fov: degrees.
        aspect: width over height of its picture; ``None`` where the file does not say.
    """

    position: NDArray[np.float64]
    rotation: NDArray[np.float64]
    vertical_fov: float
    aspect: float | None


def turned(linear: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """The rotation in a matrix of shape (3, 3): where it looks and its upright, without scale, shear and mirroring.

    The camera looks along -z and has y up, as in glTF and USD. ``None`` where the matrix scales to nothing.
    """
    back, up = linear[:, 2], linear[:, 1]
    right = np.cross(up, back)
    if not min(np.linalg.norm(back), np.linalg.norm(right)) > 0.0:
        return None
    back, right = back / np.linalg.norm(back), right / np.linalg.norm(right)
    return np.stack([right, np.cross(back, right), back], axis=1)


def listed(names: list[str]) -> str:
    """Names for a message, in quotes."""
    more = f" and {len(names) - MOST_LISTED} more" if len(names) > MOST_LISTED else ""
    return ", ".join(f"'{name[:60]}'" for name in names[:MOST_LISTED]) + more
