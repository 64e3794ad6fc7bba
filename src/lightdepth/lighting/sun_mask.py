"""The pattern that falls through a window: the patch of sun itself, projected back along the sun's direction.

Bars, curtains and trees outside need no model: how bright each place in the patch is, compared with its shade, is the
share of the sun that passed toward it. Each channel has its own: so a shadow in the patch gets the colour of the shade
beside it, also where the model explains more of one colour than there is on a wall and less on the floor.
"""

from __future__ import annotations

import threading
from collections import OrderedDict
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, maximum_filter, minimum_filter

from lightdepth.directions import FloatArray
from lightdepth.errors import InputError
from lightdepth.lighting.explained import ExplainedLight
from lightdepth.lighting.panorama_view import REC709, PanoramaView
from lightdepth.lighting.sunlight import Sunlight
from lightdepth.parameters.lighting import LightingParameters
from lightdepth.scene.identity import digest, place_digest
from lightdepth.scene.lights.frame import sun_axes
from lightdepth.scene.model import Light, Scene, SunLight

KEPT = 2
"""Places of which a process keeps the masks."""


@dataclass(frozen=True)
class SunMask:
    """A pattern.

    Attributes:
        transmittance: of each channel, in [0, 1], shape (h, w, 3), float32; row 0 is the top.
        irradiance: of the sun where all of it passes, linear RGB, shape (3,): at least that of the sun which was given.
        extent: left, bottom, right and top in the plane across the sun's direction, metres, along
            :func:`~lightdepth.scene.lights.frame.sun_axes`.
    """

    transmittance: NDArray[np.float32]
    irradiance: FloatArray
    extent: tuple[float, float, float, float]


def with_masks(scene: Scene) -> tuple[Light, ...]:
    """The lights of a scene, suns with the masks that are to be recovered.

    A process keeps those of the places that it saw last: checking a scene and preparing it both need them.

    Raises:
        InputError: as :func:`recover_mask`.
    """
    if not any(isinstance(light, SunLight) and light.recover_mask for light in scene.lights):
        return scene.lights
    key = digest(place_digest(scene), scene.render.parameters.lighting)
    with _lock:
        if key not in _kept:
            _kept[key] = tuple(_masked(scene, light) for light in scene.lights)
            while len(_kept) > KEPT:
                _kept.popitem(last=False)
        return _kept[key]


_kept: OrderedDict[str, tuple[Light, ...]] = OrderedDict()
_lock = threading.Lock()


def _masked(scene: Scene, sun: Light) -> Light:
    if not isinstance(sun, SunLight) or not sun.recover_mask:
        return sun
    try:
        mask = recover_mask(scene, sun)
    except InputError as error:
        raise InputError(f"[[light]] '{sun.name}', mask = \"recover\": {error}") from error
    return replace(
        sun, irradiance=mask.irradiance, mask=mask.transmittance, mask_extent=mask.extent, recover_mask=False
    )


def recover_mask(scene: Scene, sun: SunLight) -> SunMask:
    """Recover the pattern in which a sun falls into the place.

    Places that the sun would reach through the modelled openings but that the photograph does not show are taken to get
    what the nearest that it shows get. Where what is fully lit is brighter than the sun makes it, the sun is stronger: all
    of the patch says so, and not its edges alone, which bars and curtains blur.

    Args:
        scene: the place.
        sun: one that it lights up; a mask that it has plays no part.

    Raises:
        InputError: the photograph shows too little of the patch, or no shade of the surfaces that it lies on.
    """
    from scipy.spatial import cKDTree

    view, sunlight = PanoramaView(scene), Sunlight(scene)
    explained = ExplainedLight.of(scene)
    pixels = view.centers()
    seen = view.look(pixels)
    usable = np.flatnonzero((seen.surface >= 0) & ~view.opening[seen.surface])
    points, normals, surface = seen.point[usable], seen.normal[usable], seen.surface[usable]
    share = sunlight.share(points, normals, sun.direction, sun.diameter)
    in_patch, in_shade = np.flatnonzero(share > 0.0), share == 0.0
    if len(in_patch) < view.tuned.mask_fewest_pixels:
        raise InputError(
            f"{scene.path or 'scene'}: the photograph shows {len(in_patch)} pixels of the patch of sun; a mask needs "
            f"{view.tuned.mask_fewest_pixels}"
        )
    # What is near the patch is enough to know the shade's albedo by.
    near = _near(in_patch, usable, share, view)
    chosen = np.concatenate([in_patch, near])
    light = _irradiance(explained, points[chosen], normals[chosen], view.tuned)
    brightness = view.colour(pixels[usable[chosen]])
    apparent = np.pi * brightness / np.maximum(light, 1e-12)
    transmittance, fully_lit = np.full((len(in_patch), 3), np.nan), np.ones(3)
    # Edges of the patch mix both sides; what the modelled openings hold back there is not the mask's.
    inner = _within(view, usable, share == 1.0)[in_patch]
    for index in np.unique(surface[in_patch]):
        here = np.flatnonzero(surface[in_patch] == index)
        shade = len(in_patch) + np.flatnonzero((surface[near] == index) & in_shade[near])
        if len(shade) < view.tuned.mask_fewest_pixels:
            continue
        tree = cKDTree(points[chosen[shade]])
        _, neighbours = tree.query(points[in_patch[here]], k=min(view.tuned.mask_neighbours, len(shade)))
        albedo = np.median(apparent[shade][neighbours], axis=1)
        cosine = normals[in_patch[here]] @ sun.direction
        excess = np.pi * brightness[here] / np.maximum(albedo, 1e-6) - light[here]
        transmittance[here] = excess / (sun.irradiance * cosine[:, None])
        if np.count_nonzero(inner[here]) >= view.tuned.mask_fewest_pixels:
            fully_lit = np.maximum(fully_lit, _fully_lit(transmittance[here[inner[here]]], view.tuned))
    known = np.isfinite(transmittance).all(axis=1) & inner
    if known.sum() < view.tuned.mask_fewest_pixels:
        raise InputError(
            f"{scene.path or 'scene'}: no mask can be recovered: the surfaces under the patch show no shade beside it"
        )
    openings = [surface.mesh.vertices for surface in scene.real if surface.opening]
    return _projected(
        points[in_patch[known]],
        np.clip(transmittance[known] / fully_lit, 0.0, 1.0),
        np.concatenate([np.zeros((0, 3)), *openings]),
        replace(sun, irradiance=sun.irradiance * fully_lit),
        view,
    )


