"""The photograph as a picture of surfaces: what lies under each of its pixels, and its colour between pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import FloatArray, direction_to_latlong, latlong_to_direction
from lightdepth.errors import InputError
from lightdepth.kernel.raycasting import RayCaster
from lightdepth.scene.model import Scene

REC709 = np.array([0.2126, 0.7152, 0.0722])


@dataclass(frozen=True)
class Seen:
    """What the capture point sees at places in the panorama.

    Attributes:
        point: world, metres, shape (n, 3), float64; meaningless where nothing is seen.
        normal: unit, world, toward the capture point, shape (n, 3), float64; 0 where nothing is seen.
        surface: index into the scene's real surfaces, -1 where nothing is seen, shape (n,).
    """

    point: FloatArray
    normal: FloatArray
    surface: NDArray[np.int32]


class PanoramaView:
    """A scene's photograph over its real surfaces.

    Args:
        scene: with real surfaces.

    Attributes:
        radiance: linear RGB, shape (height, 2 height, 3), float32, at most ``largest_width`` pixels wide.
        opening: for each real surface whether it is an opening, and at the end ``False`` for index -1, shape (n + 1,).
        names: of the real surfaces.
        tuned: the scene's constants of recovering light.

    Raises:
        InputError: the scene has no real surfaces.
    """

    def __init__(self, scene: Scene) -> None:
        if not scene.real:
            raise InputError(f"{scene.path or 'scene'}: has no [[real]] surfaces; where the light falls is not known")
        self.tuned = scene.render.parameters.lighting
        self.radiance = _reduced(scene.panorama.radiance, self.tuned.largest_width)
        self.height, self.width = self.radiance.shape[:2]
        self.position = scene.panorama.position
        self._rotation = scene.panorama.rotation
        self.names = tuple(surface.name for surface in scene.real)
        self.opening = np.array([*(surface.opening for surface in scene.real), False])
        self._caster = RayCaster([surface.mesh for surface in scene.real])

    def directions(self, pixels: FloatArray) -> FloatArray:
        """World directions, shape (n, 3), through places in the panorama, (n, 2): x, y in pixels."""
        u, v = pixels[:, 0] / self.width, pixels[:, 1] / self.height
        return latlong_to_direction(u, v) @ self._rotation.T

    def pixels(self, points: FloatArray) -> FloatArray:
        """Where the capture point sees points, x and y in pixels, shape (n, 2); world, metres, shape (n, 3)."""
        offset = (points - self.position) @ self._rotation
        u, v = direction_to_latlong(offset)
        return np.stack([u * self.width, v * self.height], axis=-1)

    def centers(self) -> FloatArray:
        """The centres of all pixels, row by row, shape (height * width, 2)."""
        y, x = np.mgrid[: self.height, : self.width]
        return np.stack([x.ravel(), y.ravel()], axis=-1) + 0.5

    def look(self, pixels: FloatArray) -> Seen:
        """What lies at places in the panorama, shape (n, 2)."""
        direction = self.directions(pixels)
        hits = self._caster.cast(self.position, direction)
        distance = np.where(hits.mesh >= 0, hits.distance, 1.0).astype(np.float64)
        normal = hits.normal.astype(np.float64)
        normal *= np.where(np.einsum("ij,ij->i", normal, direction) > 0.0, -1.0, 1.0)[:, None]
        return Seen(self.position + distance[:, None] * direction, normal, hits.mesh)

    def colour(self, pixels: FloatArray) -> FloatArray:
        """Radiance at places in the panorama, shape (n, 2), bilinear between pixels; shape (n, 3)."""
        x, y = pixels[:, 0] - 0.5, np.clip(pixels[:, 1] - 0.5, 0.0, self.height - 1.0)
        left, top = np.floor(x).astype(int), np.minimum(np.floor(y).astype(int), self.height - 2)
        across, down = (x - left)[:, None], (y - top)[:, None]
        here, beside = left % self.width, (left + 1) % self.width
        upper = self.radiance[top, here] * (1.0 - across) + self.radiance[top, beside] * across
        lower = self.radiance[top + 1, here] * (1.0 - across) + self.radiance[top + 1, beside] * across
        return np.asarray(upper * (1.0 - down) + lower * down, dtype=np.float64)

    def moved(self, pixels: FloatArray, along: FloatArray, by: FloatArray | float) -> FloatArray:
        """Places moved ``by`` heights of a pixel along unit vectors on the picture's sphere (right and down).

        Args:
            pixels: x, y, shape (n, 2).
            along: shape (n, 2).
            by: shape (n,), or one for all.
        """
        stretch = np.maximum(np.sin(np.pi * pixels[:, 1] / self.height), 0.05)
        step = along * np.stack([1.0 / stretch, np.ones_like(stretch)], axis=-1)
        moved = pixels + np.asarray(by)[..., None] * step
        moved[:, 1] = np.clip(moved[:, 1], 0.01, self.height - 0.01)
        return np.asarray(moved)


def _reduced(radiance: NDArray[np.float32], largest: int) -> NDArray[np.float32]:
    """Means of square blocks, so that it is at most ``largest`` wide."""
    height, width = radiance.shape[:2]
    factor = next((k for k in range(-(-width // largest), height + 1) if height % k == 0), 1)
    if factor == 1:
        return radiance
    blocks = radiance.reshape(height // factor, factor, width // factor, factor, 3)
    return np.asarray(blocks.mean(axis=(1, 3), dtype=np.float32))
