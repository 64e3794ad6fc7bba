"""The methods of rendering, and a scene made ready for one of them: its place, its objects, and an integrator."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Any, Protocol

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError, warn
from lightdepth.place.object_outline import ObjectOutline
from lightdepth.place.place import Place
from lightdepth.place.real_surfaces import merge_real_surfaces
from lightdepth.place.traced_surfaces import TracedSurfaces
from lightdepth.preparation.objects import prepare_objects
from lightdepth.preparation.place import modelled_surfaces, prepare_place
from lightdepth.preparation.plate import with_plate
from lightdepth.recovery.support_irradiance import IrradianceReport
from lightdepth.scene.model import Scene
from lightdepth.store import Store
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
        outline: of the synthetic objects; ``None`` without any.
        gains: of each photograph, per channel, shape (k, 3); ``None`` is 1.
        plates: of the place, see :class:`~lightdepth.preparation.place.PreparedPlace`.
    """

    place: Place
    surfaces: TracedSurfaces
    integrator: Integrator[Any]
    shapes: tuple[tuple[int, mi.Shape], ...]
    irradiance: IrradianceReport
    outline: ObjectOutline | None = None
    gains: NDArray[np.float32] | None = None
    plates: dict[str, tuple[NDArray[np.float32], NDArray[np.float32]]] = field(default_factory=dict)


class Method(Protocol):
    """Makes a scene ready, with recovered places from a store where there is one."""

    def __call__(self, scene: Scene, store: Store | None = None) -> Prepared:
        """Make it ready."""


def _difference(scene: Scene, store: Store | None = None, infinite: bool = False) -> Prepared:
    if infinite:
        _check_nothing_is_removed(scene, "directional")
    prepared, objects = prepare_place(scene, infinite, store), prepare_objects(scene)
    surfaces = prepared.place.surfaces.with_synthetic(objects.shapes, objects.removed)
    place = with_plate(prepared.place.with_surfaces(surfaces), scene, prepared)
    settings = scene.render
    # Compiling the kernel of light tracing takes longer than a draft's noise is worth.
    polished = None if settings.draft else objects.polished
    integrator = DifferenceIntegrator(
        place,
        surfaces,
        objects.bounds,
        settings.max_bounces,
        prepared.real.glosses,
        settings.clamp_indirect,
        polished,
        settings.parameters.transport,
    )
    spheres = [] if objects.bounds is None else objects.bounds.spheres
    irradiance = prepared.errors.report(spheres)
    return Prepared(
        place,
        surfaces,
        integrator,
        objects.shapes.numbered,
        irradiance,
        objects.outline,
        prepared.gains,
        prepared.plates,
    )


def _check_nothing_is_removed(scene: Scene, method: str) -> None:
    """Refuse removed surfaces, for methods that know one place only, or no positions."""
    removed = next((surface.name for surface in scene.real if surface.removed), None)
    if removed is not None:
        raise InputError(
            f"{scene.path or 'scene'}: [[real]] \"{removed}\": method '{method}' cannot remove a surface; use 'difference'"
        )


def _directional(scene: Scene, store: Store | None = None) -> Prepared:
    return _difference(scene, store, infinite=True)


def _envpath(scene: Scene, store: Store | None = None) -> Prepared:
    if scene.lights:
        raise InputError(
            f"{scene.path or 'scene'}: method 'envpath' cannot use [[light]] '{scene.lights[0].name}'; "
            "use 'difference' or 'directional'"
        )
    if scene.further or scene.panorama.mask is not None:
        raise InputError(
            f"{scene.path or 'scene'}: method 'envpath' uses one panorama without a mask; use 'difference' or 'directional'"
        )
    if scene.plate is not None:
        raise InputError(
            f"{scene.path or 'scene'}: method 'envpath' cannot use a [plate]; use 'difference' or 'directional'"
        )
    _check_nothing_is_removed(scene, "envpath")
    modelled = merge_real_surfaces(modelled_surfaces(scene))
    objects = prepare_objects(scene)
    real = support_with_scale_factors(scene, modelled)
    unseen = [thing.name for thing in scene.synthetic if not thing.visible_to_camera]
    if unseen:
        warn(f"{scene.path or 'scene'}: method 'envpath' shows '{unseen[0]}' in spite of visible_to_camera = false")
    surfaces = TracedSurfaces(real, replace(objects.shapes, unseen=()))
    place = Place(scene.panorama, surfaces, alone=True, parameters=scene.render.parameters.place)
    settings = scene.render
    integrator = EnvpathIntegrator(
        place, surfaces, scene.panorama, objects.bounds, settings.max_bounces, settings.parameters.transport
    )
    return Prepared(
        place,
        surfaces,
        integrator,
        objects.shapes.numbered,
        IrradianceReport(len(real.vertices), math.nan, math.nan),
        objects.outline,
    )


METHODS: dict[str, Method] = {
    "difference": _difference,
    "directional": _directional,
    "envpath": _envpath,
}
"""The methods by name. A new one is a file in ``transport`` and a line here."""
