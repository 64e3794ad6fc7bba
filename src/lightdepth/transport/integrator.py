"""What every integrator is: an estimator along camera rays of what the film adds to the photograph."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import drjit as dr
import mitsuba as mi

from lightdepth.place.light_list import LightList
from lightdepth.place.object_bounds import ObjectBounds
from lightdepth.place.place import Place
from lightdepth.place.traced_surfaces import TracedSurfaces
from lightdepth.transport.light_tracing import LightTracer
from lightdepth.transport.radiance_cache import NO_CELL, RadianceCache
from lightdepth.transport.sampler import Sampler

CameraRays = Callable[[mi.UInt32], tuple[Sampler, mi.Ray3f, mi.Bool, mi.Float]]
"""From the index of a sample in its pixel to its sampler, its camera ray in world, whether it lies in the camera's image,
and the solid angle of the pixel there in steradians times the number of light paths per camera path."""


@dataclass
class CameraSamples:
    """Estimates along camera rays.

    Attributes:
        change: ``D`` of the support surface that the ray meets first, else 0; may be negative.
        synthetic: radiance of the new surface that the ray meets first, else 0.
        covered: whether the ray meets a new surface first.
    """

    change: mi.Color3f
    synthetic: mi.Color3f
    covered: mi.Bool


@dataclass
class CameraSums:
    """Sums over the samples of pixels.

    Attributes:
        change: of :class:`CameraSamples`.
        synthetic: of :class:`CameraSamples`.
        squares: of ``change + synthetic`` of each sample, squared.
        covered: how many samples are covered.
    """

    change: mi.Color3f
    synthetic: mi.Color3f
    squares: mi.Color3f
    covered: mi.Float


@dataclass
class Path:
    """Camera paths, one in each lane.

    Attributes:
        sampler: their random numbers.
        ray: the next ray, world.
        active: which have not ended.
        radiance: contribution so far.
        throughput: factor on what they find next.
        first: which have not scattered yet.
        covered: which met a new surface first.
        depth: scatterings so far.
        cell: of a training path, the cache cell that its ``radiance`` is a record of, or ``NO_CELL``; see
            :class:`RadianceCache`.
        pdf_ratio: before the first scattering, the last of :data:`CameraRays`; after it, the factor of the pdf ratio of
            light tracing to this path as far as it is decided, 0 where light tracing cannot find the path. See
            :class:`LightTracer`.
    """

    sampler: Sampler
    ray: mi.Ray3f
    active: mi.Bool
    radiance: mi.Color3f
    throughput: mi.Color3f
    first: mi.Bool
    covered: mi.Bool
    depth: mi.UInt32
    cell: mi.UInt64
    pdf_ratio: mi.Float


PathKind = TypeVar("PathKind", bound=Path)


class Integrator(ABC, Generic[PathKind]):
    """Base of the methods' integrators.

    Args:
        place: the photographed place.
        surfaces: real and synthetic surfaces.
        bounds: the objects' bounds, or ``None`` without objects; the film asks for them.
        max_bounces: scatterings after which a path ends; negative for no limit.

    Attributes:
        light_tracer: the light tracing that its camera paths are MIS-weighted against, or ``None``.
    """

    def __init__(
        self, place: Place, surfaces: TracedSurfaces, bounds: ObjectBounds | None = None, max_bounces: int = 8
    ) -> None:
        self.place = place
        self.surfaces = surfaces
        self.bounds = bounds
        self.max_bounces = dr.opaque(mi.UInt32, max_bounces if max_bounces >= 0 else 0xFFFFFFFF)
        self.light_tracer: LightTracer | None = None
        self.has_emitters = len(surfaces.emitting.emitters()) > 0

    def new_cache(self) -> RadianceCache | None:
        """An empty radiance cache for one image; ``None`` where it would be of no use."""
        return None

    @dr.syntax
    def sample(
        self, camera: CameraRays, lanes: int, count: mi.UInt32, lights: LightList, cache: RadianceCache | None
    ) -> CameraSums:
        """Follow paths, ``count`` of them one after the other in every lane.

        A lane begins its next path when one ends: otherwise all lanes would wait for the longest path.

        Args:
            camera: camera rays by the index of the sample in its lane.
            lanes: how many.
            count: paths in each.
            lights: light samples of the place that all paths share.
            cache: the radiance cache of the support's change, from :meth:`new_cache`.
        """
        sums = dr.zeros(CameraSums, lanes)
        lane, index, width = dr.arange(mi.UInt32, lanes), mi.UInt32(0), dr.opaque(mi.UInt32, lanes)
        record = _no_record if cache is None else cache.record
        path = self.begin(_camera_path(*camera(index)))
        while dr.hint(index < count, mode="symbolic"):
            path = self.advance(path, lights, cache)
            ended = ~path.active
            samples = self.samples(path)
            record(index * width + lane, path.cell, path.radiance, ended)
            sums.change += samples.change & ended
            sums.synthetic += samples.synthetic & ended
            sums.squares += dr.square(samples.change + samples.synthetic) & ended
            sums.covered += dr.select(ended & samples.covered, 1.0, 0.0)
            index += dr.select(ended, mi.UInt32(1), mi.UInt32(0))
            path = dr.select(ended, self.begin(_camera_path(*camera(index))), path)
        return sums

    @abstractmethod
    def begin(self, path: Path) -> PathKind:
        """Paths along camera rays, with the state that the method adds."""

    @abstractmethod
    def advance(self, path: PathKind, lights: LightList, cache: RadianceCache | None) -> PathKind:
        """Follow paths to what they meet next, and scatter there."""

    @abstractmethod
    def samples(self, path: PathKind) -> CameraSamples:
        """What paths that have ended estimate."""


def _camera_path(sampler: Sampler, ray: mi.Ray3f, active: mi.Bool, pdf_ratio: mi.Float) -> Path:
    """Paths along camera rays in world; rays outside the camera's image are not ``active``."""
    return Path(
        sampler,
        mi.Ray3f(ray),
        mi.Bool(active),
        radiance=mi.Color3f(0.0),
        throughput=mi.Color3f(1.0),
        first=mi.Bool(True),
        covered=mi.Bool(False),
        depth=mi.UInt32(0),
        cell=mi.UInt64(NO_CELL),
        pdf_ratio=mi.Float(pdf_ratio),
    )


def _no_record(*_: object) -> None:
    """Without a radiance cache."""
