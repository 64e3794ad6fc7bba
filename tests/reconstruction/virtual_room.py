"""A room that is known exactly: boxes, Lambertian shading, lamps of known place; traced analytically, by slabs."""

import numpy as np

ROOM = (np.array([-2.2, -1.8, 0.0]), np.array([2.8, 2.4, 2.6]))
FURNITURE = {
    "cupboard": (np.array([1.9, -1.2, 0.0]), np.array([2.7, -0.2, 1.5])),
    "chest": (np.array([-1.8, 0.9, 0.0]), np.array([-0.7, 1.7, 0.5])),
}
CAPTURE = np.array([0.1, -0.2, 1.5])
LAMPS = {  # centre, half size along x, y, z, radiance: panels on the ceiling and on a wall
    "ceiling lamp": (np.array([0.9, 1.0, 2.6]), np.array([0.2, 0.15, 0.0]), np.array([40.0, 36.0, 30.0])),
    "wall lamp": (np.array([-2.2, -0.6, 1.9]), np.array([0.0, 0.1, 0.1]), np.array([50.0, 40.0, 20.0])),
    "window": (np.array([2.8, 1.1, 1.5]), np.array([0.0, 0.6, 0.5]), np.array([3.0, 4.0, 6.0])),
}


def trace(origins, directions):
    """Distance along each ray to the room or its furniture, from inside; shape (...,)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / directions
        distance = np.nanmin(np.maximum((ROOM[0] - origins) * inverse, (ROOM[1] - origins) * inverse), axis=-1)
        for low, high in FURNITURE.values():
            a, b = (low - origins) * inverse, (high - origins) * inverse
            enter, leave = np.minimum(a, b).max(axis=-1), np.maximum(a, b).min(axis=-1)
            distance = np.where((enter < leave) & (enter > 0) & (enter < distance), enter, distance)
    return distance


def radiance(points):
    """Colour of surface points, shape (..., 3): a checkered floor, plain walls, lamps."""
    x, y, z = np.moveaxis(points, -1, 0)
    colour = np.broadcast_to([0.42, 0.40, 0.37], points.shape).copy()
    colour *= (0.6 + 0.25 * z / 2.6 + 0.15 * np.cos(1.3 * x + 0.9 * y))[..., None]
    tiles = (np.floor(x / 0.5) + np.floor(y / 0.5)) % 2
    on_floor = z < 1e-4
    colour[on_floor] = np.array([0.30, 0.20, 0.12]) * (0.7 + 0.5 * tiles[on_floor])[:, None]
    for (low, high), paint in zip(FURNITURE.values(), ([0.15, 0.25, 0.30], [0.32, 0.14, 0.10]), strict=True):
        inside = np.all((points > low - 1e-4) & (points < high + 1e-4), axis=-1) & ~on_floor
        colour[inside] = np.array(paint) * (0.6 + 0.4 * (z[inside] > high[2] - 1e-4))[:, None]
    for centre, half, light in LAMPS.values():
        colour[np.all(np.abs(points - centre) <= half + 1e-4, axis=-1)] = light
    return colour.astype(np.float32)


def distance_to_surface(points):
    """Distance of points of shape (n, 3) to the nearest surface of the room or its furniture."""

    def to_box(low, high):
        outside = np.maximum(np.maximum(low - points, points - high), 0.0)
        inside = np.minimum(points - low, high - points).min(axis=-1)
        return np.where(inside > 0, inside, np.linalg.norm(outside, axis=-1))

    return np.minimum.reduce([to_box(*ROOM), *(to_box(*box) for box in FURNITURE.values())])


def scanned(toward, half_angle, count=20_000, seed=0):
    """Points with 1 cm noise of every direction but those in a cone."""
    random = np.random.default_rng(seed)
    directions = random.normal(size=(count, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions = directions[directions @ toward < np.cos(np.radians(half_angle)) * np.linalg.norm(toward)]
    ranges = trace(CAPTURE, directions) + random.normal(0, 0.01, len(directions))
    return CAPTURE + directions * ranges[:, None]
