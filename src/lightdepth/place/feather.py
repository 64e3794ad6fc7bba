"""The feather of a photograph near occlusion edges and near its mask (theory, section 9)."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.parameters.place import DEFAULT, PlaceParameters

LEAST = 1e-6
"""Where a photograph fades out and no other one sees the surface, it still counts."""


def edge_feather(depth: NDArray[np.float32], tuned: PlaceParameters = DEFAULT) -> NDArray[np.float32]:
    """1 away from where distances jump, falling to ``LEAST`` at the jump.

    The reciprocal of the distance is linear along a plane, however slanted: a jump is where it cannot be continued from
    either side.

    Args:
        depth: of a panorama, metres, inf for sky, shape (h, 2 h).
        tuned: what an edge is, and how wide the feather.
    """
    inverse = 1.0 / depth
    edges = np.zeros(depth.shape, bool)
    for axis in (0, 1):
        before, there, after, beyond = (np.roll(inverse, shift, axis=axis) for shift in (1, 0, -1, -2))
        forward, backward = np.abs(2.0 * there - before - after), np.abs(2.0 * after - beyond - there)
        jumps = np.minimum(forward, backward) > tuned.depth_jump * np.maximum(there, after)
        if axis == 0:  # Rows do not go on over the poles.
            jumps[0], jumps[-2:] = False, False
        edges |= jumps | np.roll(jumps, 1, axis=axis)
    return np.maximum(_faded(edges, tuned), np.float32(LEAST))


def mask_feather(mask: NDArray[np.float32], tuned: PlaceParameters = DEFAULT) -> NDArray[np.float32]:
    """A mask that fades in beyond what it leaves out, shape (h, 2 h), in [0, 1]; 0 stays 0."""
    return np.minimum(mask, _faded(mask <= 0.0, tuned))


def _faded(edges: NDArray[np.bool_], tuned: PlaceParameters) -> NDArray[np.float32]:
    """Smooth steps from 0 at marked pixels to 1 at the feather's width from them."""
    width = max(tuned.feather / 180.0 * len(edges), tuned.fewest_feather_pixels)
    if not edges.any():
        return np.ones(edges.shape, np.float32)
    margin = int(np.ceil(width + tuned.unsure_pixels)) + 1
    margin = min(margin, edges.shape[1])
    around = np.concatenate([edges[:, -margin:], edges, edges[:, :margin]], axis=1)
    distance = cv2.distanceTransform(np.where(around, 0, 255).astype(np.uint8), cv2.DIST_L2, 5)[:, margin:-margin]
    t = np.clip((distance - tuned.unsure_pixels) / width, 0.0, 1.0)
    return np.asarray(t * t * (3.0 - 2.0 * t), np.float32)
