"""The methods of rendering, and a scene made ready for one of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import mitsuba as mi
import numpy as np

from lightdepth.cancellation import raise_if_cancelled
from lightdepth.errors import InputError
from lightdepth.kernel.shapes import enclosing_sphere, is_polished, synthetic_shapes
from lightdepth.lightmap.depth_mesh import mesh_from_depth
from lightdepth.place.object_bounds import ObjectBounds
from lightdepth.place.place import Place
from lightdepth.place.real_surfaces import merge_real_surfaces
from lightdepth.place.traced_surfaces import TracedSurfaces
from lightdepth.recovery.specular import recover_mirrored, with_fitted_glosses
from lightdepth.recovery.support_irradiance import IrradianceReport, recover_irradiance
from lightdepth.recovery.unseen_albedo import recover_hidden
from lightdepth.scene.model import RealSurface, Role, Scene
from lightdepth.transport.difference import DifferenceIntegrator
from lightdepth.transport.envpath import EnvpathIntegrator, support_with_scale_factors
from lightdepth.transport.integrator import Integrator


@dataclass(frozen=True)
class Prepared:
    """A scene ready to be sampled from any camera.

    Attributes:
        place: the photographed place.
        surfaces: real and synthetic surfaces.
        integrator: estimates along camera rays.
        shapes: the synthetic shapes, each with the index of its object in the scene.
        irradiance: how well the irradiance of the support is known.
    """

    place: Place
    surfaces: TracedSurfaces
    integrator: Integrator[Any]
    shapes: tuple[tuple[int, mi.Shape], ...]
    irradiance: IrradianceReport


def _difference(scene: Scene, infinite: bool = False) -> Prepared:
    generator = np.random.default_rng(scene.render.seed)
    modelled = merge_real_surfaces(_real_surfaces(scene))
    # What is deformed took its colour, and the light that goes with it, where it was when it was photographed.
    photographed = replace(modelled, vertices=modelled.rest)
    empty = Place(scene.panorama, TracedSurfaces(photographed), infinite, suns=scene.lights)
    samples = scene.render.irradiance_samples
    draft = scene.render.draft
    if not (infinite or modelled.deformed or draft):  # It would be a quarter of a draft's time.
        empty, modelled = recover_hidden(empty, modelled, generator, samples)
    raise_if_cancelled()
    shapes = tuple(synthetic_shapes(scene))
    bounds = _bounds(shapes)
    spheres = bounds.spheres if bounds is not None else []
    modelled = with_fitted_glosses(empty, modelled)
    real, report = recover_irradiance(empty, modelled, spheres, generator, samples)
    raise_if_cancelled()
    surfaces = TracedSurfaces(real, [shape for _, shape in shapes])
    empty = recover_mirrored(empty, modelled)
    place = empty.with_surfaces(surfaces)
    if modelled.deformed:
        place = Place(scene.panorama, surfaces, infinite, suns=scene.lights)
    settings = scene.render
    # The kernel of light paths takes longer to compile than a draft's noise is worth.
    polished = [] if draft else [each for each in shapes if is_polished(each[1])]
    integrator = DifferenceIntegrator(
        place, surfaces, bounds, settings.max_bounces, real.glosses, settings.clamp_indirect, _bounds(polished)
    )
    return Prepared(place, surfaces, integrator, shapes, report)


def _directional(scene: Scene) -> Prepared:
    return _difference(scene, infinite=True)


def _envpath(scene: Scene) -> Prepared:
    if scene.lights:
        raise InputError(
            f"{scene.path or 'scene'}: method 'envpath' cannot use [[light]] '{scene.lights[0].name}'; "
            "use 'difference' or 'directional'"
        )
    modelled = merge_real_surfaces(_real_surfaces(scene))
    shapes = tuple(synthetic_shapes(scene))
    real = support_with_scale_factors(scene, modelled)
    surfaces = TracedSurfaces(real, [shape for _, shape in shapes])
    place = Place(scene.panorama, surfaces, alone=True)
    integrator = EnvpathIntegrator(place, surfaces, scene.panorama, _bounds(shapes), scene.render.max_bounces)
    return Prepared(place, surfaces, integrator, shapes, IrradianceReport(len(real.vertices), math.nan, math.nan))


METHODS: dict[str, Callable[[Scene], Prepared]] = {
    "difference": _difference,
    "directional": _directional,
    "envpath": _envpath,
}
"""The methods by name. A new one is a file in this folder and a line here."""


def _real_surfaces(scene: Scene) -> Sequence[RealSurface]:
    """The modelled surfaces; where there are none, one made from the panorama's depth, all of it support."""
    panorama = scene.panorama
    if scene.real or panorama.depth is None:
        return scene.real
    mesh = mesh_from_depth(panorama.depth, panorama.position, panorama.rotation)
    return (RealSurface("depth", mesh, Role.SUPPORT),)


def _bounds(shapes: Sequence[tuple[int, mi.Shape]]) -> ObjectBounds | None:
    return ObjectBounds([enclosing_sphere(shape) for _, shape in shapes]) if shapes else None
