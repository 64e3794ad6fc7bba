"""How much stronger a source must be for each surface to have one albedo where it lights it more and less."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lightdepth.directions import FloatArray
from lightdepth.lighting.explained import ExplainedLight
from lightdepth.lighting.panorama_view import PanoramaView
from lightdepth.scene.model import Scene


def fit_gain(scene: Scene, view: PanoramaView, share: FloatArray) -> tuple[FloatArray | None, FloatArray]:
    """The gain of a source by which matte surfaces of one colour look as they do.

    Args:
        scene: the place; suns that it declares shine besides the source.
        view: its photograph.
        share: of each pixel of the panorama that belongs to the source, shape (height, 2 height).

    Returns:
        The gain of each channel, shape (3,), or ``None`` where the photograph does not determine it; and its relative
        standard error, shape (3,).
    """
    weight = share[..., None].astype(np.float32)
    radiance = scene.panorama.radiance
    source, rest = (
        ExplainedLight.of(scene, replace(scene.panorama, radiance=part), lights)
        for part, lights in ((radiance * weight, ()), (radiance * (1.0 - weight), scene.lights))
    )
    index = np.arange(view.tuned.falloff_points)
    z = 1.0 - (2.0 * index + 1.0) / view.tuned.falloff_points
    u = (index * (np.sqrt(5.0) - 1.0) / 2.0) % 1.0
    pixels = np.stack([u * view.width, np.arccos(z) / np.pi * view.height], axis=-1)
    seen = view.look(pixels)
    usable = (seen.surface >= 0) & ~view.opening[seen.surface]
    points, normals, surface = seen.point[usable], seen.normal[usable], seen.surface[usable]
    bright = np.pi * view.colour(pixels[usable])
    from_source, from_rest = (
        source.irradiance(points, normals, view.tuned.falloff_samples),
        rest.irradiance(points, normals, view.tuned.falloff_samples),
    )
    # What glows is no surface that is lit.
    apparent = bright / np.maximum(from_source + from_rest, 1e-30)
    good = (
        (bright > 0.0).all(axis=1) & (from_rest > 0.0).all(axis=1) & (apparent.max(axis=1) < view.tuned.falloff_glows)
    )
    groups = [np.flatnonzero(good & (surface == each)) for each in np.unique(surface)]
    groups = [group for group in groups if len(group) >= view.tuned.falloff_fewest_points]
    if not groups:
        return None, np.full(3, np.nan)
    tried = np.geomspace(1.0, view.tuned.falloff_most, view.tuned.falloff_gains)
    gains, errors = np.ones(3), np.full(3, np.nan)
    for channel in range(3):
        misfit = np.array([_misfit(bright, from_rest, from_source, groups, gain, channel) for gain in tried])
        best = int(np.argmin(misfit))
        count = sum(map(len, groups)) / view.tuned.falloff_correlated
        near = misfit <= misfit[best] * (1.0 + 2.0 / count)
        first, last = tried[near][0], tried[near][-1]
        if misfit[-1] < view.tuned.falloff_clearly * misfit[best]:
            return None, np.full(3, np.nan)
        gains[channel] = _vertex(np.log(tried), misfit, best)
        errors[channel] = 0.5 * np.log(last / first) + 0.5 * np.log(tried[1] / tried[0]) * (first == last)
    return gains, errors


def _misfit(
    bright: FloatArray, rest: FloatArray, source: FloatArray, groups: list[np.ndarray], gain: float, channel: int
) -> float:
    """Mean absolute deviation of the logarithm of albedo within surfaces."""
    total, count = 0.0, 0
    for group in groups:
        albedo = np.log(bright[group, channel] / (rest[group, channel] + gain * source[group, channel]))
        total += float(np.abs(albedo - np.median(albedo)).sum())
        count += len(group)
    return total / count


def _vertex(x: FloatArray, y: FloatArray, best: int) -> float:
    """Where the parabola through the smallest value and its neighbours is smallest; ``x`` is a logarithm."""
    if best in (0, len(x) - 1):
        return float(np.exp(x[best]))
    left, middle, right = y[best - 1 : best + 2]
    bend = left - 2.0 * middle + right
    return float(np.exp(x[best] + (0.5 * (left - right) / bend if bend > 0.0 else 0.0) * (x[1] - x[0])))
