"""The lobe with which a surface's albedo varies least where highlights come and go.

Of the right gloss, taking what is mirrored from what is shown leaves a diffuse surface. Its albedo is not known, but it
does not know of the highlights either: pairs of places, one in a highlight and one beside it, differ no more than other
pairs do. Neighbours are compared, by the absolute difference, so that an albedo may drift, and seams between planks are
outliers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import FloatArray
from lightdepth.lighting.mirror_images import ROUGHNESSES, SPECULARS, MirrorImages
from lightdepth.parameters.lighting import DEFAULT, LightingParameters

LEVELS = np.concatenate([np.linspace(0.0, 1.0, 21), [1.15, 1.3, 1.5, 1.75, 2.0, 2.5]])
"""Specular levels that are tried."""


@dataclass(frozen=True)
class Pairs:
    """Pairs of cells between which highlights differ.

    Attributes:
        first: index of a cell, shape (m,).
        second: of another one, shape (m,).
        tile: part of the panorama that the pair belongs to, shape (m,).
    """

    first: NDArray[np.int64]
    second: NDArray[np.int64]
    tile: NDArray[np.int64]

    def where(self, chosen: NDArray[np.bool_]) -> Pairs:
        """Some of them."""
        return Pairs(self.first[chosen], self.second[chosen], self.tile[chosen])


@dataclass(frozen=True)
class Fit:
    """The lobe that explains pairs best.

    Attributes:
        roughness: see :class:`~lightdepth.scene.model.Gloss`.
        specular: likewise; above 1 where the surface mirrors more than its level can say.
        roughness_bounds: 90 % interval of the bootstrap.
        specular_bounds: likewise.
        explained: share of the variation of albedo between the pairs that goes with the highlights.
        certain: share of the bootstrap's resamples in which a lobe explains anything.
    """

    roughness: float
    specular: float
    roughness_bounds: tuple[float, float]
    specular_bounds: tuple[float, float]
    explained: float
    certain: float


def find_pairs(images: MirrorImages, tuned: LightingParameters = DEFAULT) -> Pairs:
    """Pairs of cells of one surface between which any of the lobes mirrors clearly more or less."""
    rows = int(images.row.max(initial=0)) + 1
    cell = np.full((rows, images.columns), -1, np.int64)
    cell[images.row, images.column] = np.arange(len(images.row))
    typical = images.lobes[:, SPECULARS.index(0.5)]
    firsts, seconds = [], []
    for distance in tuned.gloss_distances:
        for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
            down, right = down * distance, right * distance
            other = np.full_like(cell, -1)
            other[: max(rows - down, 0)] = np.roll(cell, -right, axis=1)[down:]
            both = (cell >= 0) & (other >= 0)
            first, second = cell[both], other[both]
            scale = np.minimum(images.shown[first], images.shown[second]).mean(axis=1)
            change = np.abs(typical[:, first] - typical[:, second]).mean(axis=2).max(axis=0)
            differs = change > tuned.gloss_differs * scale
            firsts.append(first[differs])
            seconds.append(second[differs])
    first, second = np.concatenate(firsts), np.concatenate(seconds)
    tile = images.row[first] // tuned.gloss_tile * images.columns + images.column[first] // tuned.gloss_tile
    return Pairs(first, second, tile)


def fit_lobe(
    images: MirrorImages,
    pairs: Pairs,
    most: float = np.inf,
    seed: int = 0,
    tuned: LightingParameters = DEFAULT,
) -> Fit:
    """Find the lobe that leaves the least difference of albedo between pairs.

    Args:
        images: of the surface.
        pairs: at least ``gloss_fewest_pairs``.
        most: the highest specular level to try.
        seed: of the bootstrap.
        tuned: how often it draws.
    """
    roughnesses, levels = np.array(ROUGHNESSES), LEVELS[most >= LEVELS]
    fine = np.unique(np.concatenate([roughnesses, 0.5 * (roughnesses[1:] + roughnesses[:-1])]))
    tiles, tile = np.unique(pairs.tile, return_inverse=True)

    per_irradiance = np.pi / np.maximum(images.irradiance, 1e-30)
    per_irradiance /= np.maximum(np.median(images.shown * per_irradiance, axis=0), 1e-30)

    def by_tile(mirrored: FloatArray | float) -> FloatArray:
        # Not of logarithms: highlights wash out a texture, and the lobe that leaves some of them would seem to fit better.
        albedo = (images.shown - mirrored) * per_irradiance
        differences = np.abs(albedo[pairs.first] - albedo[pairs.second]).mean(axis=1)
        return np.asarray(np.bincount(tile, differences, len(tiles)), dtype=np.float64)

    matte = by_tile(0.0)
    misfit = np.array([[by_tile(images.mirrored(r, s)) for s in levels] for r in fine])
    generator = np.random.default_rng(seed)
    drawn = generator.multinomial(len(tiles), np.full(len(tiles), 1.0 / len(tiles)), tuned.gloss_resamples).astype(
        np.float64
    )
    resampled = np.array([_best(fine, levels, misfit @ counts) for counts in drawn])
    least = np.array([(misfit @ counts).min() for counts in drawn])
    roughness, specular = _best(fine, levels, misfit.sum(axis=2))
    return Fit(
        roughness,
        specular,
        _interval(resampled[:, 0]),
        _interval(resampled[:, 1]),
        float(1.0 - misfit.sum(axis=2).min() / max(matte.sum(), 1e-30)),
        float(np.mean(least < (1.0 - tuned.gloss_improves) * (drawn @ matte))),
    )


def _interval(values: FloatArray) -> tuple[float, float]:
    low, high = np.percentile(values, [5.0, 95.0])
    return float(low), float(high)


def _best(roughnesses: FloatArray, levels: FloatArray, misfit: FloatArray) -> tuple[float, float]:
    """Where the parabola through the smallest value and its neighbours is smallest, along either axis."""
    i, j = np.unravel_index(int(np.argmin(misfit)), misfit.shape)
    return _vertex(roughnesses, misfit[:, j], int(i)), _vertex(levels, misfit[i], int(j))


def _vertex(x: FloatArray, y: FloatArray, best: int) -> float:
    if best in (0, len(x) - 1):
        return float(x[best])
    (a, b, c), (p, q, r) = x[best - 1 : best + 2], y[best - 1 : best + 2]
    left, right = (q - p) / (b - a), (r - q) / (c - b)
    bend = (right - left) / (c - a)
    return float(np.clip(0.5 * (a + b) - 0.5 * left / bend, a, c)) if bend > 0.0 else float(b)
