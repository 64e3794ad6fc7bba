"""The public Python interface: load a scene, render it, or watch it being rendered."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, TypeVar

from lightdepth.errors import InputError
from lightdepth.film.sums import Share
from lightdepth.kernel.start import DEVICE_LOCK, Device, start
from lightdepth.packages import require_package
from lightdepth.scene.identity import digest, scene_digest
from lightdepth.scene.load import load_scene
from lightdepth.scene.model import CameraView, Scene
from lightdepth.scene.problems import nearest

if TYPE_CHECKING:
    from lightdepth.film.frame import Frame
    from lightdepth.film.rendering import Progress, Rendering
    from lightdepth.preparation.methods import Method, Prepared

__all__ = ["begin_rendering", "load_scene", "render"]

DEFAULT_METHOD = "difference"
DRAFT_SAMPLES, DRAFT_IRRADIANCE_SAMPLES = 1, 64
"""What a draft takes: a camera sample a pixel, and of each technique at each point of support."""


def render(
    scene: Scene,
    camera: str | None = None,
    samples: int | None = None,
    noise: float | None = None,
    method: str = DEFAULT_METHOD,
    seed: int | None = None,
    device: Device = "auto",
    denoise: bool = False,
    progress: Callable[[Progress], bool | None] | None = None,
    draft: bool = False,
    cache: bool = True,
) -> Frame:
    """Render a camera of a scene.

    Args:
        scene: from :func:`load_scene`, or made in memory.
        camera: name of the camera; the scene's first by default.
        samples: samples per pixel; the scene's own setting by default.
        noise: relative error at which a pixel is done; the scene's own setting by default.
        method: ``difference``, or another name out of ``lightdepth.preparation.METHODS``.
        seed: of the random numbers; the scene's own setting by default.
        device: ``auto``, which is the CPU, ``cpu`` or ``cuda``; one process keeps the device that it started with.
        denoise: denoise the change and the synthetic layer.
        progress: called after every pass; where it returns true, the rendering stops with what it has.
        draft: a quick look: one noisy sample a pixel, if ``samples`` does not say otherwise, and shadows whose strength is
            known to some percent; object ids, depth, normals and albedo only where ``denoise`` needs them.
        cache: take what belongs to the place from the cache on disk, and put it there.

    Returns:
        The image with its layers.

    Raises:
        InputError: the camera or the method is unknown, ``samples`` or ``noise`` is out of range, or
            ``lightdepth check`` finds an error in the scene.
        SetupError: the renderer or the denoiser is not installed rightly, or the device is not there or not the one
            that this process already computes on.
    """
    if denoise:  # Not first found out when all is rendered.
        require_package("mitsuba_oidn", "denoise")
    rendering = begin_rendering(scene, camera, method, seed, device, draft=draft, cache=cache)
    frame = rendering.complete(samples, noise, progress, auxiliary=denoise or not draft)
    if denoise:
        from lightdepth.film.denoising import denoise as denoised

        return denoised(frame, scene.render.parameters.denoising)
    return frame


def begin_rendering(
    scene: Scene,
    camera: str | None = None,
    method: str = DEFAULT_METHOD,
    seed: int | None = None,
    device: Device = "auto",
    warn: Callable[[str], None] | None = None,
    draft: bool = False,
    share: Share | None = None,
    cache: bool = True,
    sharing: int | None = None,
) -> Rendering:
    """Begin to render: ``Rendering.run`` yields after every pass, ``Rendering.frame`` gives the image so far.

    ``Rendering.complete`` does both. What the cameras of a scene share is checked and prepared once.

    Args:
        scene: what to render; this and what follows is as for :func:`render`, which raises the same errors.
        camera: name of the camera.
        method: name of the method.
        seed: of the random numbers.
        device: ``auto``, ``cpu`` or ``cuda``.
        warn: called with what will make the picture wrong in places, before the preparation takes its time.
        draft: a quick look.
        share: the part of the work that this process does, see :class:`~lightdepth.film.sums.Share`; all by default.
        cache: take what belongs to the place from the cache on disk, and put it there.
        sharing: frames that will share the samples of matte support; see :class:`~lightdepth.film.rendering.Rendering`.
    """
    view = find_camera(scene, camera)
    start(device)
    find_method(method)
    seed = scene.render.seed if seed is None else seed
    with DEVICE_LOCK:
        for warning in _renderable(scene):
            if warn is not None:
                warn(warning)
        from lightdepth.film.rendering import Rendering

        if draft:
            scene = _drafted(scene)
        return Rendering(scene, _prepare(scene, method, cache), view, method, seed, share or Share(), sharing)


def find_camera(scene: Scene, name: str | None) -> CameraView:
    """A camera by name, or the first.

    Raises:
        InputError: there is no camera of this name, or none at all.
    """
    if not scene.cameras:
        raise InputError(f"{scene.path or 'scene'}: has no camera")
    if name is None:
        return next(iter(scene.cameras.values()))
    if name not in scene.cameras:
        raise InputError(f"{scene.path or 'scene'}: no camera '{name}'{nearest(name, scene.cameras)}")
    return scene.cameras[name]


def find_method(name: str) -> Method:
    """What makes a scene ready for a method; call :func:`~lightdepth.kernel.start.start` before.

    Raises:
        InputError: there is no method of this name.
    """
    from lightdepth.preparation import METHODS

    if name not in METHODS:
        raise InputError(f"method '{name}' is unknown; allowed are {', '.join(METHODS)}")
    return METHODS[name]


def forget_prepared() -> None:
    """Free the memory of what :func:`begin_rendering` keeps of the scenes that were rendered last."""
    import drjit as dr

    from lightdepth.checks import forget_checked_places
    from lightdepth.kernel.shapes import forget_shapes
    from lightdepth.preparation.place import forget_places

    _prepared.clear()
    _warnings.clear()
    _drafted.cache_clear()
    forget_places()
    forget_checked_places()
    forget_shapes()
    dr.flush_malloc_cache()


SCENES_KEPT = 2
"""Scenes of which is kept what they were prepared to."""
_prepared: OrderedDict[str, Prepared] = OrderedDict()
_warnings: OrderedDict[str, tuple[str, ...]] = OrderedDict()
"""By the digest of the scene, so that another object of the same contents counts."""
Made = TypeVar("Made")


def _kept(kept: OrderedDict[str, Made], key: str, make: Callable[[], Made]) -> Made:
    """What is kept for ``key``, else what ``make`` makes for it."""
    if key not in kept:
        made = make()
        kept[key] = made
    kept.move_to_end(key)
    while len(kept) > SCENES_KEPT:
        kept.popitem(last=False)
    return kept[key]


def _renderable(scene: Scene) -> tuple[str, ...]:
    """What will make pictures of a scene wrong in places.

    Raises:
        InputError: there is what would make them meaningless; a line for each such problem.
    """
    key = digest(scene_digest(scene), *scene.cameras.values())
    return _kept(_warnings, key, lambda: _find_warnings(scene))


def _find_warnings(scene: Scene) -> tuple[str, ...]:
    from lightdepth.checks import Severity, find_problems

    problems = find_problems(scene, hints=False)
    found = {
        kind: [f"{scene.path or 'scene'}: {p.message}" for p in problems if p.severity is kind] for kind in Severity
    }
    if found[Severity.ERROR]:
        raise InputError("\n".join(found[Severity.ERROR]))
    repairs = [repair for panorama in scene.panoramas for repair in panorama.repairs]
    return (*repairs, *found[Severity.WARNING])


@lru_cache(maxsize=2)
def _drafted(scene: Scene) -> Scene:
    settings = replace(
        scene.render, samples=DRAFT_SAMPLES, noise=None, irradiance_samples=DRAFT_IRRADIANCE_SAMPLES, draft=True
    )
    return replace(scene, render=settings)


def _prepare(scene: Scene, method: str, cache: bool) -> Prepared:
    from lightdepth.store import default_store

    store = default_store() if cache else None
    return _kept(_prepared, f"{method} {scene_digest(scene)}", lambda: find_method(method)(scene, store))
