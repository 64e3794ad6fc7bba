"""The direction of the sun from the edges of its patches, to a fraction of a pixel.

The edges that a direction predicts are compared with those that the photograph shows across them; by how much they
move with the direction is measured on the model, and least squares over all of them gives the next direction.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import FloatArray
from lightdepth.lighting.panorama_view import REC709, PanoramaView
from lightdepth.lighting.sunlight import Sunlight, turned
from lightdepth.parameters.lighting import LightingParameters

BISECTIONS = 7
"""Halvings of the way between two pixels, to a hundredth of it."""


@dataclass(frozen=True)
class Edges:
    """Places on the edges of the patches that a direction predicts.

    Attributes:
        pixel: x, y, shape (n, 2), in pixels.
        toward_light: unit, on the picture's sphere (right and down), to the lit side, shape (n, 2).
        surface: index of the real surface, shape (n,).
        moves: heights of a pixel toward the light by which it moves per degree of turning the direction to the right
            and up, shape (n, 2).
        offset: heights of a pixel toward the light at which the photograph shows the edge, shape (n,); NaN for none.
        contrast: how many times brighter the lit side is, shape (n,); NaN where there is no edge.
    """

    pixel: FloatArray
    toward_light: FloatArray
    surface: NDArray[np.int32]
    moves: FloatArray
    offset: FloatArray
    contrast: FloatArray

    def where(self, chosen: NDArray[np.bool_]) -> Edges:
        """Some of them."""
        values = (getattr(self, name)[chosen] for name in self.__dataclass_fields__)
        return Edges(*values)


@dataclass(frozen=True)
class Alignment:
    """A direction whose predicted edges lie on the photograph's.

    Attributes:
        direction: toward the sun, unit, world, shape (3,).
        uncertainty: standard error of it, degrees.
        edges: that were found and agree with it.
        predicted: how many edges the model predicts that could have been found.
        residual: root mean square distance between predicted and photographed edges, heights of a pixel.
        exact: heights of a pixel off at which an edge is worth half as much as one in the right place.
    """

    direction: FloatArray
    uncertainty: float
    edges: Edges
    predicted: int
    residual: float
    exact: float

    @property
    def quality(self) -> float:
        """How much of what the direction predicts is there, and how exactly; in [0, 1]."""
        return float(np.sum(1.0 / (1.0 + (self.edges.offset / self.exact) ** 2))) / max(self.predicted, 1)


def align(view: PanoramaView, sunlight: Sunlight, direction: FloatArray) -> Alignment | None:
    """Turn a direction until the edges of what it lights fit.

    Args:
        view: the photograph.
        sunlight: where the sun shines.
        direction: to begin with, within about 1.5 degrees; unit, world, shape (3,).

    Returns:
        The direction, or ``None`` where too few edges are found.
    """
    reaches = view.tuned.edge_reaches
    for reach in reaches:
        edges = measured(view, predicted_edges(view, sunlight, direction), reach)
        found = np.isfinite(edges.offset)
        if found.sum() < view.tuned.fewest_edges:
            return None
        turn, *_ = _least_squares(edges.moves[found], edges.offset[found], view.tuned)
        length = float(np.hypot(*turn))
        turn *= min(1.0, view.tuned.edge_most_turn / max(length, 1e-12))
        direction = turned(direction, float(turn[0]), float(turn[1]))
    edges = measured(view, predicted_edges(view, sunlight, direction), reaches[-1])
    found = np.isfinite(edges.offset)
    if found.sum() < view.tuned.fewest_edges:
        return None
    _, weight, covariance, scale = _least_squares(edges.moves[found], edges.offset[found], view.tuned)
    good = np.asarray(found & (np.abs(np.nan_to_num(edges.offset)) < view.tuned.edge_agrees))
    good[found] &= weight > 0.0
    if good.sum() < view.tuned.fewest_edges:
        return None
    residual = float(np.sqrt(np.mean(edges.offset[good] ** 2)))
    # The typical edge may be better than the fit.
    uncertainty = float(np.sqrt(np.trace(covariance))) * max(1.0, residual / scale)
    return Alignment(direction, uncertainty, edges.where(good), len(edges.pixel), residual, view.tuned.edge_exact)


def predicted_edges(view: PanoramaView, sunlight: Sunlight, direction: FloatArray) -> Edges:
    """Places on the edges that a direction predicts, not yet measured."""
    height, width = view.height, view.width
    centers = view.centers()
    seen = view.look(centers)
    usable = (seen.surface >= 0) & ~view.opening[seen.surface]
    lit = np.zeros(len(centers), dtype=bool)
    lit[usable] = sunlight.lit(seen.point[usable], seen.normal[usable], direction)
    lit_picture = lit.reshape(height, width)
    surface = np.where(usable, seen.surface, -1).reshape(height, width)
    normal = seen.normal.reshape(height, width, 3)
    rows = np.arange(height)[:, None] / height
    pairs = []
    for axis in (0, 1):
        there = np.roll(lit_picture, -1, axis)
        alike = (surface == np.roll(surface, -1, axis)) & (surface >= 0)
        alike &= np.einsum("ijk,ijk->ij", normal, np.roll(normal, -1, axis)) > view.tuned.edge_same_normal
        change = (there != lit_picture) & alike & (rows > view.tuned.edge_pole) & (rows < 1.0 - view.tuned.edge_pole)
        if axis == 0:
            change[-1] = False
        y, x = np.nonzero(change)
        start = np.stack([x + 0.5, y + 0.5], axis=-1)
        end = start + np.array([0.0, 1.0] if axis == 0 else [1.0, 0.0])
        pairs.append((start, end, surface[y, x]))
    start, end, of = (np.concatenate([pair[i] for pair in pairs]) for i in range(3))
    if not len(start):
        none = np.zeros((0, 2))
        return Edges(none, none, np.zeros(0, np.int32), none, np.zeros(0), np.zeros(0))
    if len(start) > view.tuned.most_edges:
        kept = np.linspace(0, len(start) - 1, view.tuned.most_edges).astype(int)
        start, end, of = start[kept], end[kept], of[kept]
    first_lit = lit_picture[start[:, 1].astype(int), start[:, 0].astype(int) % width]
    shaded, bright = np.where(first_lit[:, None], end, start), np.where(first_lit[:, None], start, end)
    for _ in range(BISECTIONS):
        middle = 0.5 * (shaded + bright)
        here = _lit(view, sunlight, middle, of, direction)
        bright, shaded = np.where(here[:, None], middle, bright), np.where(here[:, None], shaded, middle)
    pixel = 0.5 * (shaded + bright)
    pixel[:, 0] %= width
    toward = _gradient(lit_picture, pixel)
    fine = np.hypot(*toward.T) > view.tuned.edge_least_slope
    pixel, toward, of = pixel[fine], toward[fine], of[fine]
    toward /= np.linalg.norm(toward, axis=1, keepdims=True)
    moves = np.stack(
        [
            _moved(view, sunlight, pixel, toward, of, turned(direction, a, b)) / view.tuned.edge_turn
            for a, b in ((view.tuned.edge_turn, 0.0), (0.0, view.tuned.edge_turn))
        ],
        axis=-1,
    ).reshape(-1, 2)
    nothing = np.full(len(pixel), np.nan)
    edges = Edges(pixel, toward, of, moves, nothing, nothing)
    edges = edges.where(np.asarray(np.isfinite(moves).all(axis=1)))
    alone = _alone(view, sunlight, edges, direction)
    return edges.where(alone) if alone.sum() >= view.tuned.enough_edges else edges


def measured(view: PanoramaView, edges: Edges, reach: float) -> Edges:
    """The edges with where the photograph shows them, if it does so within ``reach`` heights of a pixel."""
    if not len(edges.pixel):
        return edges
    tuned = view.tuned
    outer = reach + tuned.edge_blur + tuned.edge_side
    offsets = np.arange(-outer, outer + tuned.edge_sample_distance / 2, tuned.edge_sample_distance)
    count = len(edges.pixel)
    places = view.moved(
        np.repeat(edges.pixel, len(offsets), axis=0),
        np.repeat(edges.toward_light, len(offsets), axis=0),
        np.tile(offsets, count),
    )
    profile = (view.colour(places) @ REC709).reshape(count, len(offsets))
    same = view.look(places).surface.reshape(count, -1) == edges.surface[:, None]
    plateau, half = (
        round(tuned.edge_side / tuned.edge_sample_distance),
        round(tuned.edge_blur / tuned.edge_sample_distance),
    )
    sums = np.concatenate([np.zeros((count, 1)), np.cumsum(profile, axis=1)], axis=1)
    whole = np.concatenate([np.zeros((count, 1)), np.cumsum(~same, axis=1)], axis=1)
    first = half + plateau
    at = np.arange(first, len(offsets) - first)
    low = (sums[:, at - half + 1] - sums[:, at - half + 1 - plateau]) / plateau
    high = (sums[:, at + half + plateau] - sums[:, at + half]) / plateau
    broken = whole[:, at + half + plateau] - whole[:, at - half + 1 - plateau] > 0
    # The steepest place first, so that the two sides of a narrow bar are distinguished.
    slope = (sums[:, at + 3] - sums[:, at + 1]) - (sums[:, at] - sums[:, at - 2])
    step = np.where(
        broken | (high < tuned.edge_least_contrast * low) | (low <= 0.0), -np.inf, slope / np.maximum(low + high, 1e-30)
    )
    best = np.argmax(step, axis=1)
    index = np.arange(count)
    found = np.isfinite(step[index, best]) & (step[index, best] > 0.0)
    middle = at[best]
    dark, bright = low[index, best], high[index, best]
    window = middle[:, None] + np.arange(-half, half + 1)
    share = (profile[index[:, None], window] - dark[:, None]) / np.maximum(bright - dark, 1e-30)[:, None]
    weights = np.ones(2 * half + 1)
    weights[[0, -1]] = 0.5
    share = np.clip(share, -tuned.edge_overshoot, 1.0 + tuned.edge_overshoot)
    area = (share * weights).sum(axis=1) * tuned.edge_sample_distance
    offset = offsets[middle] + half * tuned.edge_sample_distance - area
    contrast = bright / np.maximum(dark, 1e-30)
    return replace(edges, offset=np.where(found, offset, np.nan), contrast=np.where(found, contrast, np.nan))


def _lit(
    view: PanoramaView, sunlight: Sunlight, pixels: FloatArray, surface: NDArray[np.int32], direction: FloatArray
) -> NDArray[np.bool_]:
    """Whether the places are lit; those off their surface are not."""
    seen = view.look(pixels)
    return sunlight.lit(seen.point, seen.normal, direction) & (seen.surface == surface)


def _alone(view: PanoramaView, sunlight: Sunlight, edges: Edges, direction: FloatArray) -> NDArray[np.bool_]:
    """Edges with nothing but light on one side and shade on the other, as far as they are looked at.

    Across a bar of a pixel's width the photograph shows a groove, and no edge where there is one.
    """
    alone = np.ones(len(edges.pixel), dtype=bool)
    for by in (*view.tuned.edge_alone, view.tuned.edge_blur + view.tuned.edge_side):
        for sign in (-1.0, 1.0):
            place = view.moved(edges.pixel, edges.toward_light, sign * by)
            alone &= _lit(view, sunlight, place, edges.surface, direction) == (sign > 0.0)
    return alone


def _gradient(lit: NDArray[np.bool_], pixel: FloatArray) -> FloatArray:
    """Slope of the blurred picture of what is lit on the picture's sphere (right and down), shape (n, 2)."""
    padded = np.pad(lit.astype(np.float32), ((0, 0), (8, 8)), mode="wrap")
    padded = np.pad(padded, ((8, 8), (0, 0)), mode="edge")
    blurred = cv2.GaussianBlur(padded, (0, 0), 1.5)
    right, down = cv2.Sobel(blurred, cv2.CV_32F, 1, 0, scale=0.125), cv2.Sobel(blurred, cv2.CV_32F, 0, 1, scale=0.125)
    x, y = (pixel[:, 0] + 7.5).astype(np.float32)[None], (pixel[:, 1] + 7.5).astype(np.float32)[None]
    slopes = [cv2.remap(image, x, y, cv2.INTER_LINEAR)[0] for image in (right, down)]
    stretch = np.maximum(np.sin(np.pi * pixel[:, 1] / lit.shape[0]), 0.05)
    return np.stack([slopes[0] / stretch, slopes[1]], axis=-1).astype(np.float64)


