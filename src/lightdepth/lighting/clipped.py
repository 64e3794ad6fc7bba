"""Recovering sources of light that the panorama clipped, from what they light."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from lightdepth.calibration.clicks import read_clicks
from lightdepth.directions import FloatArray, direction_to_latlong, pixel_directions, pixel_solid_angles
from lightdepth.errors import InputError
from lightdepth.kernel.raycasting import RayCaster
from lightdepth.lighting.clipped_sources import Plateau, find_plateaus
from lightdepth.lighting.explained import ExplainedLight
from lightdepth.lighting.falloff import fit_gain
from lightdepth.lighting.panorama_view import PanoramaView
from lightdepth.lighting.patches import Clicks
from lightdepth.lighting.sun_edges import align, measured, predicted_edges
from lightdepth.lighting.sun_irradiance import combine, compare_sides
from lightdepth.lighting.sun_mask import with_masks
from lightdepth.lighting.sun_search import SunSearch
from lightdepth.lighting.sunlight import Sunlight
from lightdepth.parameters.lighting import DEFAULT, LightingParameters
from lightdepth.scene.lights.clipped import ClippedSource, covered, unclipped
from lightdepth.scene.model import Panorama, Scene

TOO_DARK = (
    "--grey: with this albedo the place is darker than the panorama's own light makes it; the albedo is too large, or the "
    "place is in shadow"
)


@dataclass(frozen=True)
class RecoveredSource:
    """A clipped source.

    Attributes:
        plateau: what the panorama shows of it.
        source: with its radiance; ``None`` where nothing determines it, or nothing was lost.
        method: ``shadow edges``, ``clicked pairs``, ``known albedo``, ``falloff``, ``none``, or ``not clipped`` where
            it lights things no more than the panorama says.
        irradiance: of the source on a surface at the capture point that faces it, linear RGB, shape (3,); the map's own
            where there is no better one.
        clipped_irradiance: the same as the panorama has it.
        low: lower bound of ``irradiance``, from albedos that matte surfaces can have.
        high: upper bound.
        uncertainty: relative standard error of ``irradiance``, shape (3,); NaN for none.
        confidence: ``good``, ``fair``, ``poor`` or ``none``.
    """

    plateau: Plateau
    source: ClippedSource | None
    method: str
    irradiance: FloatArray
    clipped_irradiance: FloatArray
    low: FloatArray
    high: FloatArray
    uncertainty: FloatArray
    confidence: str


@dataclass(frozen=True)
class Pair:
    """Two clicked places of one material, the first in the source's light and the second in its shadow."""

    lit: FloatArray
    shaded: FloatArray


def recover_clipped(
    scene: Scene, pairs: Sequence[str] = (), grey: Sequence[str] = (), diameter: float = 0.53
) -> list[RecoveredSource]:
    """Find what clipped sources really send.

    Args:
        scene: the place; the suns that it declares count as light that is known.
        pairs: ``"x,y x,y"``: a place lit by the source and one of the same material in its shadow, in pixels.
        grey: ``"x,y albedo"`` or ``"x,y red green blue"``: a place whose albedo is known, such as a grey card, lit by the
            source.
        diameter: of the sun's disc, degrees; its radiance is limited to it where the sky around it clipped too.

    Returns:
        The sources, the largest first; empty where nothing clipped.

    Raises:
        InputError: clicks that are none, lie beside the surfaces, or contradict each other; no real surfaces.
    """
    scene = replace(scene, panorama=replace(scene.panorama, unclipped=None), lights=with_masks(scene))
    view = PanoramaView(scene)
    size = scene.panorama.radiance.shape[:2]
    height, width = size
    caster = RayCaster([surface.mesh for surface in scene.real])
    directions = pixel_directions(height, width).reshape(-1, 3) @ scene.panorama.rotation.T
    distance = caster.cast(scene.panorama.position, directions).distance.reshape(size)
    plateaus = find_plateaus(scene, distance)
    clicked = [_read_pair(text, size, view) for text in pairs]
    known = [_read_grey(text, size, view) for text in grey]
    if known and not clicked and len(plateaus) > 1 and not any(plateau.sky for plateau in plateaus):
        return _together(scene, view, plateaus, known)
    if (clicked or known) and len(plateaus) > 1:
        plateaus = plateaus[:1]  # Clicks are about the strongest one.
    results: dict[int, RecoveredSource] = {}
    for _ in range(view.tuned.clipped_rounds if len(plateaus) > 1 else 1):
        for index, plateau in enumerate(plateaus):
            # The light of the others as far as it is known by now.
            light = scene.panorama.radiance
            for other, result in results.items():
                if other != index and result.source is not None:
                    light = unclipped(light, result.source)
            lit = replace(scene, panorama=replace(scene.panorama, radiance=light))
            results[index] = _recovered(lit, view, plateau, clicked, known, diameter)
    return list(results.values())


