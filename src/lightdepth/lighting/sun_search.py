"""The direction of an unseen sun, searched over the whole sky.

For each direction of the sky the modelled openings predict which surfaces are lit. The sun stands where that agrees
best with how much brighter surfaces are than the light that the photograph explains makes them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import FloatArray
from lightdepth.lighting.explained import ExplainedLight
from lightdepth.lighting.panorama_view import REC709, PanoramaView
from lightdepth.lighting.patches import Clicks
from lightdepth.lighting.sunlight import Sunlight, sky_directions, turned
from lightdepth.parameters.lighting import LightingParameters

RAYS_AT_ONCE = 2_000_000


@dataclass(frozen=True)
class Candidate:
    """A direction of the sun.

    Attributes:
        direction: toward it, unit, world, shape (3,).
        agreement: correlation of what it lights with what is bright, in [-1, 1].
    """

    direction: FloatArray
    agreement: float


class SunSearch:
    """What the search compares.

    Args:
        view: the photograph.
        sunlight: where the sun shines.
        explained: the light without it.
        clicks: where the user says the patch is; empty where it is to be found.
        within: which of some directions, shape (n, 3), are looked at; all by default.
    """

    def __init__(
        self,
        view: PanoramaView,
        sunlight: Sunlight,
        explained: ExplainedLight,
        clicks: Clicks,
        within: Callable[[FloatArray], NDArray[np.bool_]] | None = None,
    ) -> None:
        self._sunlight, self._tuned = sunlight, view.tuned
        self._within = within
        self._clicks = clicks
        pixels = _spread(view, view.tuned.search_fine_points)
        seen = view.look(pixels)
        usable = (seen.surface >= 0) & ~view.opening[seen.surface]
        self._points, self._normals = seen.point[usable], seen.normal[usable]
        surface = seen.surface[usable]
        count = max(1, int(np.ceil(len(self._points) / view.tuned.search_points)))
        self._coarse = np.arange(0, len(self._points), count)
        if clicks.polygons:
            self._bright = clicks.inside(view, pixels[usable]).astype(np.float64)
        else:
            # The light that the photograph explains varies slowly: it is known at the coarse points.
            coarse = self._coarse
            known = (
                explained.irradiance(self._points[coarse], self._normals[coarse], view.tuned.search_samples) @ REC709
            )
            light = _nearest(self._points, self._normals, coarse, known, view.tuned.search_neighbours)
            self._bright = _excess(view.colour(pixels[usable]) @ REC709, light, surface, view.tuned)

    def best(self) -> list[Candidate]:
        """Directions that agree best, at most ``search_kept``, the best first; none where no direction lights anything."""
        directions = sky_directions(self._tuned.search_spacing, self._tuned.search_lowest)
        directions = directions[self._allowed(directions)]
        agreement = self._agreement(directions, self._coarse)
        steps, apart = self._tuned.search_finer_steps, self._tuned.search_apart
        for index, spacing in enumerate(self._tuned.search_finer):
            chosen = _peaks(
                directions,
                agreement,
                self._tuned.search_kept if index == 0 else self._tuned.search_finer_kept,
                2.0 * self._tuned.search_spacing if index == 0 else apart,
            )
            offsets = spacing * np.arange(-steps, steps + 1)
            directions = np.array([turned(directions[i], a, b) for i in chosen for a in offsets for b in offsets])
            if not len(directions):
                return []
            directions = directions[self._allowed(directions)]
            agreement = self._agreement(directions, self._enough(len(directions)))
        order = _peaks(directions, agreement, self._tuned.search_kept, apart)
        return [Candidate(directions[i], float(agreement[i])) for i in order]

    def agreement(self, direction: FloatArray) -> float:
        """Correlation of what a direction, shape (3,), lights with what is bright."""
        return float(self._agreement(direction[None], np.arange(len(self._points)))[0])

    def _allowed(self, directions: FloatArray) -> NDArray[np.bool_]:
        """Directions that light all the places of which the user says so."""
        allowed = np.ones(len(directions), dtype=bool) if self._within is None else self._within(directions)
        for point, normal in zip(self._clicks.points, self._clicks.normals, strict=True):
            allowed &= self._sunlight.lit(
                np.broadcast_to(point, directions.shape), np.broadcast_to(normal, directions.shape), directions
            )
        return allowed

    def _enough(self, directions: int) -> NDArray[np.intp]:
        """Points for a finer search: all of them for few directions, half of them for many."""
        return np.arange(0, len(self._points), 1 if directions < self._tuned.search_half else 2)

    def _agreement(self, directions: FloatArray, chosen: NDArray[np.intp]) -> FloatArray:
        """Correlation for each direction, shape (n,), over the chosen points; -1 where it lights next to nothing."""
        points, normals, bright = self._points[chosen], self._normals[chosen], self._bright[chosen]
        bright = bright - bright.mean()
        deviation = float(np.sqrt(np.mean(bright**2)))
        result = np.full(len(directions), -1.0)
        if deviation == 0.0:
            return result
        at_once = max(1, RAYS_AT_ONCE // len(points))
        for first in range(0, len(directions), at_once):
            part = directions[first : first + at_once]
            shape = (len(part), len(points), 3)
            lit = self._sunlight.lit(
                np.broadcast_to(points, shape).reshape(-1, 3),
                np.broadcast_to(normals, shape).reshape(-1, 3),
                np.broadcast_to(part[:, None], shape).reshape(-1, 3),
            ).reshape(shape[:2])
            share = lit.mean(axis=1)
            enough = (lit.sum(axis=1) >= self._tuned.search_fewest_lit) & (share < 1.0)
            covariance = (lit @ bright) / len(points)
            correlation = covariance / np.maximum(deviation * np.sqrt(share * (1.0 - share)), 1e-12)
            result[first : first + at_once] = np.where(enough, correlation, -1.0)
        return result


def _spread(view: PanoramaView, count: int) -> FloatArray:
    """Places all over the panorama, evenly over the sphere, shape (n, 2): x, y in pixels."""
    index = np.arange(count)
    z = 1.0 - (2.0 * index + 1.0) / count
    u = (index * (np.sqrt(5.0) - 1.0) / 2.0) % 1.0
    return np.stack([u * view.width, np.arccos(z) / np.pi * view.height], axis=-1)


def _nearest(
    points: FloatArray, normals: FloatArray, known: NDArray[np.intp], values: FloatArray, count: int
) -> FloatArray:
    """Values at all points from those at known ones: of the nearest that face alike."""
    from scipy.spatial import cKDTree

    scale = float(np.ptp(points, axis=0).max())
    features = np.concatenate([points, scale * normals], axis=1)
    tree = cKDTree(features[known])
    distance, neighbour = tree.query(features, k=min(count, len(known)))
    distance, neighbour = np.atleast_2d(distance.T).T, np.atleast_2d(neighbour.T).T
    weight = 1.0 / (distance + 1e-6)
    return np.asarray((weight * values[neighbour]).sum(axis=1) / weight.sum(axis=1))


def _excess(
    radiance: FloatArray, light: FloatArray, surface: NDArray[np.int32], tuned: LightingParameters
) -> FloatArray:
    """Logarithm of how much brighter points are than others of their surface in the same light, limited."""
    floor = 1e-6 * float(radiance.max(initial=0.0)) + 1e-30
    ratio = np.log((radiance + floor) / (light + floor))
    for index in np.unique(surface):
        of_it = surface == index
        ratio[of_it] -= np.median(ratio[of_it])
    return np.clip(ratio, tuned.search_darkest, tuned.search_brightest)


def _peaks(directions: FloatArray, agreement: FloatArray, count: int, apart: float) -> list[int]:
    """The best directions that are at least ``apart`` degrees apart."""
    chosen: list[int] = []
    for index in np.argsort(-agreement):
        if agreement[index] <= 0.0 or len(chosen) == count:
            break
        if all(directions[index] @ directions[other] < np.cos(np.radians(apart)) for other in chosen):
            chosen.append(int(index))
    return chosen
