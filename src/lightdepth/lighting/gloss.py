"""Recovering how glossy real surfaces are, from what the photograph shows of bright sources mirrored in them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lightdepth.directions import FloatArray
from lightdepth.errors import InputError
from lightdepth.lighting.gloss_fit import Fit, find_pairs, fit_lobe
from lightdepth.lighting.mirror_images import ROUGHNESSES, Mirror, MirrorImages
from lightdepth.lighting.panorama_view import PanoramaView
from lightdepth.parameters.lighting import LightingParameters
from lightdepth.scene.model import Gloss, Role, Scene


@dataclass(frozen=True)
class SourceFit:
    """What the mirror image of one source says.

    Attributes:
        direction: toward the source from the capture point, unit, world, shape (3,).
        fit: the lobe that explains it best.
    """

    direction: FloatArray
    fit: Fit


@dataclass(frozen=True)
class RecoveredGloss:
    """Gloss of one surface.

    Attributes:
        name: of the surface.
        gloss: with the typical albedo beneath it; ``None`` where the photograph does not determine it.
        finding: ``gloss``, or ``too bright``, where highlights are brighter than any dielectric mirrors the sources, and
            ``gloss`` is the closest that is one; or why there is none: ``unseen`` by the capture point, ``no source`` is
            mirrored where it sees the surface, ``matte`` (mirror images of sources do not show), ``undetermined``.
        fit: the lobe that explains the highlights best; ``None`` without any.
        by_source: the same from each bright source that is mirrored, the strongest first, where it shows.
        confidence: ``good``, ``fair``, ``poor`` or ``none``.
        images: what the surface shows and would mirror; ``None`` where there is no bright source at all.
    """

    name: str
    gloss: Gloss | None
    finding: str
    fit: Fit | None
    by_source: tuple[SourceFit, ...]
    confidence: str
    images: MirrorImages | None


def recover_gloss(scene: Scene, names: Sequence[str] = ()) -> list[RecoveredGloss]:
    """Find the gloss of surfaces.

    Args:
        scene: the place; gloss that it declares plays no part.
        names: of the surfaces; all support by default.

    Raises:
        InputError: no real surfaces, none of such a name, no support, or a surface that has no one look to recover.
    """
    view = PanoramaView(scene)
    mirror = Mirror(scene, view)
    chosen = _chosen(scene, names)
    if not len(mirror.directions):
        return [RecoveredGloss(view.names[index], None, "no source", None, (), "none", None) for index in chosen]
    return [_recovered(view.names[index], mirror.images(index), view.tuned) for index in chosen]


def _chosen(scene: Scene, names: Sequence[str]) -> list[int]:
    place = scene.path or "scene"
    known = [surface.name for surface in scene.real]
    for name in names:
        if name not in known:
            raise InputError(f"{place}: no [[real]] surface '{name}'; it has {', '.join(known)}")
    chosen = [i for i, each in enumerate(scene.real) if each.name in names or (not names and each.role is Role.SUPPORT)]
    if not chosen:
        raise InputError(f"{place}: no surface is support; name the one that shines with --surface")
    for index in chosen:
        surface = scene.real[index]
        if surface.mesh.rest is not None and names:
            raise InputError(f"{place}: '{surface.name}' has rest positions; it does not lie where it was photographed")
        if surface.opening:
            raise InputError(f"{place}: '{surface.name}' is an opening; what it shows lies behind it")
    return [index for index in chosen if scene.real[index].mesh.rest is None]


def _recovered(name: str, images: MirrorImages, tuned: LightingParameters) -> RecoveredGloss:
    def nothing(finding: str, fit: Fit | None = None, sources: tuple[SourceFit, ...] = ()) -> RecoveredGloss:
        return RecoveredGloss(name, None, finding, fit, sources, "none", images)

    if not len(images.row):
        return nothing("unseen")
    pairs = find_pairs(images, tuned)
    near = (images.source[pairs.first] >= 0) | (images.source[pairs.second] >= 0)
    if np.count_nonzero(near) < tuned.gloss_fewest_pairs:
        return nothing("no source")
    fit = fit_lobe(images, pairs, tuned=tuned)
    if not _shows(fit, tuned):
        return nothing("matte", fit)
    by_source = []
    for index, direction in enumerate(images.directions):
        own = pairs.where((images.source[pairs.first] == index) | (images.source[pairs.second] == index))
        if len(own.first) >= tuned.gloss_fewest_pairs:
            alone = fit_lobe(images, own, tuned=tuned)
            by_source += [SourceFit(direction, alone)] if _shows(alone, tuned) else []
    sources = tuple(by_source)
    low, high = fit.roughness_bounds
    if high - low > tuned.gloss_widest or low >= ROUGHNESSES[-2]:
        return nothing("undetermined", fit, sources)
    too_bright = fit.specular_bounds[0] > 1.0
    best = fit_lobe(images, pairs, most=1.0, tuned=tuned) if too_bright else fit
    roughness, specular = round(best.roughness, 3), round(min(best.specular, 1.0), 3)
    return RecoveredGloss(
        name,
        Gloss(roughness, specular, albedo=_albedo(images, roughness, specular)),
        "too bright" if too_bright else "gloss",
        fit,
        sources,
        "poor" if too_bright else _confidence(fit, sources, tuned),
        images,
    )


def _shows(fit: Fit, tuned: LightingParameters) -> bool:
    return fit.certain >= tuned.gloss_least_certain and fit.explained >= tuned.gloss_least_explained


def _albedo(images: MirrorImages, roughness: float, specular: float) -> tuple[float, float, float]:
    diffuse = np.maximum(images.shown - images.mirrored(roughness, specular), 0.0)
    red, green, blue = np.median(np.pi * diffuse / np.maximum(images.irradiance, 1e-30), axis=0).tolist()
    return red, green, blue


def _confidence(fit: Fit, sources: Sequence[SourceFit], tuned: LightingParameters) -> str:
    width = fit.roughness_bounds[1] - fit.roughness_bounds[0]
    # One source alone cannot contradict itself.
    spread = float(np.std([each.fit.roughness for each in sources])) if len(sources) > 1 else tuned.gloss_fair_spread
    if width <= tuned.gloss_good_width and spread <= tuned.gloss_good_spread:
        return "good"
    return "fair" if width <= tuned.gloss_fair_width and spread <= tuned.gloss_fair_spread else "poor"