def _recovered(
    scene: Scene,
    view: PanoramaView,
    plateau: Plateau,
    pairs: Sequence[Pair],
    grey: Sequence[tuple[FloatArray, FloatArray]],
    diameter: float,
) -> RecoveredSource:
    explained = ExplainedLight.of(scene, lights=scene.lights)
    sunlight = Sunlight(scene) if plateau.sky else None
    direction = plateau.direction
    sun = plateau.sky and plateau.angular_radius > 0.5 * diameter
    small = max(view.tuned.clipped_small, view.tuned.clipped_beside * diameter)
    if sunlight is not None and plateau.angular_radius > small:
        found = _sun_within(scene, view, sunlight, explained, plateau)
        direction, sun = (plateau.direction, False) if found is None else (found, True)
    place = _source_at(scene, plateau, direction, diameter if sun else None)
    share = covered(scene.panorama.radiance, place)
    angles = pixel_solid_angles(*share.shape)[:, None] * share
    now = (scene.panorama.radiance * angles[..., None]).sum(axis=(0, 1)).astype(np.float64)
    low, high = _bounds(scene, view, explained, place, now)
    nothing = RecoveredSource(plateau, None, "none", now, now, low, high, np.full(3, np.nan), "none")
    extra, error, method = None, np.full(3, np.nan), "none"
    if grey:
        extra, error, method = (*_from_grey(view, explained, grey, direction, now), "known albedo")
    elif pairs:
        only = ExplainedLight.of(scene, _alone(scene, share))
        extra, error, method = (*_from_pairs(view, explained, only, pairs, direction, now), "clicked pairs")
    elif sunlight is not None:
        edges = measured(view, predicted_edges(view, sunlight, direction), view.tuned.clipped_reach)
        edges = edges.where(np.isfinite(edges.offset))
        compared = compare_sides(view, sunlight, explained, edges, direction, max(diameter, 0.01))
        if len(compared.irradiance) >= view.tuned.fewest_pairs:
            combined = combine(compared, view.tuned)
            extra, error, method = combined.value, combined.uncertainty, "shadow edges"
    if extra is None:
        gain, relative = fit_gain(scene, view, share)
        if gain is None or not np.all(relative <= view.tuned.clipped_largest_error):
            return nothing
        extra, error, method = (gain - 1.0) * now, relative * gain * now, "falloff"
    glow = plateau.sky and not sun and plateau.angular_radius <= view.tuned.clipped_largest_glow
    if glow and float(extra.sum()) > view.tuned.clipped_more_than_glow * float(now.sum()):
        place = _source_at(scene, plateau, direction, diameter)  # No glow misses that much: it is the sun's disc.
        share = covered(scene.panorama.radiance, place)
        angles = pixel_solid_angles(*share.shape)[:, None] * share
        now = (scene.panorama.radiance * angles[..., None]).sum(axis=(0, 1)).astype(np.float64)
        nothing = replace(nothing, clipped_irradiance=now)
    total = np.maximum(now + extra, now)
    if float((total - now).sum()) <= view.tuned.not_clipped * float(total.sum()):
        return replace(nothing, method="not clipped")
    relative = error / np.maximum(total, 1e-30)
    radiance = total / float(angles.sum())
    confidence = _confidence(relative, view.tuned)
    if method == "falloff" and confidence == "good":
        confidence = "fair"
    source = replace(place, radiance=radiance)
    return RecoveredSource(plateau, source, method, total, now, low, high, relative, confidence)


