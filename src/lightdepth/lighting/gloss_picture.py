"""The picture by which a person judges recovered gloss: the photograph, what is mirrored in it, and the rest."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.images.tonemapping import auto_exposure, tone_map
from lightdepth.lighting.gloss import RecoveredGloss
from lightdepth.lighting.mirror_images import MirrorImages
from lightdepth.lighting.panorama_view import PanoramaView
from lightdepth.scene.model import Scene

WIDTH = 1024
LEAST_HEIGHT = 1 / 6
"""Of one strip, as a share of the panorama's, for a surface that is hardly seen."""
STRIPS = ("photographed", "mirrored, by the recovered gloss", "photographed, less what is mirrored")


def draw_gloss(scene: Scene, surfaces: Sequence[RecoveredGloss]) -> NDArray[np.uint8]:
    """Three strips of the panorama below each other, cut to the surfaces whose gloss was looked for.

    In the second one the highlights must be where the first one has them, as wide and as bright; in the third, nothing
    must be left of them, and nothing darker than its surroundings in their place.

    Args:
        scene: the place.
        surfaces: recovered.

    Returns:
        sRGB, shape (h, 1024, 3).
    """
    view = PanoramaView(scene)
    mirrored = np.zeros((view.height, view.width, 3), np.float32)
    for each in surfaces:
        if each.gloss is not None and each.images is not None:
            mirrored += _upright(each.images, each.images.mirrored(each.gloss.roughness, each.gloss.specular), view)
    images = [each.images for each in surfaces if each.images is not None]
    seen = np.concatenate([np.zeros(0, np.int64), *(each.row * each.size for each in images)])
    first, last = (int(seen.min()), int(seen.max())) if len(seen) else (0, view.height)
    fewest = round(LEAST_HEIGHT * view.height)
    first = max(0, min(first, view.height - fewest))
    last = min(view.height, max(last + 2, first + fewest))
    shown = view.radiance[first:last]
    parts = (shown, mirrored[first:last], np.maximum(shown - mirrored[first:last], 0.0))
    stops = auto_exposure(shown)
    size = WIDTH, max(1, round((last - first) * WIDTH / view.width))
    strips = []
    for words, part in zip(STRIPS, parts, strict=True):
        resized = np.maximum(cv2.resize(part.astype(np.float32), size, interpolation=cv2.INTER_AREA), 0.0)
        strip = tone_map(resized, stops)
        for colour, thickness in (((20, 20, 20), 4), ((255, 225, 120), 1)):
            cv2.putText(strip, words, (12, 22), cv2.FONT_HERSHEY_SIMPLEX, 0.5, colour, thickness, cv2.LINE_AA)
        strips.append(strip)
    return np.concatenate(strips)


def _upright(images: MirrorImages, values: NDArray[np.floating], view: PanoramaView) -> NDArray[np.float32]:
    """Values of cells in the pixels of the view, linear between the cells' middles and 0 off the surface."""
    rows, columns = view.height // images.size, view.width // images.size
    grid, share = np.zeros((rows, columns, 3), np.float32), np.zeros((rows, columns), np.float32)
    grid[images.row, images.column], share[images.row, images.column] = values, 1.0
    # At the surface's edge, cells go on with what is beside them.
    filled = np.where(
        share[..., None] > 0.0, grid, cv2.blur(grid, (3, 3)) / np.maximum(cv2.blur(share, (3, 3)), 1e-6)[..., None]
    )
    size = (columns * images.size, rows * images.size)
    wide, inside = cv2.resize(filled, size), cv2.resize(share, size, interpolation=cv2.INTER_NEAREST)
    result = np.zeros((view.height, view.width, 3), np.float32)
    result[: size[1], : size[0]] = wide * inside[..., None]
    result[:, size[0] :] = result[:, size[0] - 1 : size[0]]  # Columns too few for a cell.
    return result
