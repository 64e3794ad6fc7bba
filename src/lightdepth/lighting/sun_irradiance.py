"""The irradiance of an unseen sun, from both sides of the edges of its patches.

On one material the radiances of either side stand in the ratio of their irradiances, whatever the albedo:
``M_lit / M_shade = (E_lit + E_sun cos) / E_shade``, with the irradiances ``E`` that the photograph explains.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import FloatArray
from lightdepth.lighting.explained import ExplainedLight
from lightdepth.lighting.panorama_view import PanoramaView
from lightdepth.lighting.sun_edges import Edges
from lightdepth.lighting.sunlight import Sunlight
from lightdepth.parameters.lighting import DEFAULT, LightingParameters


@dataclass(frozen=True)
class EdgePairs:
    """Places on both sides of edges of a patch.

    Attributes:
        lit: x, y in the panorama, pixels, shape (n, 2).
        shaded: the same across the edge.
        surface: index of the real surface, shape (n,).
        irradiance: of the sun on a surface that faces it, from each pair, shape (n, 3).
    """

    lit: FloatArray
    shaded: FloatArray
    surface: NDArray[np.int32]
    irradiance: FloatArray


@dataclass(frozen=True)
class SunIrradiance:
    """The irradiance on a surface that faces the sun.

    Attributes:
        value: linear RGB, the panorama's radiance unit times steradian, shape (3,).
        uncertainty: standard error of each channel, shape (3,).
        deviation: typical relative deviation of a single pair.
        pairs: what it comes from.
    """

    value: FloatArray
    uncertainty: FloatArray
    deviation: float
    pairs: EdgePairs


def compare_sides(
    view: PanoramaView,
    sunlight: Sunlight,
    explained: ExplainedLight,
    edges: Edges,
    direction: FloatArray,
    diameter: float,
) -> EdgePairs:
    """Compare both sides of edges; those without clear sides on one surface are left out.

    Args:
        view: the photograph.
        sunlight: where the sun shines.
        explained: the light without it.
        edges: measured, so that they lie where the photograph shows them.
        direction: toward the sun, unit, world, shape (3,).
        diameter: of its disc, degrees.
    """
    if not len(edges.pixel):
        none = np.zeros((0, 2))
        return EdgePairs(none, none, np.zeros(0, np.int32), np.zeros((0, 3)))
    if len(edges.pixel) > view.tuned.most_pairs:
        edges = edges.where(
            np.isin(np.arange(len(edges.pixel)), np.linspace(0, len(edges.pixel) - 1, view.tuned.most_pairs, dtype=int))
        )
    middle = view.moved(edges.pixel, edges.toward_light, edges.offset)
    distance = np.full(len(middle), np.nan)
    for each in reversed(view.tuned.pair_distances):
        clear = np.ones(len(middle), dtype=bool)
        for sign, share in ((1.0, 1.0), (-1.0, 0.0)):
            for by in (each - view.tuned.pair_clear, each, each + view.tuned.pair_clear):
                place = view.moved(middle, edges.toward_light, sign * by)
                seen = view.look(place)
                clear &= seen.surface == edges.surface
                clear &= sunlight.share(seen.point, seen.normal, direction, diameter) == share
        distance[clear] = each
    good = np.isfinite(distance)
    edges, middle, distance = edges.where(good), middle[good], distance[good]
    lit, shaded = (view.moved(middle, edges.toward_light, sign * distance) for sign in (1.0, -1.0))
    bright, dark = (_mean_colour(view, middle, edges, sign, distance) for sign in (1.0, -1.0))
    seen_lit, seen_shaded = view.look(lit), view.look(shaded)
    points = np.concatenate([seen_lit.point, seen_shaded.point])
    normals = np.concatenate([seen_lit.normal, seen_shaded.normal])
    light = explained.irradiance(points, normals, view.tuned.pair_samples)
    in_light, in_shade = light[: len(lit)], light[len(lit) :]
    cosine = seen_lit.normal @ direction
    ratio = bright / np.maximum(dark, 1e-30)
    irradiance = (ratio * in_shade - in_light) / cosine[:, None]
    known = (dark > 0.0).all(axis=1) & np.isfinite(irradiance).all(axis=1)
    return EdgePairs(lit[known], shaded[known], edges.surface[known], irradiance[known])


def combine(pairs: EdgePairs, tuned: LightingParameters = DEFAULT) -> SunIrradiance:
    """The median over pairs, and how sure it is."""
    value = np.median(pairs.irradiance, axis=0)
    deviation = 1.4826 * np.median(np.abs(pairs.irradiance - value), axis=0)
    count = max(1.0, len(pairs.irradiance) / tuned.pair_correlated)
    uncertainty = 1.2533 * deviation / np.sqrt(count)
    return SunIrradiance(value, uncertainty, float(np.mean(deviation) / max(float(np.mean(value)), 1e-30)), pairs)


def _mean_colour(view: PanoramaView, middle: FloatArray, edges: Edges, sign: float, distance: FloatArray) -> FloatArray:
    """Mean radiance around a place on one side, along the way across the edge."""
    colours = [
        view.colour(view.moved(middle, edges.toward_light, sign * (distance + by))) for by in (-0.5, 0.0, 0.5, 1.0)
    ]
    return np.asarray(np.mean(colours, axis=0))
