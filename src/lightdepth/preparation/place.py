"""The photographed place made ready: all that does not depend on the new objects."""

from __future__ import annotations

import hashlib
import threading
from collections import OrderedDict
from collections.abc import Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cache
from importlib import metadata
from pathlib import Path

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.cancellation import raise_if_cancelled
from lightdepth.errors import InputError, warn
from lightdepth.lighting.sun_mask import with_masks
from lightdepth.lightmap.depth_meshes import meshes_from_depth
from lightdepth.parameters.recovery import RecoveryParameters
from lightdepth.place.place import Place
from lightdepth.place.real_surfaces import RealSurfaces, merge_real_surfaces
from lightdepth.place.seen_plate import SeenPlate
from lightdepth.place.traced_surfaces import TracedSurfaces
from lightdepth.recovery.gains import solve_gains
from lightdepth.recovery.specular import fit_glosses, fitted_glosses, recover_mirrored
from lightdepth.recovery.support_irradiance import IrradianceErrors, recover_irradiance
from lightdepth.recovery.unseen_albedo import recover_unseen
from lightdepth.scene.identity import digest, place_digest
from lightdepth.scene.model import Gloss, RealSurface, Role, Scene
from lightdepth.store import Store
from lightdepth.work import work

KEPT = 2
"""Prepared places that a process keeps."""
CODE = (
    "cameras",
    "directions.py",
    "images",
    "kernel",
    "lighting",
    "lightmap",
    "parameters",
    "place",
    "preparation",
    "quantities.py",
    "recovery",
    "regions.py",
    "scene",
)
"""Folders and files whose code decides what is recovered: a place that other code recovered is not the same."""
ERROR_FIELDS = fields(IrradianceErrors)


@dataclass(frozen=True, eq=False)
class PreparedPlace:
    """A photographed place, ready for any objects and any camera.

    Attributes:
        place: its light and its surfaces, traced with ``real``.
        real: the real surfaces with recovered albedo and irradiance, on refined meshes.
        errors: of the irradiance.
        gains: of each photograph, per channel, shape (k, 3).
        plates: the photograph as the cameras seen last see it; see :func:`lightdepth.film.plate.kept_plate`.
        seen_plates: plates of ordinary cameras that were used last; see :func:`lightdepth.preparation.plate.with_plate`.
    """

    place: Place
    real: RealSurfaces
    errors: IrradianceErrors
    gains: NDArray[np.float32]
    plates: dict[str, tuple[NDArray[np.float32], NDArray[np.float32]]] = field(default_factory=dict)
    seen_plates: dict[str, SeenPlate] = field(default_factory=dict)


def prepare_place(
    scene: Scene,
    infinite: bool = False,
    store: Store | None = None,
) -> PreparedPlace:
    """Make the place of a scene ready. Its objects and cameras play no part.

    The process keeps the places that it prepared last. What was recovered is taken from the store where it is there, and
    put into it otherwise; it is the same bit for bit.

    Args:
        scene: the place, and ``seed``, ``irradiance_samples``, ``draft`` and ``parameters`` of its settings.
        infinite: take every depth as infinite: the directional method.
        store: recovered places on disk; ``None`` goes without.
    """
    parameters = scene.render.parameters.recovery
    key = _key(scene, infinite, parameters)
    with _lock:
        if key in _kept:
            _kept.move_to_end(key)
            return _kept[key]
    modelled = merge_real_surfaces(modelled_surfaces(scene))
    # What is deformed took its colour, and the light that goes with it, where it was when it was photographed.
    photographed = replace(modelled, vertices=modelled.rest)
    traced = TracedSurfaces(photographed)
    balance = solve_gains(scene.panoramas, traced, scene.render.parameters.balance, scene.render.parameters.place)
    if balance.problem is not None:
        raise InputError(f"{scene.path or 'scene'}: {balance.problem}")
    lights = with_masks(scene)

    def place_with(surfaces: TracedSurfaces) -> Place:
        tuned = scene.render.parameters.place
        return Place(scene.panoramas, surfaces, infinite, declared=lights, gains=balance.gains, parameters=tuned)

    empty = place_with(traced)
    arrays = None if store is None else store.read(key)
    recovered = None if arrays is None else _unpacked(arrays, modelled)
    if recovered is None:
        with work(_paths(scene.render.irradiance_samples, parameters)):
            recovered = _recover(scene, empty, modelled, parameters)
        if store is not None:
            store.write(key, _packed(recovered), str(scene.panorama.path or "made in memory"))
    real, errors = recovered.real, recovered.errors
    surfaces = TracedSurfaces(real)
    place = place_with(surfaces) if modelled.deformed else empty.with_surfaces(surfaces)
    if recovered.mirrored:
        place = place.with_mirrored(recovered.mirrored, real.glosses)
    prepared = PreparedPlace(place, real, errors, balance.gains)
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