def _moved(
    view: PanoramaView,
    sunlight: Sunlight,
    pixel: FloatArray,
    toward: FloatArray,
    surface: NDArray[np.int32],
    direction: FloatArray,
) -> FloatArray:
    """How far toward the light the edges lie for another direction, heights of a pixel; NaN where they are not near."""
    low, high = np.full(len(pixel), -view.tuned.edge_farthest), np.full(len(pixel), view.tuned.edge_farthest)
    good = ~_lit(view, sunlight, view.moved(pixel, toward, low), surface, direction)
    good &= _lit(view, sunlight, view.moved(pixel, toward, high), surface, direction)
    for _ in range(BISECTIONS + 3):
        middle = 0.5 * (low + high)
        here = _lit(view, sunlight, view.moved(pixel, toward, middle), surface, direction)
        low, high = np.where(here, low, middle), np.where(here, middle, high)
    return np.where(good, 0.5 * (low + high), np.nan)


def _least_squares(
    moves: FloatArray, offset: FloatArray, tuned: LightingParameters
) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """The turn that explains the offsets, by least squares that leave outliers out (Tukey's biweight).

    Returns:
        Degrees to the right and up, the weights, the covariance of the turn, and the typical residual.
    """
    weight = np.ones(len(offset))
    turn = np.zeros(2)
    scale = 1.0
    outlier = tuned.edge_outlier
    for _ in range(20):
        weighted = moves * weight[:, None]
        # A little stiffness keeps what the edges do not determine where it is.
        normal = weighted.T @ moves + tuned.edge_stiffness * np.trace(weighted.T @ moves) / 2.0 * np.eye(2)
        turn = np.linalg.solve(normal, weighted.T @ offset)
        residual = offset - moves @ turn
        scale = max(1.4826 * float(np.median(np.abs(residual))), tuned.edge_least_deviation)
        weight = np.where(np.abs(residual) < outlier * scale, (1.0 - (residual / (outlier * scale)) ** 2) ** 2, 0.0)
    covariance = tuned.edge_correlated * scale**2 * np.linalg.inv(normal)
    return turn, weight, covariance, scale
