"""The strongest sources of a light-depth map: how a person checks that the lamps are where the lamps are."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from lightdepth.directions import direction_to_latlong, pixel_directions, pixel_solid_angles
from lightdepth.images.tonemapping import LUMINANCE
from lightdepth.lightmap.file import LightDepthMap
from lightdepth.parameters.reconstruction import DEFAULT, SourceParameters

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class Source:
    """One source of light.

    Attributes:
        position: middle of its area, world, metres, shape (3,), float64; ``None`` for sky.
        direction: of its middle from the capture point, world, unit, shape (3,), float64.
        distance: from the capture point, metres; inf for sky.
        size: longer and shorter side of the rectangle of its extent, metres; degrees for sky.
        share: part of all light that arrives at the capture point (luminance over the sphere), in [0, 1].
        luminance: mean radiance of its core, weighted with Rec.709's luminance.
        pixels: its core's pixels, shape (h, 2 h), bool, of the map or what it was reduced to.
        u: panorama coordinate of its middle, in [0, 1].
        v: panorama coordinate of its middle, in [0, 1].
    """

    position: FloatArray | None
    direction: FloatArray
    distance: float
    size: tuple[float, float]
    share: float
    luminance: float
    pixels: NDArray[np.bool_]
    u: float
    v: float

    @property
    def azimuth(self) -> float:
        """Degrees clockwise of the world's y axis, seen from above, from -180 to 180."""
        return float(np.degrees(np.arctan2(self.direction[0], self.direction[1])))

    @property
    def elevation(self) -> float:
        """Degrees above the horizontal."""
        return float(np.degrees(np.arcsin(np.clip(self.direction[2], -1.0, 1.0))))

    def as_dict(self) -> dict[str, Any]:
        """For JSON and CSV; metres, degrees for the size of sky; ``None`` where sky has no place."""
        return {
            "position": None if self.position is None else [round(float(x), 4) for x in self.position],
            "direction": [round(float(x), 6) for x in self.direction],
            "azimuth": round(self.azimuth, 3),
            "elevation": round(self.elevation, 3),
            "distance": None if self.position is None else round(self.distance, 4),
            "size": [round(x, 4) for x in self.size],
            "size_unit": "degrees" if self.position is None else "metres",
            "share": round(self.share, 6),
            "luminance": round(self.luminance, 4),
            "u": round(self.u, 6),
            "v": round(self.v, 6),
        }


def strongest_sources(
    light_depth_map: LightDepthMap, count: int = 10, tuned: SourceParameters = DEFAULT.sources
) -> list[Source]:
    """Find the strongest sources.

    From the brightest pixel on, a source is grown over neighbours that are nearly as bright and at nearly the same
    distance: its core, which gives its position and size. The glow around it, as long as it falls off, is counted to it.
    Then the next one is taken from what is left.

    Args:
        light_depth_map: the map.
        count: how many, at most.
        tuned: what a source is.

    Returns:
        The sources, strongest first; fewer where little stands out.
    """
    light_depth_map = _reduced(light_depth_map, tuned.largest_width)
    depth = light_depth_map.depth.astype(np.float64)
    luminance = light_depth_map.radiance.astype(np.float64) @ LUMINANCE
    height, width = luminance.shape
    energy = luminance * pixel_solid_angles(height, width)[:, None]
    total = float(energy.sum())
    left = luminance >= tuned.bright * total / (4.0 * np.pi)
    found: list[tuple[float, NDArray[np.bool_]]] = []
    # A speck may be brighter than a window: more are grown than asked for, and the strongest kept.
    while left.any() and len(found) < tuned.grown * count:
        row, column = divmod(int(np.argmax(np.where(left, luminance, -1.0))), width)
        turn = width // 2 - column  # With the seed in the middle, no source crosses the panorama's edge.
        core, glow = _grown(
            np.roll(luminance, turn, axis=1), np.roll(depth, turn, axis=1), np.roll(left, turn, axis=1), row, tuned
        )
        core, glow = np.roll(core, -turn, axis=1), np.roll(glow, -turn, axis=1)
        left &= ~(core | glow)
        found.append((float(energy[core | glow].sum()), core))
    found.sort(key=lambda item: -item[0])
    return [_source(light_depth_map, core, energy, power / total, tuned.flat) for power, core in found[:count]]


