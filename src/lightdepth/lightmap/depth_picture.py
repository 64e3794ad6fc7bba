"""A depth image made visible."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray


def depth_picture(depth: NDArray[np.float32]) -> tuple[NDArray[np.uint8], float, float]:
    """Colour a depth image: bright is near, dark is far, black is sky.

    Args:
        depth: metres, inf for sky, shape (height, width), float32.

    Returns:
        ``(pixels, nearest, farthest)``: sRGB of shape (height, width, 3), uint8, and the range of distances
        but the sky, in metres; both NaN where all is sky.
    """
    seen = np.isfinite(depth)
    if not seen.any():
        return np.zeros((*depth.shape, 3), np.uint8), float("nan"), float("nan")
    nearest, farthest = float(depth[seen].min()), float(depth[seen].max())
    scale = np.log(farthest / nearest) or 1.0
    share = np.log(np.where(seen, depth, farthest) / nearest) / scale
    colours = cv2.applyColorMap(np.rint(255.0 - 205.0 * share).astype(np.uint8), cv2.COLORMAP_INFERNO)
    return np.where(seen[:, :, None], colours[:, :, ::-1], 0).astype(np.uint8), nearest, farthest
