"""The photographed place made ready: all that does not depend on the new objects."""

from __future__ import annotations

import logging
import threading
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cache
from importlib import metadata
from pathlib import Path

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

import lightdepth
from lightdepth.lightmap.depth_mesh import mesh_from_depth
from lightdepth.place.place import Place
from lightdepth.place.real_surfaces import RealSurfaces, merge_real_surfaces
from lightdepth.place.traced_surfaces import TracedSurfaces
from lightdepth.recovery.parameters import DEFAULT, RecoveryParameters
from lightdepth.recovery.support_irradiance import IrradianceErrors, recover_irradiance
from lightdepth.recovery.unseen_albedo import recover_hidden
from lightdepth.scene.content import content_digest, place_digest
from lightdepth.scene.model import RealSurface, Role, Scene
from lightdepth.store import Store

KEPT = 2
"""Prepared places that a process keeps."""
CODE = ("kernel", "lightmap", "place", "preparation", "recovery", "scene/meshes")
"""Folders whose code decides what is recovered: a place that other code recovered is not the same."""

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class PreparedPlace:
    """A photographed place, ready for any objects and any camera.

    Attributes:
        place: its light and its surfaces, traced with ``real``.
        real: the real surfaces with recovered albedo and irradiance, on refined meshes.
        errors: of the irradiance.
    """

    place: Place
    real: RealSurfaces
    errors: IrradianceErrors


def prepare_place(
    scene: Scene,
    infinite: bool = False,
    store: Store | None = None,
    parameters: RecoveryParameters = DEFAULT,
) -> PreparedPlace:
    """Make the place of a scene ready. Its objects and cameras play no part.

    The process keeps the places that it prepared last. What was recovered is taken from the store where it is there, and
    put into it otherwise; it is the same bit for bit.

    Args:
        scene: the place, and ``seed``, ``irradiance_samples`` and ``draft`` of its settings.
        infinite: take every depth as infinite: the directional method.
        store: recovered places on disk; ``None`` goes without.
        parameters: how carefully albedo and irradiance are recovered.
    """
    key = _key(scene, infinite, parameters)
    with _lock:
        if key in _kept:
            _kept.move_to_end(key)
            return _kept[key]
    modelled = merge_real_surfaces(modelled_surfaces(scene))
    # What is deformed took its colour, and the light that goes with it, where it was when it was photographed.
    photographed = replace(modelled, vertices=modelled.rest)
    empty = Place(scene.panorama, TracedSurfaces(photographed), infinite, suns=scene.lights)
    arrays = None if store is None else store.read(key)
    recovered = None if arrays is None else _unpacked(arrays, modelled)
    if recovered is None:
        recovered = _recovered(scene, empty, modelled, parameters)
        if store is not None:
            store.write(key, _packed(*recovered), str(scene.panorama.path or "made in memory"))
    real, errors = recovered
    surfaces = TracedSurfaces(real)
    place = empty.with_surfaces(surfaces)
    if modelled.deformed:
        place = Place(scene.panorama, surfaces, infinite, suns=scene.lights)
    prepared = PreparedPlace(place, real, errors)
    with _lock:
        _kept[key] = prepared
        while len(_kept) > KEPT:
            _kept.popitem(last=False)
    return prepared


def forget_places() -> None:
    """Free the places that the process keeps."""
    with _lock:
        _kept.clear()


_kept: OrderedDict[str, PreparedPlace] = OrderedDict()
_lock = threading.Lock()


def _recovered(
    scene: Scene, empty: Place, modelled: RealSurfaces, parameters: RecoveryParameters
) -> tuple[RealSurfaces, IrradianceErrors]:
    generator = np.random.default_rng(scene.render.seed)
    samples = scene.render.irradiance_samples
    if not (empty.infinite or modelled.deformed or scene.render.draft):  # It would be a quarter of a draft's time.
        empty, modelled = recover_hidden(empty, modelled, generator, samples, parameters)
    return recover_irradiance(empty, modelled, generator, samples, parameters)


def modelled_surfaces(scene: Scene) -> Sequence[RealSurface]:
    """The modelled surfaces; where there are none, one made from the panorama's depth, all of it support."""
    panorama = scene.panorama
    if scene.real or panorama.depth is None:
        return scene.real
    mesh = mesh_from_depth(panorama.depth, panorama.position, panorama.rotation)
    return (RealSurface("depth", mesh, Role.SUPPORT),)


# -- On disk ----------------------------------------------------------------------------------------------------------


def _key(scene: Scene, infinite: bool, parameters: RecoveryParameters) -> str:
    settings = scene.render
    choices = (infinite, settings.seed, settings.irradiance_samples, settings.draft)
    return content_digest(place_digest(scene), choices, parameters, str(mi.variant()), mi.__version__, _code())


@cache
def _code() -> str:
    """Digest of the version and of the code that recovers places: who changes it must not get what the old one made."""
    root = Path(lightdepth.__file__).parent
    files = sorted(file for folder in CODE for file in (root / folder).rglob("*.py"))
    texts = tuple((str(file.relative_to(root)), file.read_bytes()) for file in files)
    return content_digest(metadata.version("lightdepth"), texts)


def _packed(real: RealSurfaces, errors: IrradianceErrors) -> dict[str, NDArray]:
    """All arrays by name; what else there is of them follows from the surfaces as modelled."""
    arrays = {f"real.{name}": value for name, value in vars(real).items() if isinstance(value, np.ndarray)}
    arrays |= {f"errors.{each.name}": np.asarray(getattr(errors, each.name)) for each in fields(errors)}
    return arrays


def _unpacked(arrays: dict[str, NDArray], modelled: RealSurfaces) -> tuple[RealSurfaces, IrradianceErrors] | None:
    """The reverse of :func:`_packed`; ``None`` where something is missing."""
    wanted = {f"real.{name}" for name, value in vars(modelled).items() if isinstance(value, np.ndarray)}
    wanted |= {f"errors.{each.name}" for each in fields(IrradianceErrors)}
    if wanted != set(arrays):
        log.warning("a cached place lacks %s; it is prepared again", ", ".join(sorted(wanted - set(arrays))))
        return None
    real = {name.removeprefix("real."): value for name, value in arrays.items() if name.startswith("real.")}
    errors = {name.removeprefix("errors."): value for name, value in arrays.items() if name.startswith("errors.")}
    errors["vertices"] = int(errors["vertices"])  # type: ignore[assignment]
    return replace(modelled, **real), IrradianceErrors(**errors)  # type: ignore[arg-type]
