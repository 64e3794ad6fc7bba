"""Directions that no photograph shows, such as the tripod's nadir."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_matrix

MARK = (1.0, 0.0, 1.0)
"""Magenta, in units of the panorama's median: no place looks like that."""

_COARSE_WIDTH = 512


def mark(radiance: NDArray[np.float32], covered: NDArray[np.bool_]) -> NDArray[np.float32]:
    """The panorama with uncovered directions in magenta; shape (height, width, 3)."""
    level = float(np.median(radiance[covered])) if covered.any() else 1.0
    return np.where(covered[..., None], radiance, np.asarray(MARK, np.float32) * np.float32(2.0 * level))


def fill(radiance: NDArray[np.float32], covered: NDArray[np.bool_]) -> NDArray[np.float32]:
    """The panorama with uncovered directions filled smoothly from around them.

    The logarithm of radiance continues as a harmonic function on the sphere: it takes the values at the rim, has no
    extremum within, and is as smooth at the pole as elsewhere. It is solved for on a coarse grid, being smooth.

    Args:
        radiance: shape (height, width, 3), float32.
        covered: shape (height, width).
    """
    if covered.all() or not covered.any():
        return radiance
    height, width = covered.shape
    coarse = (min(width, _COARSE_WIDTH), min(width, _COARSE_WIDTH) // 2)
    share = cv2.resize(covered.astype(np.float32), coarse, interpolation=cv2.INTER_AREA)
    light = np.where(covered[..., None], radiance, 0.0).astype(np.float32)
    mean = cv2.resize(light, coarse, interpolation=cv2.INTER_AREA) / np.maximum(share, 1e-6)[..., None]
    known = share > 0.0
    logarithm = np.log(np.maximum(mean, 1e-6 * mean[known].max())).astype(np.float64)
    smooth = np.exp(_harmonic(logarithm, known)).astype(np.float32)
    # Wrapping round before enlarging leaves no seam at the back.
    pad = 4
    padded = np.concatenate([smooth[:, -pad:], smooth, smooth[:, :pad]], axis=1)
    factor = width / coarse[0]
    size = (round(padded.shape[1] * factor), height)
    enlarged = cv2.resize(padded, size, interpolation=cv2.INTER_LINEAR)[:, round(pad * factor) :][:, :width]
    return np.where(covered[..., None], radiance, enlarged)


def _harmonic(values: NDArray[np.float64], known: NDArray[np.bool_]) -> NDArray[np.float64]:
    """Solve Laplace's equation on the sphere for the unknown cells of a latitude-longitude grid."""
    height, width = known.shape
    index = np.full(known.shape, -1)
    index[~known] = np.arange((~known).sum())
    rows, columns = np.nonzero(~known)
    cell = index[rows, columns]
    theta = np.pi * (rows + 0.5) / height
    step_v, step_u = np.pi / height, 2.0 * np.pi / width
    count = cell.size
    entries: list[tuple[NDArray, NDArray, NDArray]] = []
    right = np.zeros((count, values.shape[2]))
    diagonal = np.zeros(count)
    neighbours = [
        (0, 1, step_v / step_u / np.sin(theta)),
        (0, -1, step_v / step_u / np.sin(theta)),
        # The edge toward the pole has no length in the outermost row: nothing flows across.
        (1, 0, step_u / step_v * np.sin(theta + step_v / 2.0)),
        (-1, 0, step_u / step_v * np.sin(theta - step_v / 2.0)),
    ]
    for down, across, flow in neighbours:
        row = rows + down
        inside = (row >= 0) & (row < height)
        row, column = np.clip(row, 0, height - 1), (columns + across) % width
        flow = np.where(inside, flow, 0.0)
        diagonal += flow
        fixed = known[row, column]
        right[fixed] += flow[fixed, None] * values[row[fixed], column[fixed]]
        entries.append((cell[~fixed], index[row[~fixed], column[~fixed]], -flow[~fixed]))
    entries.append((cell, cell, diagonal))
    index_i, index_j, data = (np.concatenate(parts) for parts in zip(*entries, strict=True))
    from scipy.sparse.linalg import spsolve  # Few panoramas have a hole to be filled.

    matrix = coo_matrix((data, (index_i, index_j)), shape=(count, count)).tocsc()
    result = values.copy()
    result[~known] = np.stack([spsolve(matrix, right[:, channel]) for channel in range(right.shape[1])], axis=-1)
    return result
