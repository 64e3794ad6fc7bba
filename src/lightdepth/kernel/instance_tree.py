"""A tree of boxes around instances, in an order for each octant of directions in which rays go through it without a stack.

The tree is complete: node i has the children 2 i + 1 and 2 i + 2. Of each node it is known where rays go on that miss it or
have seen all below it (Smits, "Efficiency issues for ray tracing", Journal of Graphics Tools 3(2), 1998).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

END = 0xFFFFFFFF
"""Where there is no further node."""
OCTANTS = 8


@dataclass(frozen=True)
class InstanceTree:
    """A complete tree of n leaves, n a power of two.

    Attributes:
        low: smallest coordinates of the nodes' boxes, shape (2 n - 1, 3), float64; inf where a box is empty.
        high: the largest, -inf where a box is empty.
        axis: along which the children of each node lie beside each other, shape (2 n - 1,), int64.
        onward: node after each one and all below it, END where there is none, for directions of which the bits of the
            octant are set along the axes where they are negative; shape (8, 2 n - 1), uint32.
        leaves: which instance each leaf has, shape (n,), int64; -1 for none.
    """

    low: NDArray[np.float64]
    high: NDArray[np.float64]
    axis: NDArray[np.int64]
    onward: NDArray[np.uint32]
    leaves: NDArray[np.int64]


def instance_tree(low: NDArray[np.float64], high: NDArray[np.float64]) -> InstanceTree:
    """The tree of some boxes, at least one, each of shape (n, 3)."""
    depth = (len(low) - 1).bit_length()
    leaves, axes = _sorted_into_leaves(0.5 * (low + high), depth)
    first, count = (1 << depth) - 1, (2 << depth) - 1
    lows, highs = np.full((count, 3), np.inf), np.full((count, 3), -np.inf)
    taken = leaves >= 0
    lows[first:][taken], highs[first:][taken] = low[leaves[taken]], high[leaves[taken]]
    axis, onward = np.zeros(count, np.int64), np.full((OCTANTS, count), END, np.uint32)
    for level in reversed(range(depth)):
        nodes = _nodes(level)
        lows[nodes] = np.minimum(lows[2 * nodes + 1], lows[2 * nodes + 2])
        highs[nodes] = np.maximum(highs[2 * nodes + 1], highs[2 * nodes + 2])
        axis[nodes] = axes[level]
    for level in range(depth):
        nodes = _nodes(level)
        for octant in range(OCTANTS):
            backward = (octant >> axis[nodes]) & 1
            onward[octant, 2 * nodes + 1 + backward] = 2 * nodes + 2 - backward
            onward[octant, 2 * nodes + 2 - backward] = onward[octant, nodes]
    return InstanceTree(lows, highs, axis, onward, leaves)


def _nodes(level: int) -> NDArray[np.int64]:
    return np.arange((1 << level) - 1, (2 << level) - 1)


def _sorted_into_leaves(centres: NDArray[np.float64], depth: int) -> tuple[NDArray[np.int64], list[NDArray[np.int64]]]:
    """Instances by leaf, -1 for none, and the axes of the nodes of each level: halves along the longest side."""
    leaves = np.full(1 << depth, -1, np.int64)
    leaves[: len(centres)] = np.arange(len(centres))
    axes = []
    for level in range(depth):
        parts = leaves.reshape(1 << level, -1)
        taken = parts >= 0
        places = centres[parts]
        extent = np.where(taken[..., None], places, -np.inf).max(axis=1)
        extent -= np.where(taken[..., None], places, np.inf).min(axis=1)
        axes.append(extent.argmax(axis=1))
        along = np.take_along_axis(places, axes[-1][:, None, None], axis=2)[..., 0]
        order = np.argsort(np.where(taken, along, np.inf), axis=1, kind="stable")
        ordered = np.take_along_axis(parts, order, axis=1)
        # Each half takes half of the instances; the rest of its leaves stays empty.
        rank, count = np.arange(parts.shape[1]), taken.sum(axis=1)[:, None]
        left = (count + 1) // 2
        leaves = np.full(parts.shape, -1, np.int64)
        row, column = np.nonzero(np.broadcast_to(rank < count, parts.shape))
        target = np.where(rank < left, rank, rank - left + parts.shape[1] // 2)
        leaves[row, target[row, column]] = ordered[row, column]
    return leaves.reshape(-1), axes
