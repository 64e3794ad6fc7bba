"""Where the sun shines, if it stands in a direction: through the openings and holes of the modelled place."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import FloatArray
from lightdepth.errors import InputError
from lightdepth.kernel.raycasting import RayCaster
from lightdepth.scene.lights.frame import sun_axes
from lightdepth.scene.model import Scene

OFFSET = 1e-3
"""Metres by which a ray starts beside its surface, relative to ``1 + |p|``."""


class Sunlight:
    """Rays toward a far light through what the scene leaves open.

    Args:
        scene: with real surfaces.

    Raises:
        InputError: no surface is an opening, and none leaves a hole.
    """

    def __init__(self, scene: Scene) -> None:
        self._tuned = scene.render.parameters.lighting
        self._caster = RayCaster([surface.mesh for surface in scene.real if not surface.opening])
        self._whole = RayCaster([surface.mesh for surface in scene.real])
        if not any(surface.opening for surface in scene.real) and not self._leaks(scene.panorama.position):
            raise InputError(
                f"{scene.path or 'scene'}: the modelled place is closed, so that no sun can come in; mark the panes of "
                "its windows with opening = true in their [[real]] tables, or leave holes where they are"
            )

    def lit(self, points: FloatArray, normals: FloatArray, directions: FloatArray) -> NDArray[np.bool_]:
        """Whether surfaces receive light from directions.

        Args:
            points: world, metres, shape (n, 3).
            normals: unit, on the side that receives, shape (n, 3).
            directions: toward the light, unit, world, shape (n, 3), or (3,) for all the same.
        """
        directions = np.broadcast_to(directions, points.shape)
        result = np.einsum("ij,ij->i", normals, directions) > self._tuned.grazing
        facing = np.flatnonzero(result)
        offset = OFFSET * (1.0 + np.abs(points[facing]).max(axis=1, initial=0.0))
        origins = points[facing] + offset[:, None] * normals[facing]
        result[facing] = self._caster.cast(origins, directions[facing]).mesh < 0
        return result

    def share(self, points: FloatArray, normals: FloatArray, direction: FloatArray, diameter: float) -> FloatArray:
        """Share of the sun's disc that surfaces see, in [0, 1], shape (n,); the arguments are those of :meth:`lit`.

        Args:
            points: shape (n, 3).
            normals: shape (n, 3).
            direction: toward the disc's middle, shape (3,).
            diameter: degrees.
        """
        rays = disc(direction, diameter)
        return np.mean([self.lit(points, normals, ray) for ray in rays], axis=0)

    def sees(self, point: FloatArray, direction: FloatArray) -> bool:
        """Whether a point in space, shape (3,), sees the sky in a direction, shape (3,)."""
        return bool(self._caster.cast(point, direction[None]).mesh[0] < 0)

    def _leaks(self, point: FloatArray) -> bool:
        """Whether some direction above the horizon meets nothing, as seen from the capture point."""
        rays = sky_directions(2.0, 0.0)
        return bool(np.any(self._whole.cast(point, rays).mesh < 0))


def sky_directions(spacing: float, lowest: float) -> FloatArray:
    """Evenly distributed unit vectors, ``spacing`` degrees apart, from the elevation ``lowest`` (degrees) up; (n, 3)."""
    bottom = np.sin(np.radians(lowest))
    count = max(1, int((1.0 - bottom) * 2.0 * np.pi / np.radians(spacing) ** 2))
    z = 1.0 - (1.0 - bottom) * (np.arange(count) + 0.5) / count
    phi = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    radius = np.sqrt(1.0 - z * z)
    return np.stack([radius * np.cos(phi), radius * np.sin(phi), z], axis=1)


def turned(direction: FloatArray, right: float, up: float) -> FloatArray:
    """A direction turned by degrees along its two :func:`~lightdepth.scene.lights.frame.sun_axes`."""
    e1, e2 = sun_axes(direction)
    result = direction + np.tan(np.radians(right)) * e1 + np.tan(np.radians(up)) * e2
    return np.asarray(result / np.linalg.norm(result))


def disc(direction: FloatArray, diameter: float) -> FloatArray:
    """Directions to parts of equal size of a far disc, shape (13, 3): sunflower pattern, and four of its rim."""
    count = 9
    radius = 0.5 * diameter * np.sqrt((np.arange(count) + 0.5) / count)
    angle = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    inner = zip(radius * np.cos(angle), radius * np.sin(angle), strict=True)
    half = 0.5 * diameter
    return np.array([turned(direction, a, b) for a, b in [*inner, (half, 0), (-half, 0), (0, half), (0, -half)]])