def _fully_lit(transmittance: FloatArray, tuned: LightingParameters) -> FloatArray:
    """What the lit places of a surface have at least in the median, of shape (n, 3) that of each channel."""
    brightness = transmittance @ REC709
    lit = transmittance[brightness > tuned.mask_lit * np.percentile(brightness, 100.0 * tuned.mask_brightest)]
    if not len(lit):
        return np.ones(3)
    middle = np.median(lit, axis=0)
    deviation = 1.4826 * np.median(np.abs(lit - middle), axis=0)
    error = 1.2533 * deviation / np.sqrt(max(1.0, len(lit) / tuned.pair_correlated))
    return np.asarray(middle - tuned.mask_sure * error)


def _within(view: PanoramaView, usable: NDArray[np.intp], lit: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Usable pixels that are lit and whose neighbours are too."""
    picture = np.zeros(view.height * view.width, dtype=bool)
    picture[usable[lit]] = True
    inner = minimum_filter(picture.reshape(view.height, view.width), size=3, mode=("nearest", "wrap"))
    return np.asarray(inner.reshape(-1)[usable], dtype=bool)


def _near(
    in_patch: NDArray[np.intp], usable: NDArray[np.intp], share: FloatArray, view: PanoramaView
) -> NDArray[np.intp]:
    """Usable pixels in the shade, not far from the patch in the panorama."""
    picture = np.zeros(view.height * view.width, dtype=bool)
    picture[usable[in_patch]] = True
    reach = int(view.height * view.tuned.mask_reach / 180.0)
    around = maximum_filter(picture.reshape(view.height, view.width), size=2 * reach + 1, mode=("nearest", "wrap"))
    edge = maximum_filter(picture.reshape(view.height, view.width), size=view.tuned.mask_rim, mode=("nearest", "wrap"))
    wanted = (around & ~edge).reshape(-1)[usable]
    return np.flatnonzero(wanted & (share == 0.0))


def _irradiance(
    explained: ExplainedLight, points: FloatArray, normals: FloatArray, tuned: LightingParameters
) -> FloatArray:
    """Irradiance at many points, from some of them."""
    from scipy.spatial import cKDTree

    some = np.arange(0, len(points), max(1, len(points) // tuned.mask_light_points))
    known = explained.irradiance(points[some], normals[some], tuned.mask_samples)
    scale = max(float(np.ptp(points, axis=0).max()), 1e-6)
    features = np.concatenate([points, scale * normals], axis=1)
    distance, neighbour = cKDTree(features[some]).query(features, k=min(tuned.mask_light_neighbours, len(some)))
    distance, neighbour = distance.reshape(len(points), -1), neighbour.reshape(len(points), -1)
    weight = 1.0 / (distance + 1e-3 * scale)
    return np.asarray((weight[..., None] * known[neighbour]).sum(axis=1) / weight.sum(axis=1)[:, None])


def _projected(
    points: FloatArray, transmittance: FloatArray, openings: FloatArray, sun: SunLight, view: PanoramaView
) -> SunMask:
    """Values at points on a grid across the direction; what lies between and around them takes the nearest.

    It reaches over all the openings, since nothing passes beyond it.
    """
    axes = np.stack(sun_axes(sun.direction))
    across = points @ axes.T
    distance = np.linalg.norm(points - view.position, axis=1)
    texel = view.tuned.mask_fineness * float(np.median(distance)) * np.pi / view.height
    whole = np.concatenate([across, openings @ axes.T])
    low, high = whole.min(axis=0) - view.tuned.mask_margin * texel, whole.max(axis=0) + view.tuned.mask_margin * texel
    texel = max(texel, float((high - low).max()) / view.tuned.mask_largest)
    columns, rows = np.maximum(np.ceil((high - low) / texel).astype(int), 2)
    high = low + texel * np.array([columns, rows])
    column = ((across[:, 0] - low[0]) / texel).astype(int)
    row = ((high[1] - across[:, 1]) / texel).astype(int)
    sums, counts = np.zeros((rows, columns, 3)), np.zeros((rows, columns, 1))
    np.add.at(sums, (row, column), transmittance)
    np.add.at(counts, (row, column), 1.0)
    _, nearest = distance_transform_edt(counts[..., 0] == 0.0, return_indices=True)
    values = (sums / np.maximum(counts, 1.0))[tuple(nearest)]
    extent = (float(low[0]), float(low[1]), float(high[0]), float(high[1]))
    return SunMask(values.astype(np.float32), sun.irradiance, extent)
