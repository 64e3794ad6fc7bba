"""Recovering a sun that the capture point does not see."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from lightdepth.directions import FloatArray
from lightdepth.errors import InputError
from lightdepth.lighting.explained import ExplainedLight
from lightdepth.lighting.panorama_view import PanoramaView
from lightdepth.lighting.patches import Clicks, inside, read_patches
from lightdepth.lighting.sun_edges import Alignment, Edges, align, measured, predicted_edges
from lightdepth.lighting.sun_irradiance import SunIrradiance, combine, compare_sides
from lightdepth.lighting.sun_search import SunSearch
from lightdepth.lighting.sunlight import Sunlight
from lightdepth.parameters.lighting import LightingParameters
from lightdepth.scene.lights.frame import azimuth_and_elevation
from lightdepth.scene.model import Scene, SunLight


@dataclass(frozen=True)
class RecoveredSun:
    """A sun.

    Attributes:
        direction: toward it, unit, world, shape (3,).
        diameter: of its disc, degrees.
        direction_uncertainty: standard error, degrees; 0 where the direction was given.
        agreement: correlation of what it lights with what is bright, in [-1, 1].
        found_edges: share of the predicted edges that the photograph shows.
        residual: root mean square distance between predicted and photographed edges, heights of a pixel.
        irradiance: on a surface that faces it.
        by_surface: that from each real surface alone, linear RGB, by name.
        confidence: ``good``, ``fair`` or ``poor``.
    """

    direction: FloatArray
    diameter: float
    direction_uncertainty: float
    agreement: float
    found_edges: float
    residual: float
    irradiance: SunIrradiance
    by_surface: dict[str, FloatArray]
    confidence: str

    def light(self, name: str = "sun") -> SunLight:
        """The sun as a light of the scene, without a mask."""
        return SunLight(name, self.direction, self.diameter, self.irradiance.value)


def recover_sun(
    scene: Scene,
    patches: Sequence[str] = (),
    direction: FloatArray | None = None,
    diameter: float = 0.53,
) -> RecoveredSun:
    """Find the direction and the irradiance of the sun that shines into a place.

    Args:
        scene: the place; its openings let the sun in.
        patches: clicked outlines of patches, or places in the sun, ``"x,y x,y ..."``; without them they are found.
        direction: toward the sun where it is known, world, shape (3,); only the irradiance is recovered then.
        diameter: of the sun's disc, degrees.

    Raises:
        InputError: nothing lets the sun in; there is no patch that a sun would make; the clicks contradict each other;
            the sun would be below the horizon; the capture point sees it; or no edge of the patch has one material on
            both sides.
    """
    name = scene.path or "scene"
    sunlight = Sunlight(scene)
    view = PanoramaView(scene)
    clicks = read_patches(patches, view, scene.panorama.radiance.shape[:2])
    explained = ExplainedLight.of(scene)
    search = SunSearch(view, sunlight, explained, clicks)
    if direction is not None:
        direction = np.asarray(direction, dtype=np.float64) / np.linalg.norm(direction)
        _check_horizon(str(name), direction)
        edges = measured(view, predicted_edges(view, sunlight, direction), view.tuned.sun_given_reach)
        found = np.isfinite(edges.offset)
        alignment = Alignment(
            direction, 0.0, edges.where(found), len(edges.pixel), _root(edges.offset[found]), view.tuned.edge_exact
        )
    else:
        alignment = _searched(str(name), view, sunlight, search, clicks)
        direction = alignment.direction
        _check_horizon(str(name), direction)
    if sunlight.sees(scene.panorama.position, direction):
        x, y = view.pixels(scene.panorama.position + direction[None])[0]
        scale = scene.panorama.radiance.shape[1] / view.width
        raise InputError(
            f"{name}: the capture point itself sees the sun, at pixel {x * scale:.0f},{y * scale:.0f}: its light is in the "
            "panorama already and would be counted twice; where it was clipped, use `lightdepth recover clipped`"
        )
    irradiance, by_surface = _irradiance(str(name), view, sunlight, explained, alignment.edges, direction, diameter)
    share = len(alignment.edges.pixel) / max(alignment.predicted, 1)
    return RecoveredSun(
        direction,
        diameter,
        alignment.uncertainty,
        search.agreement(direction),
        share,
        alignment.residual,
        irradiance,
        by_surface,
        _confidence(share, irradiance, alignment.uncertainty, view.tuned),
    )


def _searched(name: str, view: PanoramaView, sunlight: Sunlight, search: SunSearch, clicks: Clicks) -> Alignment:
    candidates = search.best()
    clicked = bool(clicks.polygons or len(clicks.points))
    least = view.tuned.sun_least_clicked if clicks.polygons else view.tuned.sun_least_agreement
    if not candidates:
        if clicked:
            raise InputError(
                f"{name}: the clicks contradict each other or the model: from no direction of the sky does the sun reach "
                "all the places of --patch through the modelled openings"
            )
        raise InputError(f"{name}: through the modelled openings the sun reaches nothing that the capture point sees")
    best = candidates[0]
    if best.agreement < least:
        azimuth, elevation = azimuth_and_elevation(best.direction)
        raise InputError(
            f"{name}: no direction of the sun explains "
            + (
                "the clicked patches: they contradict each other, or the openings are not where they are modelled"
                if clicked
                else "what is bright in the photograph; if there is a patch of sun, click it with --patch"
            )
            + f" (the best is azimuth {azimuth:.1f}, elevation {elevation:.1f} degrees, with a correlation of "
            f"{best.agreement:.2f}; {least:g} is needed)"
        )
    for number, polygon in enumerate(clicks.polygons, start=1):
        pixels = view.centers()
        pixels = pixels[inside(view, polygon, pixels)]
        seen = view.look(pixels)
        lit = sunlight.lit(seen.point, seen.normal, best.direction)
        if len(pixels) and lit.mean() < view.tuned.sun_least_covered:
            azimuth, elevation = azimuth_and_elevation(best.direction)
            raise InputError(
                f"{name}: the clicked patches contradict each other: the sun that fits them best (azimuth {azimuth:.1f}, "
                f"elevation {elevation:.1f} degrees) lights {100 * lit.mean():.0f} % of patch {number}"
            )
    aligned = [(candidate, align(view, sunlight, candidate.direction)) for candidate in candidates[:3]]
    fits = [(fit, search.agreement(fit.direction)) for _, fit in aligned if fit is not None]
    if not fits:
        azimuth, elevation = azimuth_and_elevation(best.direction)
        raise InputError(
            f"{name}: the sun seems to stand at azimuth {azimuth:.1f}, elevation {elevation:.1f} degrees, but too few "
            "edges of its patch are seen on one surface to determine its direction and strength"
        )
    return max(fits, key=lambda pair: pair[1] * pair[0].quality)[0]


def _irradiance(
    name: str,
    view: PanoramaView,
    sunlight: Sunlight,
    explained: ExplainedLight,
    edges: Edges,
    direction: FloatArray,
    diameter: float,
) -> tuple[SunIrradiance, dict[str, FloatArray]]:
    pairs = compare_sides(view, sunlight, explained, edges, direction, diameter)
    if len(pairs.irradiance) < view.tuned.fewest_pairs:
        where = ", ".join(sorted({view.names[int(index)] for index in np.unique(edges.surface)})) or "no surface"
        raise InputError(
            f"{name}: the strength of the sun cannot be determined: of the patch's edges (on {where}) only "
            f"{len(pairs.irradiance)} places have lit and shaded parts of one surface side by side; "
            f"{view.tuned.fewest_pairs} are needed. Surfaces of several materials belong into several [[real]] tables; or "
            "photograph with more pixels"
        )
    result = combine(pairs, view.tuned)
    if np.any(result.value <= 0.0):
        raise InputError(
            f"{name}: what should be lit by the sun is no brighter than the shade beside it (irradiance "
            f"{', '.join(f'{value:.3g}' for value in result.value)}); the direction or the openings are wrong"
        )
    by_surface = {
        view.names[int(index)]: np.median(pairs.irradiance[pairs.surface == index], axis=0)
        for index in np.unique(pairs.surface)
        if np.count_nonzero(pairs.surface == index) >= view.tuned.fewest_pairs
    }
    return result, by_surface


def _check_horizon(name: str, direction: FloatArray) -> None:
    azimuth, elevation = azimuth_and_elevation(direction)
    if elevation <= 0.0:
        raise InputError(
            f"{name}: the sun would stand {-elevation:.1f} degrees below the horizon (azimuth {azimuth:.1f}); a patch that "
            "is lit from below comes from something that mirrors, and a sun's direction must point up"
        )


def _confidence(share: float, irradiance: SunIrradiance, uncertainty: float, tuned: LightingParameters) -> str:
    relative = float((irradiance.uncertainty / irradiance.value).max())
    if (
        share >= tuned.sun_good_share
        and irradiance.deviation <= tuned.sun_good_deviation
        and relative <= tuned.sun_good_error
        and uncertainty <= tuned.sun_good_uncertainty
    ):
        return "good"
    if (
        share >= tuned.sun_fair_share
        and irradiance.deviation <= tuned.sun_fair_deviation
        and relative <= tuned.sun_fair_error
        and uncertainty <= tuned.sun_fair_uncertainty
    ):
        return "fair"
    return "poor"


def _root(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0
