"""What light reaches a point of the real place, as far as the panorama shows where it comes from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import direction_to_latlong, pixel_directions, pixel_solid_angles
from lightdepth.kernel.raycasting import RayCaster
from lightdepth.lightmap.file import LightDepthMap
from lightdepth.scene.spot import Spot

HEIGHT = 256
"""Rows of the map that are enough for an irradiance."""
LIFT = 0.002
"""Metres by which rays start off the surface, and end before the next."""


class SpotLight:
    """Irradiance at points of a place: every pixel of a light-depth map lights them from where it is.

    Light of places that the capture point does not see is missing. Pixels next to the point count as if their light
    came from their middle.

    Args:
        light_depth_map: the map.
        caster: of the real surfaces; they hold light back.
    """

    def __init__(self, light_depth_map: LightDepthMap, caster: RayCaster) -> None:
        self._caster = caster
        self._map = light_depth_map
        height, width = light_depth_map.depth.shape
        factor = next(k for k in range(max(1, height // HEIGHT), height + 1) if height % k == 0)
        rows, columns = height // factor, width // factor
        blocks = light_depth_map.radiance.reshape(rows, factor, columns, factor, 3)
        # A block's mean weighted by solid angle, so that small lamps keep their power.
        angles = pixel_solid_angles(height, width).reshape(rows, factor)
        shares = angles / angles.sum(axis=1, keepdims=True) / factor
        self._radiance = np.einsum("ajbkc,aj->abc", blocks.astype(np.float64), shares).reshape(-1, 3)
        self._directions = (pixel_directions(rows, columns) @ light_depth_map.rotation.T).reshape(-1, 3)
        self._depth = light_depth_map.depth[factor // 2 :: factor, factor // 2 :: factor].reshape(-1).astype(np.float64)
        self._solid_angles = np.repeat(pixel_solid_angles(rows, columns), columns)
        self._normals = caster.cast(light_depth_map.position, self._directions).normal.astype(np.float64)
        self._facing = np.abs(np.einsum("ij,ij->i", self._normals, self._directions))

    def irradiance(self, spot: Spot) -> NDArray[np.float64]:
        """Irradiance on the side of the spot's normal, linear RGB, radiance times steradian, shape (3,)."""
        start = spot.point + LIFT * spot.normal
        sky = ~np.isfinite(self._depth)
        toward = np.where(sky[:, None], self._directions, 0.0)
        near = ~sky
        toward[near] = self._map.position + self._depth[near, None] * self._directions[near] - start
        distance = np.linalg.norm(toward, axis=1)
        toward /= np.maximum(distance, 1e-9)[:, None]
        cosine = np.maximum(toward @ spot.normal, 0.0)
        weight = cosine * self._solid_angles
        # A pixel covers the area z^2 dw / cos at its surface, and is seen from the spot under that surface's cosine.
        from_there = np.abs(np.einsum("ij,ij->i", self._normals, toward))
        ratio = from_there / np.maximum(self._facing, 1e-3)
        reach = np.maximum(distance, 0.02)
        weight[near] *= ratio[near] * (self._depth[near] / reach[near]) ** 2
        lit = weight > 0.0
        hits = self._caster.cast(start, toward[lit]).distance
        free = np.where(sky[lit], ~np.isfinite(hits), hits > 0.995 * distance[lit] - LIFT)
        return np.asarray(weight[lit][free] @ self._radiance[lit][free])

    def radiance(self, spot: Spot) -> NDArray[np.float64]:
        """What the panorama shows at the spot, mean over about a degree, linear RGB, shape (3,)."""
        height, width = self._map.depth.shape
        u, v = direction_to_latlong((spot.point - self._map.position) @ self._map.rotation)
        reach = max(0, height // 360)
        row, column = int(float(v) * height), int(float(u) * width)
        rows = np.arange(max(row - reach, 0), min(row + reach + 1, height))
        columns = np.arange(column - reach, column + reach + 1) % width
        return np.asarray(self._map.radiance[np.ix_(rows, columns)].astype(np.float64).mean(axis=(0, 1)))


def spot_light(
    light_depth_map: LightDepthMap, caster: RayCaster, spots: Sequence[Spot]
) -> list[dict[str, list[float]]]:
    """Irradiance, radiance and albedo (pi L / E) at spots, each linear RGB."""
    light = SpotLight(light_depth_map, caster)
    found = []
    for spot in spots:
        irradiance, radiance = light.irradiance(spot), light.radiance(spot)
        albedo = np.pi * radiance / np.maximum(irradiance, 1e-30)
        found.append({"irradiance": irradiance.tolist(), "radiance": radiance.tolist(), "albedo": albedo.tolist()})
    return found
