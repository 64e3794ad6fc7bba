"""Truth: stock Mitsuba's ``path`` through lightdepth's cameras, with the variance of every pixel, cached by content."""

from __future__ import annotations

import dataclasses
import hashlib
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from bench.places.place import Place
from lightdepth.kernel.start import start
from lightdepth.scene.model import CameraView

CACHE = Path(__file__).parent / "results" / "cache"
MAX_DEPTH = 32
LANES = 1 << 22
"""Camera rays of one pass: bounds memory, whatever the size and the number of samples."""
FEWEST_PASSES = 32
"""The variance is estimated from the spread of the passes; few of them would make it an unreliable estimate."""
LAMP = 10.0
"""How many times the mean of a photograph a pixel must have that shows a lamp;"""
LAMP_RAYS = 1 << 25
"""camera rays that such pixels share at most,"""
LAMP_RAYS_A_SAMPLE = 1 << 16
"""and how many they share for each sample of a pixel of the others,"""
SEED_OF_LAMPS = 3
"""with random numbers of their own, so far from the photograph's."""
CACHE_FORMAT = 2
"""Part of every cache key; raise it when the code below changes what it computes."""


@dataclass(frozen=True)
class Estimate:
    """A path-traced image.

    Attributes:
        mean: radiance, linear RGB, shape (height, width, 3), float64; box-filtered pixels.
        variance: of ``mean``, the same shape, from the spread of the passes.
        coverage: share of each pixel whose camera rays meet a synthetic object first, shape (height, width), float64.
        samples: camera rays a pixel.
        seconds: what it took, without loading and compiling.
    """

    mean: NDArray[np.float64]
    variance: NDArray[np.float64]
    coverage: NDArray[np.float64]
    samples: int
    seconds: float


def on_plate(full: Estimate, empty: Estimate) -> Estimate:
    """The truth for images that were composited into ``empty``, whose noise then is part of their errors.

    Args:
        full: the place with the objects.
        empty: the place without them; objects hide it as far as they cover a pixel.
    """
    seen = (1.0 - full.coverage[..., None]) ** 2
    return dataclasses.replace(full, variance=full.variance + seen * empty.variance)


def path_trace(
    scene: Any,
    view: CameraView,
    samples: int,
    seed: int = 0,
    max_depth: int = MAX_DEPTH,
    with_coverage: bool = True,
    progress: Callable[[int, int], None] | None = None,
) -> Estimate:
    """Path-trace a loaded Mitsuba scene through a posed lightdepth camera.

    Args:
        scene: ``mi.Scene``; shapes whose id starts with ``synthetic`` count as covered.
        view: the camera.
        samples: camera rays a pixel, rounded up to whole passes.
        seed: of the random numbers.
        max_depth: path length of Mitsuba's ``path`` (its counting: 2 is direct light).
        with_coverage: whether coverage is wanted; it is 0 otherwise.
        progress: called after each pass with the samples done and to be done.
    """
    width, height = view.camera.resolution
    traced = trace_pixels(scene, view, np.arange(width * height), samples, seed, max_depth, progress)
    mean, variance = (values.reshape(height, width, 3) for values in (traced.mean, traced.variance))
    covered = coverage(scene, view) if with_coverage else np.zeros((height, width))
    return dataclasses.replace(traced, mean=mean, variance=variance, coverage=covered)