@dataclass(frozen=True, eq=False)
class _Recovered:
    """What inverse rendering found: ``real`` and ``errors`` of :class:`PreparedPlace`, and what glossy surfaces mirror."""

    real: RealSurfaces
    errors: IrradianceErrors
    mirrored: tuple[NDArray[np.float32], ...]


def _recover(scene: Scene, empty: Place, modelled: RealSurfaces, parameters: RecoveryParameters) -> _Recovered:
    generator = np.random.default_rng(scene.render.seed)
    samples = scene.render.irradiance_samples
    as_seen = empty
    glosses = (
        fit_glosses(empty, modelled, parameters=parameters)
        if empty.infinite
        else fitted_glosses(scene, modelled, lambda: as_seen, parameters)
    )
    if not (empty.infinite or modelled.deformed or scene.render.draft):  # It would be a quarter of a draft's time.
        empty, modelled = recover_unseen(empty, modelled, generator, samples, parameters)
    raise_if_cancelled()
    modelled = replace(modelled, glosses=glosses)
    real, errors = recover_irradiance(empty, modelled, generator, samples, parameters)
    raise_if_cancelled()
    return _Recovered(real, errors, recover_mirrored(empty, modelled, parameters=parameters))


def _paths(samples: int, parameters: RecoveryParameters) -> float:
    """Paths that recovery follows, at most: at the vertices of the mesh, and at the points by which it is checked."""
    vertices = min(parameters.most_vertices, parameters.vertices_a_sample * samples)
    return float(samples * (vertices + parameters.check_points * parameters.check_samples))


def modelled_surfaces(scene: Scene) -> Sequence[RealSurface]:
    """The modelled surfaces; where there are none, those made from the panoramas' depth, all of them support."""
    if scene.real:
        return scene.real
    tuned = scene.render.parameters.place
    return tuple(RealSurface("depth", mesh, Role.SUPPORT) for mesh in meshes_from_depth(scene.panoramas, tuned))


# -- On disk ----------------------------------------------------------------------------------------------------------


def _key(scene: Scene, infinite: bool, parameters: RecoveryParameters) -> str:
    settings = scene.render
    choices = (infinite, settings.seed, settings.irradiance_samples, settings.draft)
    return digest(
        place_digest(scene),
        choices,
        parameters,
        settings.parameters.place,
        settings.parameters.balance,
        settings.parameters.lighting,
        str(mi.variant()),
        mi.__version__,
        _code(),
    )


@cache
def _code() -> str:
    """Digest of the version and of the code that recovers places: changed code must not get what the old one recovered."""
    root, state = Path(__file__).parents[1], hashlib.sha256(metadata.version("lightdepth").encode())
    for file in sorted(
        file for name in CODE for file in [*root.glob(name), *root.glob(f"{name}/**/*.py")] if file.is_file()
    ):
        state.update(f"{file.relative_to(root)};".encode() + file.read_bytes())
    return state.hexdigest()


def _packed(recovered: _Recovered) -> dict[str, NDArray]:
    """All of it as arrays by name."""
    arrays = {f"real.{name}": value for name, value in vars(recovered.real).items() if isinstance(value, np.ndarray)}
    rows = [[gloss.roughness, gloss.specular, gloss.scale, *gloss.albedo] for gloss in recovered.real.glosses]
    arrays["glosses"] = np.array(rows, np.float64).reshape(-1, 6)
    arrays |= {f"errors.{each.name}": np.asarray(getattr(recovered.errors, each.name)) for each in ERROR_FIELDS}
    return arrays | {f"mirrored.{index}": image for index, image in enumerate(recovered.mirrored)}


def _unpacked(arrays: dict[str, NDArray], modelled: RealSurfaces) -> _Recovered | None:
    """The reverse of :func:`_packed`; ``None``, with a warning, where something is missing."""
    wanted = {f"real.{name}" for name, value in vars(modelled).items() if isinstance(value, np.ndarray)}
    wanted |= {"glosses", *(f"errors.{each.name}" for each in ERROR_FIELDS)}
    if missing := wanted - set(arrays):
        warn(f"a cached place lacks {', '.join(sorted(missing))}; it is prepared again")
        return None
    real = {name.removeprefix("real."): value for name, value in arrays.items() if name.startswith("real.")}
    rows = arrays["glosses"].tolist()
    glosses = tuple(Gloss(roughness, specular, scale, tuple(albedo)) for roughness, specular, scale, *albedo in rows)
    points, irradiance, error = (arrays[f"errors.{name}"] for name in ("points", "irradiance", "error"))
    errors = IrradianceErrors(int(arrays["errors.vertices"]), points, irradiance, error)
    mirrored = [f"mirrored.{index}" for index in range(len(arrays)) if f"mirrored.{index}" in arrays]
    return _Recovered(replace(modelled, **real, glosses=glosses), errors, tuple(arrays[name] for name in mirrored))
