"""How far a photograph is trusted near the edges of what hides something from it, and near its mask (theory, section 9)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

WIDTH = 1.5
"""Degrees over which a photograph fades out toward an edge;"""
FEWEST_PIXELS = 4.0
"""but so many pixels of it at least."""
UNSURE = 1.0
"""Pixels beside an edge that may lie on either side of it."""
JUMP = 0.03
"""Relative deviation of a distance's reciprocal from its continuation along the surface, above which another one begins."""
LEAST = 1e-6
"""Where a photograph fades out and no other one sees the surface, it counts all the same."""


def edge_feather(depth: NDArray[np.float32]) -> NDArray[np.float32]:
    """1 away from where distances jump, falling to ``LEAST`` at the jump.

    The reciprocal of the distance is linear along a plane, however slanted: a jump is where it cannot be continued from
    either side.

    Args:
        depth: of a panorama, metres, inf for sky, shape (h, 2 h).
    """
    inverse = 1.0 / depth
    edges = np.zeros(depth.shape, bool)
    for axis in (0, 1):
        before, there, after, beyond = (np.roll(inverse, shift, axis=axis) for shift in (1, 0, -1, -2))
        forward, backward = np.abs(2.0 * there - before - after), np.abs(2.0 * after - beyond - there)
        jumps = np.minimum(forward, backward) > JUMP * np.maximum(there, after)
        if axis == 0:  # Rows do not go on over the poles.
            jumps[0], jumps[-2:] = False, False
        edges |= jumps | np.roll(jumps, 1, axis=axis)
    return np.maximum(_faded(edges), np.float32(LEAST))


def mask_feather(mask: NDArray[np.float32]) -> NDArray[np.float32]:
    """A mask that fades in beyond what it leaves out, shape (h, 2 h), in [0, 1]; 0 stays 0."""
    return np.minimum(mask, _faded(mask <= 0.0))


def _faded(edges: NDArray[np.bool_]) -> NDArray[np.float32]:
    """Smooth steps from 0 at marked pixels to 1 at the feather's width from them."""
    width = max(WIDTH / 180.0 * len(edges), FEWEST_PIXELS)
    if not edges.any():
        return np.ones(edges.shape, np.float32)
    margin = int(np.ceil(width + UNSURE)) + 1
    margin = min(margin, edges.shape[1])
    around = np.concatenate([edges[:, -margin:], edges, edges[:, :margin]], axis=1)
    distance = cv2.distanceTransform(np.where(around, 0, 255).astype(np.uint8), cv2.DIST_L2, 5)[:, margin:-margin]
    t = np.clip((distance - UNSURE) / width, 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t), np.float32)
