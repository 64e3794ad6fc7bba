"""Looking the photograph up in a direction, and handing it to Mitsuba's own environment light."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import direction_to_latlong, pixel_directions
from lightdepth.kernel.raycasting import RayCaster
from lightdepth.scene.model import Mesh


def lookup(
    panorama: NDArray[np.float32], offset: NDArray[np.float64], rotation: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Radiance that the capture point sees in the direction of places, each pixel of one colour.

    Args:
        panorama: shape (h, 2 h, 3).
        offset: from the capture point, world, shape (n, 3); any length.
        rotation: light space to world, shape (3, 3).

    Returns:
        Linear RGB, shape (n, 3).
    """
    height, width = panorama.shape[:2]
    u, v = direction_to_latlong(offset @ rotation)
    column = np.minimum((u * width).astype(int), width - 1)
    row = np.minimum((v * height).astype(int), height - 1)
    return panorama[row, column].astype(np.float64)


def without_lamps(
    panorama: NDArray[np.float32],
    capture: NDArray[np.float64],
    rotation: NDArray[np.float64],
    lamps: Sequence[Mesh],
) -> NDArray[np.float32]:
    """The photograph with its lamps painted over by what surrounds them.

    Methods that place the lamps as lights of their own project this one onto the other surfaces: pixels at a lamp's
    rim hold a part of its light, which would otherwise be counted twice.

    Args:
        panorama: shape (h, 2 h, 3).
        capture: the capture point, world, metres, shape (3,).
        rotation: light space to world, shape (3, 3).
        lamps: what to paint over.
    """
    if not lamps:
        return panorama
    height, width = panorama.shape[:2]
    directions = pixel_directions(height, width).reshape(-1, 3) @ rotation.T
    covered = np.isfinite(RayCaster(lamps).cast(capture, directions).distance)
    touched = cv2.dilate(covered.reshape(height, width).astype(np.uint8), np.ones((5, 5), np.uint8))
    channels = [cv2.inpaint(panorama[..., index], touched, 3, cv2.INPAINT_NS) for index in range(3)]
    return np.stack(channels, axis=-1)


def mitsuba_environment(panorama: NDArray[np.float32], rotation: NDArray[np.float64]) -> dict[str, Any]:
    """Mitsuba's ``envmap`` of a panorama.

    Its texels lie on the edges of ours, so the panorama is resampled at twice the resolution, nearest neighbour: the
    sun keeps its power to within the width of half a texel.
    """
    import mitsuba as mi

    height, width = panorama.shape[0] * 2, panorama.shape[1] * 2
    theta = np.pi * np.arange(height) / (height - 1)
    phi = 2.0 * np.pi * np.arange(width) / width  # From lightdepth's +y toward +x.
    sine = np.sin(theta)[:, None]
    directions = np.stack(
        [sine * np.sin(phi), sine * np.cos(phi), np.broadcast_to(np.cos(theta)[:, None], (height, width))], axis=-1
    )
    image = lookup(panorama, directions.reshape(-1, 3), np.eye(3)).reshape(height, width, 3).astype(np.float32)
    pose = np.eye(4)
    pose[:3, :3] = rotation
    transform = mi.ScalarTransform4f
    return {
        "type": "envmap",
        "bitmap": mi.Bitmap(image),
        "to_world": transform(pose) @ transform().rotate([1.0, 0.0, 0.0], 90.0),
    }
