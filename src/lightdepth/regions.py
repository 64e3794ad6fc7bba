"""Connected regions of a panorama, which closes at its left and right edge and at its poles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components


def connected_regions(marked: NDArray[np.bool_]) -> tuple[NDArray[np.intp], int]:
    """Number the connected regions of marked pixels.

    Pixels are connected by their sides, the last column with the first one, and all pixels of the first and of the last
    row, which meet at a pole.

    Args:
        marked: shape (height, width) of an equirectangular panorama.

    Returns:
        The number of each pixel's region from 1 on, 0 where nothing is marked, and how many regions there are.
    """
    regions, count = label(marked)
    seam = np.stack([regions[:, 0], regions[:, -1]], axis=1)
    pairs = [seam[seam.all(axis=1)]]
    for pole in (regions[0], regions[-1]):
        touching = pole[pole > 0]
        pairs.append(np.stack([touching, np.broadcast_to(touching[:1], touching.shape)], axis=1))
    one, other = np.concatenate(pairs).T
    meeting = coo_array((np.ones(len(one)), (one, other)), shape=(count + 1, count + 1))
    # Number 0, what is not marked, meets nothing: it stays a component of its own, and the first.
    joined, numbers = connected_components(meeting, directed=False)
    return np.asarray(numbers, dtype=np.intp)[regions], int(joined) - 1