def _reduced(light_depth_map: LightDepthMap, largest: int) -> LightDepthMap:
    """The map with at most so many columns: of square blocks the mean radiance and the middle's distance."""
    height, width = light_depth_map.depth.shape
    factor = next((k for k in range(-(-width // largest), height + 1) if height % k == 0), 1)
    if factor == 1:
        return light_depth_map
    blocks = light_depth_map.radiance.reshape(height // factor, factor, width // factor, factor, 3)
    depth = light_depth_map.depth[factor // 2 :: factor, factor // 2 :: factor]
    return replace(light_depth_map, radiance=blocks.mean(axis=(1, 3), dtype=np.float32), depth=depth)


def _grown(
    luminance: FloatArray, depth: FloatArray, left: NDArray[np.bool_], row: int, tuned: SourceParameters
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Core and glow of the source whose brightest pixel lies in a row's middle."""
    seed = (row, luminance.shape[1] // 2)
    labels, _ = ndimage.label(left, np.ones((3, 3)))
    window = ndimage.find_objects(labels, int(labels[seed]))[-1]
    here = labels[window] == labels[seed]
    seed = (seed[0] - window[0].start, seed[1] - window[1].start)
    luminance, depth = luminance[window], depth[window]
    here &= _at_distance(depth, here, depth[seed], tuned.largest_step)
    cores, _ = ndimage.label(here & (luminance >= tuned.edge * luminance[seed]), np.ones((3, 3)))
    core = cores == cores[seed]
    whole = core.copy()
    for _ in range(tuned.longest_glow):
        brightest_beside = ndimage.grey_dilation(np.where(whole, luminance, 0.0), (3, 3))
        more = here & ~whole & (luminance <= brightest_beside)
        if not more.any():
            break
        whole |= more
    result = np.zeros((2, *left.shape), dtype=bool)
    result[0][window], result[1][window] = core, whole & ~core
    return result[0], result[1]


def _at_distance(depth: FloatArray, here: NDArray[np.bool_], seed: float, step: float) -> NDArray[np.bool_]:
    """Pixels whose distance is joined to the seed's by other distances without a larger step."""
    if np.isinf(seed):
        return np.isinf(depth)
    distances = np.sort(depth[here & np.isfinite(depth)])
    gaps = np.flatnonzero(distances[1:] > step * distances[:-1])
    at = int(np.searchsorted(distances, seed))
    nearest = distances[max([0, *(gaps[gaps < at] + 1)])]
    farthest = distances[min([len(distances) - 1, *gaps[gaps >= at]])]
    return (depth >= nearest) & (depth <= farthest)


def _source(
    light_depth_map: LightDepthMap,
    pixels: NDArray[np.bool_],
    energy: FloatArray,
    share: float,
    flat: float,
) -> Source:
    height, width = pixels.shape
    directions = pixel_directions(height, width)[pixels]
    depth = light_depth_map.depth[pixels].astype(np.float64)
    light = energy[pixels]
    angle = np.repeat(pixel_solid_angles(height, width), np.count_nonzero(pixels, axis=1))
    middle = light @ directions
    middle /= np.linalg.norm(middle)
    if np.isinf(depth[0]):
        position, distance = None, np.inf
        across = np.degrees(np.arcsin(np.clip(_sides(directions, angle), 0.0, 1.0)))
        size = (float(across[0]), float(across[1]))
    else:
        points = depth[:, None] * directions
        normal = _normal(points, flat)
        facing = np.maximum(np.abs(directions @ normal), 0.05)
        # A pixel covers the area z^2 dw / cos: so the middle is that of the lamp, not of its nearer half.
        area = depth**2 * angle / facing
        weights = area * light / angle
        middle_point = weights @ points / weights.sum()
        position = light_depth_map.position + light_depth_map.rotation @ middle_point
        distance = float(np.linalg.norm(middle_point))
        middle = middle_point / distance
        sides = _sides(points, area)
        size = (float(sides[0]), float(sides[1]))
    u, v = direction_to_latlong(middle)
    return Source(
        position,
        light_depth_map.rotation @ middle,
        distance,
        size,
        share,
        float(light.sum() / angle.sum()),
        pixels,
        float(u),
        float(v),
    )


def _normal(points: FloatArray, flat: float) -> FloatArray:
    """Normal of the plane through points, or the way to them where they are too few or not flat."""
    toward = points.mean(axis=0) / np.linalg.norm(points.mean(axis=0))
    if len(points) < 4:
        return toward
    spread, axes = np.linalg.eigh(np.cov(points.T))
    return axes[:, 0] if spread[0] < flat * spread[1] else toward


def _sides(points: FloatArray, weights: FloatArray) -> FloatArray:
    """Sides of the rectangle with the same second moments: a uniform side s has the variance s^2 / 12."""
    weights = weights / weights.sum()
    offsets = points - weights @ points
    spread = np.linalg.eigvalsh(np.einsum("n,ni,nj->ij", weights, offsets, offsets))
    return np.sqrt(12.0 * np.maximum(spread[::-1][:2], 0.0))
