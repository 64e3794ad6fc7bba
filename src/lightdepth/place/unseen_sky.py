"""Unseen sky: a wall occludes it from the capture point, and other points see it through a window.

The photograph shows the wall in that direction. The sky that it shows near that direction, and above all at the same
elevation, is the better guess.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import direction_to_latlong, pixel_directions
from lightdepth.parameters.place import DEFAULT, PlaceParameters


def sky_map(
    radiance: NDArray[np.float32],
    sky: NDArray[np.bool_],
    directions: NDArray[np.float64],
    tuned: PlaceParameters = DEFAULT,
) -> NDArray[np.float32] | None:
    """The sky in all directions, from what is seen of it: without the sun, which stands in one place only.

    It is interpolated by the inverse sixth power of the distance (Shepard 1968).

    Args:
        radiance: of the panorama, linear RGB, shape (height, 2 height, 3).
        sky: pixels in which the capture point sees no real surface, shape (height, 2 height).
        directions: of the pixels, world, unit, shape (height, 2 height, 3).
        tuned: how it is interpolated.

    Returns:
        Linear RGB, shape (``sky_map_rows``, 2 ``sky_map_rows``, 3), float32, an equirectangular map in world directions;
        ``None`` where hardly any sky is seen.
    """
    colours, toward = radiance[sky].astype(np.float64), directions[sky]
    if len(colours) < tuned.fewest_sky_pixels:
        return None
    height, rows, columns = radiance.shape[0], tuned.sky_map_rows, 2 * tuned.sky_map_rows
    angle = np.broadcast_to(np.sin(np.pi * (np.arange(height) + 0.5) / height)[:, None], sky.shape)[sky]
    u, v = direction_to_latlong(toward)
    cell = np.minimum((v * rows).astype(int), rows - 1) * columns + np.minimum((u * columns).astype(int), columns - 1)
    axes = pixel_directions(rows, columns).reshape(-1, 3)
    seen, place = np.unique(cell, return_inverse=True)
    colours = np.minimum(colours, tuned.sky_brightest * _medians(place, colours, axes[seen], tuned.sky_near)[place])
    weight = np.bincount(place, angle)
    mean = np.stack([np.bincount(place, angle * channel) for channel in colours.T], axis=1) / weight[:, None]
    above = np.degrees(np.arcsin(np.clip(axes[:, 2], -1.0, 1.0)))
    result = np.empty((rows * columns, 3))
    for row in range(rows):  # All pairs at once would take much memory.
        part = slice(row * columns, (row + 1) * columns)
        around = np.degrees(np.arccos(np.clip(axes[part] @ axes[seen].T, -1.0, 1.0)))
        higher = above[row * columns] - above[seen]
        squared = around**2 + ((tuned.sky_elevation_weight**2 - 1.0) * higher**2 + tuned.sky_nearest**2)
        share = weight / (squared * squared * squared)  # The nearest counts most.
        result[part] = share @ mean / share.sum(axis=1, keepdims=True)
    return np.asarray(result.reshape(rows, columns, 3), dtype=np.float32)


def _medians(
    place: NDArray[np.intp], colours: NDArray[np.float64], axes: NDArray[np.float64], near: float
) -> NDArray[np.float64]:
    """For each of n cells with sky the median of the medians of the cells near it, shape (n, 3).

    Args:
        place: which cell each pixel lies in, shape (pixels,).
        colours: of the pixels, shape (pixels, 3).
        axes: toward the cells, shape (n, 3).
        near: degrees up to which a cell is near.
    """
    counts = np.bincount(place)
    middle = np.cumsum(counts) - counts + counts // 2
    own = np.stack([channel[np.lexsort((channel, place))[middle]] for channel in colours.T], axis=1)
    around = axes @ axes.T > np.cos(np.radians(near))
    return np.array([np.median(own[chosen], axis=0) for chosen in around])