def trace_pixels(
    scene: Any,
    view: CameraView,
    pixels: NDArray[np.integer],
    samples: int,
    seed: int,
    max_depth: int,
    progress: Callable[[int, int], None] | None = None,
) -> Estimate:
    """Path-trace some pixels, row-major indices of shape (n,).

    Returns:
        Their estimate, of shapes (n, 3) and (n,), without coverage.
    """
    import drjit as dr
    import mitsuba as mi

    count = len(pixels)
    sampler = mi.load_dict(
        {"type": "multijitter", "sample_count": int(max(1, min(LANES // count, samples // FEWEST_PASSES)))}
    )
    per_pass = int(sampler.sample_count())  # The sampler rounds up to a grid of strata.
    passes = max(min(FEWEST_PASSES, samples), 2, -(-samples // per_pass))
    integrator = mi.load_dict({"type": "path", "max_depth": max_depth})
    mean = np.zeros((count, 3))
    spread = np.zeros((count, 3))
    began = time.perf_counter()
    for index in range(passes):
        ray, inside = film_rays(view, sampler, per_pass, seed * 65536 + index, pixels)
        radiance, _, _ = integrator.sample(scene, sampler, ray, active=inside)
        radiance = dr.select(inside, radiance, 0.0)
        dr.eval(radiance)  # At once: summing evaluates its argument, and would trace the paths again for each channel.
        channels = [np.asarray(dr.block_sum(channel, per_pass), dtype=np.float64) for channel in radiance]
        image = np.stack(channels, axis=-1) / per_pass
        if index == 0:
            first = time.perf_counter() - began
        delta = image - mean
        mean += delta / (index + 1)
        spread += delta * (image - mean)
        if progress is not None:
            progress((index + 1) * per_pass, passes * per_pass)
    seconds = (time.perf_counter() - began - first) * passes / (passes - 1)
    return Estimate(mean, spread / (passes * (passes - 1)), np.zeros(count), passes * per_pass, seconds)


def film_rays(
    view: CameraView, sampler: Any, per_pixel: int, seed: int, pixels: NDArray[np.integer] | None = None
) -> tuple[Any, Any]:
    """Camera rays in world through pixels, box-filtered.

    Args:
        view: the camera.
        sampler: a Mitsuba sampler; it is seeded here.
        per_pixel: rays a pixel; those of one pixel are neighbours.
        seed: of the random numbers.
        pixels: which, row-major indices; all of them by default.

    Returns:
        ``(mi.RayDifferential3f, inside)``, the latter false where the film sees nothing.
    """
    import drjit as dr
    import mitsuba as mi

    from lightdepth.kernel.arrays import aligned

    width, height = view.camera.resolution
    chosen = mi.UInt32(aligned(np.arange(width * height) if pixels is None else pixels, np.uint32))
    rays = len(chosen) * per_pixel
    sampler.set_samples_per_wavefront(per_pixel)
    sampler.seed(seed, rays)
    index = dr.gather(mi.UInt32, chosen, dr.arange(mi.UInt32, rays) // dr.opaque(mi.UInt32, per_pixel))
    column, row = mi.Float(index % width), mi.Float(index // width)
    seen = view.pixel_rays(column, row, sampler.next_2d(), sampler.next_2d())
    return mi.RayDifferential3f(seen.ray), seen.inside


def coverage(scene: Any, view: CameraView) -> NDArray[np.float64]:
    """Share of each pixel whose camera rays meet a synthetic object first, shape (height, width)."""
    import drjit as dr
    import mitsuba as mi

    width, height = view.camera.resolution
    sampler = mi.load_dict({"type": "multijitter", "sample_count": 16})
    ray, inside = film_rays(view, sampler, 16, seed=0)
    first = scene.ray_intersect_preliminary(mi.Ray3f(ray), active=inside).shape
    covered = dr.zeros(mi.Float, width * height * 16)
    for shape in scene.shapes():
        if shape.id().startswith("synthetic"):
            covered = dr.select(inside & (first == mi.ShapePtr(shape)), 1.0, covered)
    return np.asarray(dr.block_sum(covered, 16), dtype=np.float64).reshape(height, width) / 16


def content_hash(*values: Any) -> str:
    """A hash of data: numbers, text, arrays, tuples, mappings, dataclasses and pydantic models."""
    digest = hashlib.sha256()

    def feed(value: Any) -> None:
        digest.update(type(value).__name__.encode())
        if dataclasses.is_dataclass(value) and not isinstance(value, type):
            for field in dataclasses.fields(value):
                feed(getattr(value, field.name))
        elif isinstance(value, BaseModel):
            feed(value.model_dump())
        elif isinstance(value, np.ndarray):
            digest.update(f"{value.shape}{value.dtype}".encode())
            digest.update(np.ascontiguousarray(value).tobytes())
        elif isinstance(value, dict):
            for key in sorted(value):
                feed(key)
                feed(value[key])
        elif isinstance(value, list | tuple):
            digest.update(str(len(value)).encode())
            for item in value:
                feed(item)
        else:
            digest.update(repr(value).encode())

    for value in values:
        feed(value)
    return digest.hexdigest()[:24]


def cached(key: str, make: Callable[[], Estimate]) -> Estimate:
    """An estimate from the cache, made and stored there if it is not in it."""
    path = CACHE / f"{key}.npz"
    if path.is_file():
        with np.load(path) as stored:
            return Estimate(
                stored["mean"].astype(np.float64),
                stored["variance"].astype(np.float64),
                stored["coverage"].astype(np.float64),
                int(stored["samples"]),
                float(stored["seconds"]),
            )
    estimate = make()
    CACHE.mkdir(parents=True, exist_ok=True)
    unfinished = path.with_suffix(".unfinished.npz")
    np.savez_compressed(
        unfinished,
        mean=estimate.mean.astype(np.float32),
        variance=estimate.variance.astype(np.float32),
        coverage=estimate.coverage.astype(np.float32),
        samples=estimate.samples,
        seconds=estimate.seconds,
    )
    unfinished.replace(path)
    return estimate


def together(estimates: Sequence[Estimate]) -> Estimate:
    """The sum of independent estimates of the same view whose light adds up; coverage is that of each."""
    return dataclasses.replace(
        estimates[0],
        mean=np.sum([each.mean for each in estimates], axis=0),
        variance=np.sum([each.variance for each in estimates], axis=0),
        seconds=sum(each.seconds for each in estimates),
    )


def truth(place: Place, camera: str, width: int, samples: int, objects: bool = True, seed: int = 1) -> Estimate:
    """The place path-traced, with or without its objects, from the cache where it is there.

    Args:
        place: what is rendered.
        camera: ``panorama`` or ``view``.
        width: pixels.
        samples: camera rays a pixel.
        objects: with or without the objects.
        seed: of the random numbers; the photograph uses another one, so that the two are independent.
    """
    posed = place.camera(camera, width)
    if place.outside_sun is not None:
        parts = place.lights_apart()
        return together([_alone(each, posed, samples, seed, objects) for each in parts])
    return _alone(place, posed, samples, seed, objects)


def _alone(place: Place, posed: CameraView, samples: int, seed: int, objects: bool) -> Estimate:
    """A place whose lights Mitsuba follows all at once."""

    def make() -> Estimate:
        return path_trace(_mitsuba(place, objects), posed, samples, seed)

    return cached(_key(place, posed, samples, seed, objects), make)


def _key(place: Place, posed: CameraView, samples: int, seed: int, objects: bool, *more: Any) -> str:
    """Hash of all that decides what a rendering shows."""
    seen = place if objects else place.empty()
    surfaces = tuple((part.mesh.vertices, part.mesh.faces, part.color, part.radiance) for part in seen.parts)
    sun = () if seen.outside_sun is None else (seen.outside_sun,)
    finishes = tuple(part.finish for part in seen.parts if part.finish is not None)
    sun += (finishes,) if finishes else ()
    return content_hash(CACHE_FORMAT, MAX_DEPTH, surfaces, seen.objects, seen.sky, *sun, posed, samples, seed, *more)


def _mitsuba(place: Place, objects: bool) -> Any:
    start()
    import mitsuba as mi

    return mi.load_dict(place.mitsuba_scene(objects), optimize=False)


def photograph(place: Place, width: int, samples: int) -> Estimate:
    """What a camera at the capture point sees of the empty place: the panorama that lightdepth is given.

    A lamp of few pixels, each covered in part, would get its power by the luck of its camera rays, and give it to all
    that it lights; the rays that meet lamps cost little, so that their pixels get many more.

    Args:
        place: its objects do not matter.
        width: pixels.
        samples: camera rays a pixel.
    """
    posed, seed = place.camera("panorama", width), 2
    lamp_rays = min(LAMP_RAYS, LAMP_RAYS_A_SAMPLE * samples)
    if place.outside_sun is not None:
        indoors, sunlit = place.lights_apart()
        return together([photograph(indoors, width, samples), _alone(sunlit, posed, samples, seed, False)])

    def make() -> Estimate:
        seen = truth(place, "panorama", width, samples, objects=False, seed=seed)
        brightness = seen.mean.mean(axis=-1)
        lamps = np.flatnonzero(brightness > LAMP * brightness.mean())
        if not len(lamps):
            return seen
        rays = max(samples, lamp_rays // len(lamps))
        again = trace_pixels(_mitsuba(place, False), posed, lamps, rays, seed + SEED_OF_LAMPS, MAX_DEPTH)
        mean, variance = seen.mean.copy(), seen.variance.copy()
        mean.reshape(-1, 3)[lamps], variance.reshape(-1, 3)[lamps] = again.mean, again.variance
        return dataclasses.replace(seen, mean=mean, variance=variance)

    return cached(_key(place, posed, samples, seed, False, LAMP, lamp_rays), make)