def _together(
    scene: Scene, view: PanoramaView, plateaus: Sequence[Plateau], grey: Sequence[tuple[FloatArray, FloatArray]]
) -> list[RecoveredSource]:
    """Several lamps from places of known albedo; those that the places do not tell apart get one gain in common."""
    explained = ExplainedLight.of(scene, lights=scene.lights)
    places, albedo = (np.array(each) for each in zip(*grey, strict=True))
    seen = view.look(places)
    light = explained.irradiance(seen.point, seen.normal, view.tuned.pair_samples)
    missing = np.pi * _around(view, places) / albedo - light
    if np.any(np.median(missing, axis=0) < -view.tuned.not_clipped * np.median(light, axis=0)):
        raise InputError(TOO_DARK)
    sources = [_source_at(scene, plateau, plateau.direction, None) for plateau in plateaus]
    shares = [covered(scene.panorama.radiance, source) for source in sources]
    alone = [ExplainedLight.of(scene, _alone(scene, share)) for share in shares]
    given = np.stack([each.irradiance(seen.point, seen.normal, view.tuned.pair_samples) for each in alone], axis=1)
    more, errors = solve_gains(missing, given, light, view.tuned)
    explains = light + np.einsum("nkc,kc->nc", given, more)
    off = ((light + missing) / np.maximum(explains, 1e-30)).mean(axis=1)
    worst = int(np.argmax(np.maximum(off, 1.0 / np.maximum(off, 1e-30))))
    if not 1.0 / view.tuned.clipped_contradiction <= off[worst] <= view.tuned.clipped_contradiction:
        raise InputError(
            f"--grey: the clicks contradict each other: with the lamps that fit all of them best, click {worst + 1} would "
            f"have {off[worst]:.3g} times the albedo that is given"
        )
    results = []
    for plateau, source, share, extra, error in zip(plateaus, sources, shares, more, errors, strict=True):
        angles = pixel_solid_angles(*share.shape)[:, None] * share
        now = (scene.panorama.radiance * angles[..., None]).sum(axis=(0, 1)).astype(np.float64)
        low, high = _bounds(scene, view, explained, source, now)
        if float((extra * now).sum()) <= view.tuned.not_clipped * float(((1.0 + extra) * now).sum()):
            none = np.full(3, np.nan)
            results.append(RecoveredSource(plateau, None, "not clipped", now, now, low, high, none, "none"))
            continue
        total, relative = (1.0 + extra) * now, error / (1.0 + extra)
        found = replace(source, radiance=total / float(angles.sum()))
        confidence = _confidence(relative, view.tuned)
        results.append(RecoveredSource(plateau, found, "known albedo", total, now, low, high, relative, confidence))
    return results


def solve_gains(
    missing: FloatArray, given: FloatArray, light: FloatArray, tuned: LightingParameters = DEFAULT
) -> tuple[FloatArray, FloatArray]:
    """What sources send beyond what they were clipped to, as factors of it, and their standard errors.

    Least squares without negative values (Lawson and Hanson), with a weak pull toward the factor that fits best if it is
    the same for all: sources that no place tells apart share it.

    Args:
        missing: irradiance that places lack, shape (n, 3).
        given: that each clipped source gives them, shape (n, k, 3).
        light: all that they get in the clipped map, shape (n, 3).
        tuned: how sure the places are.

    Returns:
        Two arrays of shape (k, 3).
    """
    from scipy.optimize import nnls

    count = given.shape[1]
    factors, errors = np.zeros((count, 3)), np.zeros((count, 3))
    for channel in range(3):
        weight = 1.0 / (tuned.clipped_place_error * np.maximum(light[:, channel], 1e-30))
        matrix, wanted = given[..., channel] * weight[:, None], missing[:, channel] * weight
        whole = matrix.sum(axis=1)
        common = max(float(whole @ wanted / max(float(whole @ whole), 1e-30)), 1e-6)
        pull = np.eye(count) / (tuned.clipped_gain_spread * common)
        factors[:, channel], _ = nnls(np.vstack([matrix, pull]), np.concatenate([wanted, common * pull.sum(axis=0)]))
        errors[:, channel] = np.sqrt(np.diag(np.linalg.inv(matrix.T @ matrix + pull @ pull)))
    return factors, errors


def _confidence(relative: FloatArray, tuned: LightingParameters) -> str:
    worst = float(np.nanmax(relative)) if np.isfinite(relative).any() else 1.0
    return "good" if worst <= tuned.clipped_good_error else "fair" if worst <= tuned.clipped_fair_error else "poor"


