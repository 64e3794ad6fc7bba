"""Debevec 1998 on stock Mitsuba: two passes and a composite, with the place as emissive proxy geometry.

The distant scene is the modelled geometry as area lights that emit the photograph projected onto them; the local scene
is the ground with its true albedo, which a user would have to estimate. Both are path-traced with the objects and
without; the difference of the two is added to the plate.
"""

from __future__ import annotations

import time
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.methods.job import MAX_BOUNCES, Rendered, Shot, is_ground
from bench.places.objects import rgb
from bench.places.place import Part, loaded, mitsuba_objects
from bench.projection import lookup, mitsuba_environment
from bench.truth import path_trace
from lightdepth.directions import euler_rotation

TEXELS = 256
"""Side of the texture baked for each rectangle of the distant scene."""


def debevec(shot: Shot, samples: int, denoise: bool = False, seed: int = 0) -> Rendered:
    """Render both passes with ``samples`` camera rays a pixel and composite them."""
    import mitsuba as mi

    passes = []
    for with_objects in (True, False):
        scene = mi.load_dict(proxy_scene(shot, with_objects), optimize=False)
        passes.append(path_trace(scene, shot.view, samples, seed, MAX_BOUNCES + 1))
    seconds = sum(one.seconds for one in passes)
    lit, empty = (one.mean for one in passes)
    if denoise:
        import mitsuba_oidn

        began = time.perf_counter()
        lit, empty = (
            np.asarray(mitsuba_oidn.denoise(image.astype(np.float32), hdr=True), dtype=np.float64)
            for image in (lit, empty)
        )
        seconds += time.perf_counter() - began
    coverage = shot.coverage[..., None]
    return Rendered(shot.plate + (lit - empty) + coverage * (empty - shot.plate), seconds)


def proxy_scene(shot: Shot, with_objects: bool) -> dict[str, Any]:
    """The local and the distant scene for ``mi.load_dict``."""
    from lightdepth.kernel.shapes import mesh_shape

    entries: dict[str, Any] = {"type": "scene"}
    black = {"type": "diffuse", "reflectance": rgb((0.0, 0.0, 0.0))}
    for index, part in enumerate(shot.modelled):
        if is_ground(part):
            plugins: dict[str, Any] = {"bsdf": {"type": "diffuse", "reflectance": rgb(part.color)}}
        else:
            plugins = {"bsdf": black, "emitter": {"type": "area", "radiance": _emission(shot, part)}}
        entries[f"real_{index}"] = mesh_shape(part.mesh, **loaded(plugins))
    if shot.place.sky is not None:
        entries["sky"] = mitsuba_environment(shot.panorama, euler_rotation(shot.place.rotation))
    if with_objects:
        entries |= mitsuba_objects(shot.place.objects)
    return entries


def _emission(shot: Shot, part: Part) -> Any:
    """What a part emits: one radiance for lamps, which are small, else the photograph baked into a texture."""
    import mitsuba as mi

    if part.radiance is not None:
        return rgb(part.radiance)
    pixels = _baked(shot, part)
    return {
        "type": "bitmap",
        "bitmap": mi.Bitmap(pixels.astype(np.float32)),
        "raw": True,
        "filter_type": "nearest",
        "wrap_mode": "clamp",
    }


def _baked(shot: Shot, part: Part) -> NDArray[np.float64]:
    """The photograph as a texture of a part, shape (TEXELS, TEXELS n, 3), black where the part has a hole."""
    import mitsuba as mi

    from lightdepth.kernel.shapes import mesh_shape

    shape = mesh_shape(part.mesh)
    tiles = max(1, len(part.mesh.faces) // 2) if part.name.startswith("sofa") else 1
    v, u = np.meshgrid(
        (np.arange(TEXELS) + 0.5) / TEXELS, (np.arange(TEXELS * tiles) + 0.5) / (TEXELS * tiles), indexing="ij"
    )
    uv = mi.Point2f(u.ravel().astype(np.float32), v.ravel().astype(np.float32))
    found = shape.eval_parameterization(uv)
    points = np.array(found.p).T
    valid = np.array(found.is_valid())
    radiance = np.zeros((len(points), 3))
    radiance[valid] = lookup(
        shot.panorama_without_lamps, points[valid] - shot.capture, euler_rotation(shot.place.rotation)
    )
    return radiance.reshape(TEXELS, TEXELS * tiles, 3)
