"""A box-shaped room seen from inside, its walls of different colours, traced analytically."""

import numpy as np

from lightdepth.directions import euler_rotation, pixel_directions

LOW, HIGH = np.array([-2.1, -1.7, 0.0]), np.array([2.4, 3.3, 2.6])
CAPTURE = np.array([0.0, 0.0, 1.5])
ROTATION = [1.5, -2.0, 25.0]
COLOURS = np.array(
    [[[0.5, 0.48, 0.45], [0.55, 0.5, 0.4]], [[0.45, 0.5, 0.5], [0.6, 0.58, 0.55]], [[0.25, 0.16, 0.1], [0.8, 0.8, 0.8]]]
)
"""By axis and side."""


def painted_room(height):
    """Its panorama, shape (height, 2 height, 3): flat colours, a door, and a lamp in the ceiling.

    Stairs of pixels along its edges would be upright edges of the picture: each pixel is a mean of sixteen.
    """
    return traced(4 * height).reshape(height, 4, 2 * height, 4, 3).mean(axis=(1, 3))


def traced(height):
    directions = pixel_directions(height, 2 * height) @ euler_rotation(ROTATION).T
    with np.errstate(divide="ignore"):
        distances = np.maximum((LOW - CAPTURE) / directions, (HIGH - CAPTURE) / directions)
    axis = distances.argmin(axis=-1)
    points = CAPTURE + directions * distances.min(axis=-1)[..., None]
    side = (np.take_along_axis(directions, axis[..., None], axis=-1)[..., 0] > 0).astype(int)
    radiance = COLOURS[axis, side]
    x, y, z = np.moveaxis(points, -1, 0)
    radiance[(axis == 1) & (side == 1) & (x > 0.4) & (x < 1.3) & (z < 2.0)] = [0.3, 0.2, 0.15]
    radiance[(axis == 2) & (side == 1) & (abs(x) < 0.2) & (abs(y - 1.0) < 0.2)] = 30.0
    return radiance.astype(np.float32)


def meadow(height):
    """Grass under a blue sky with a sun."""
    random = np.random.default_rng(0)
    directions = pixel_directions(height, 2 * height)
    up = directions[..., 2]
    sky = np.stack([0.3 + 0.3 * (1 - up), 0.5 + 0.2 * (1 - up), 1.0 + 0.0 * up], axis=-1)
    grass = np.array([0.08, 0.14, 0.04]) * (0.7 + 0.6 * random.random(up.shape))[..., None]
    radiance = np.where(up[..., None] > 0, sky, grass)
    sun = np.array([0.5, 0.5, np.sqrt(0.5)])
    # Large enough for a pixel of any panorama to see it.
    radiance[directions @ sun > np.cos(np.radians(3.0))] = 800.0
    return radiance.astype(np.float32)