def _source_at(scene: Scene, plateau: Plateau, direction: FloatArray, diameter: float | None) -> ClippedSource:
    if diameter is None:
        return ClippedSource(plateau.pixel, np.zeros(3))
    u, v = direction_to_latlong(direction @ scene.panorama.rotation)
    height, width = scene.panorama.radiance.shape[:2]
    return ClippedSource((float(u) * width % width, min(float(v) * height, height - 1e-3)), np.zeros(3), diameter)


def _sun_within(
    scene: Scene, view: PanoramaView, sunlight: Sunlight, explained: ExplainedLight, plateau: Plateau
) -> FloatArray | None:
    """The sun's direction inside a plateau of sky that is much larger than it, from the shadows that the model throws."""
    height, width = plateau.pixels.shape

    def inside(directions: FloatArray) -> NDArray[np.bool_]:
        u, v = direction_to_latlong(directions @ scene.panorama.rotation)
        return plateau.pixels[np.minimum((v * height).astype(int), height - 1), (u * width).astype(int) % width]

    search = SunSearch(view, sunlight, explained, Clicks(), inside)
    fits = [fit for fit in (align(view, sunlight, each.direction) for each in search.best()[:3]) if fit is not None]
    fits = [fit for fit in fits if inside(fit.direction[None])[0]]
    return max(fits, key=lambda fit: fit.quality).direction if fits else None


def _from_pairs(
    view: PanoramaView,
    explained: ExplainedLight,
    only: ExplainedLight,
    pairs: Sequence[Pair],
    direction: FloatArray,
    now: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Irradiance beyond the map's on a surface that faces the source, from clicked pairs, and its standard error.

    Args:
        view: the photograph.
        explained: all light of the map.
        only: that of the source alone.
        pairs: what was clicked.
        direction: toward the source, unit, world, shape (3,).
        now: its irradiance as the panorama has it, shape (3,).
    """
    lit, shaded = np.array([pair.lit for pair in pairs]), np.array([pair.shaded for pair in pairs])
    seen_lit, seen_shaded = view.look(lit), view.look(shaded)
    light = explained.irradiance(seen_lit.point, seen_lit.normal, view.tuned.pair_samples)
    # What throws the shadow may not be modelled; the source's light does not arrive there even so.
    shade = explained.irradiance(seen_shaded.point, seen_shaded.normal, view.tuned.pair_samples)
    shade = np.maximum(shade - only.irradiance(seen_shaded.point, seen_shaded.normal, view.tuned.pair_samples), 0.0)
    cosine = seen_lit.normal @ direction
    if np.any(cosine <= view.tuned.clicked_grazing):
        raise InputError("--pair: a surface that is said to be lit faces away from the clipped source")
    ratio = _around(view, lit) / np.maximum(_around(view, shaded), 1e-30)
    values = (ratio * shade - light) / cosine[:, None]
    if np.any(np.median(values, axis=0) < 0.0):
        raise InputError(
            "--pair: the places contradict each other: the first of each pair must be in the source's light and brighter "
            "than the second, in its shadow, for all that the map explains"
        )
    _check_agreement("--pair", now + values, now, view.tuned)
    return _median(values, view.tuned)


def _from_grey(
    view: PanoramaView,
    explained: ExplainedLight,
    grey: Sequence[tuple[FloatArray, FloatArray]],
    direction: FloatArray,
    now: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """The same from places of known albedo."""
    places = np.array([place for place, _ in grey])
    albedo = np.array([value for _, value in grey])
    seen = view.look(places)
    cosine = seen.normal @ direction
    if np.any(cosine <= view.tuned.clicked_grazing):
        raise InputError("--grey: the surface faces away from the clipped source")
    light = explained.irradiance(seen.point, seen.normal, view.tuned.pair_samples)
    values = (np.pi * _around(view, places) / albedo - light) / cosine[:, None]
    if np.any(np.median(values, axis=0) < -view.tuned.clicked_too_dark * now):
        raise InputError(TOO_DARK)
    _check_agreement("--grey", now + values, now, view.tuned)
    return _median(values, view.tuned)


def _check_agreement(option: str, irradiance: FloatArray, now: FloatArray, tuned: LightingParameters) -> None:
    """Refuse clicks of which each says something else of the source, by its irradiance of shape (n, 3)."""
    total = irradiance.sum(axis=1)
    least, most = int(np.argmin(total)), int(np.argmax(total))
    if total[most] <= tuned.clipped_contradiction * max(total[least], 1e-30):
        return
    raise InputError(
        f"{option}: the clicks contradict each other: by click {least + 1} the source sends "
        f"{total[least] / now.sum():.3g} times its clipped light, by click {most + 1} {total[most] / now.sum():.3g} times"
    )


def _median(values: FloatArray, tuned: LightingParameters) -> tuple[FloatArray, FloatArray]:
    value = np.median(values, axis=0)
    if len(values) < 3:
        return value, np.maximum(tuned.clicked_error * np.abs(value), 0.5 * np.ptp(values, axis=0))
    deviation = 1.4826 * np.median(np.abs(values - value), axis=0)
    return value, 1.2533 * deviation / np.sqrt(len(values))


def _around(view: PanoramaView, places: FloatArray) -> FloatArray:
    """Mean radiance of 3 by 3 pixels."""
    steps = [np.array([dx, dy]) for dx in (-1.0, 0.0, 1.0) for dy in (-1.0, 0.0, 1.0)]
    return np.asarray(np.mean([view.colour(places + step) for step in steps], axis=0))


def _bounds(
    scene: Scene, view: PanoramaView, explained: ExplainedLight, place: ClippedSource, now: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Irradiances of the source between which every lit surface has an albedo that matte surfaces can have."""
    only = ExplainedLight.of(scene, _alone(scene, covered(scene.panorama.radiance, place)))
    pixels = view.centers()
    rng = np.random.default_rng(scene.render.seed)
    pixels = pixels[rng.choice(len(pixels), min(view.tuned.clipped_points, len(pixels)), replace=False)]
    seen = view.look(pixels)
    usable = (seen.surface >= 0) & ~view.opening[seen.surface]
    points, normals = seen.point[usable], seen.normal[usable]
    source, light = (each.irradiance(points, normals, view.tuned.clipped_samples) for each in (only, explained))
    white = np.pi * view.colour(pixels[usable])
    strength = source.mean(axis=1)
    lit = strength > view.tuned.clipped_lit * float(strength.max(initial=0.0))
    if not lit.any():
        return now, np.full(3, np.inf)
    gains = [
        ((white[lit] / albedo) - light[lit]) / source[lit].clip(1e-30) + 1.0
        for albedo in (view.tuned.clipped_whitest, view.tuned.clipped_darkest)
    ]
    lowest = np.maximum(np.percentile(gains[0], 100.0 * view.tuned.clipped_surely, axis=0), 1.0)
    return lowest * now, np.maximum(np.median(gains[1], axis=0), lowest) * now


def _alone(scene: Scene, share: FloatArray) -> Panorama:
    radiance = scene.panorama.radiance * share[..., None].astype(np.float32)
    return replace(scene.panorama, radiance=radiance)


def _read_pair(text: str, size: tuple[int, int], view: PanoramaView) -> Pair:
    lit, shaded = _places(read_clicks(text, size, "--pair", 2), view, "--pair")
    return Pair(lit, shaded)


def _read_grey(text: str, size: tuple[int, int], view: PanoramaView) -> tuple[FloatArray, FloatArray]:
    words = text.split()
    try:
        albedo = np.array([float(word) for word in words[1:]])
    except ValueError:
        albedo = np.zeros(0)
    if len(albedo) not in (1, 3):
        raise InputError(f'--grey: \'{text}\': write a place and its albedo as "x,y albedo" or "x,y red green blue"')
    if not np.all((albedo >= 0.01) & (albedo <= 1.0)):
        raise InputError(f"--grey: '{text}': the albedo is not between 0.01 and 1")
    albedo = np.broadcast_to(albedo, 3)
    return _places(read_clicks(words[0], size, "--grey", 1), view, "--grey")[0], albedo


def _places(clicks: FloatArray, view: PanoramaView, option: str) -> FloatArray:
    """Clicked places as pixels of the view; they must lie on surfaces."""
    u, v = direction_to_latlong(clicks)
    pixels = np.stack([u * view.width, v * view.height], axis=-1)
    nowhere = np.flatnonzero(view.look(pixels).surface < 0)
    if len(nowhere):
        raise InputError(f"{option}: point {nowhere[0] + 1} lies on no real surface")
    return pixels
