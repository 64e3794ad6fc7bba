"""Several photographs of one place: one appearance and one light, weighted point by point.

Equations: docs/theory.md, section 9. Each point of the place sends the weighted mean of what the photographs show of it,
and light samples are drawn from all of them, each from where it samples that point best.
"""

from __future__ import annotations

import operator
from collections.abc import Sequence
from copy import copy
from functools import reduce

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.kernel.row_bands import bands
from lightdepth.kernel.variables import as_point, as_vectors
from lightdepth.parameters.place import DEFAULT, PlaceParameters
from lightdepth.place.light_list import LightSample, joined
from lightdepth.place.photograph import Photograph, looked_up
from lightdepth.place.photograph_weights import Sighting, Weights, weigh
from lightdepth.place.photographed import Photographed
from lightdepth.place.traced_surfaces import RealHit, TracedSurfaces
from lightdepth.scene.model import Panorama


class Photographs(Photographed):
    """Photographs of one place, or a single one with a mask.

    As picture, each of them is asked for its :class:`Sighting` of points and for what it shows there (``sharp_of``,
    ``picture_at``, ``mirrored_at``); as light for its ``map`` and for samples of it (``drawn``).

    Args:
        panoramas: the photographs and their poses.
        surfaces: the real surfaces to trace.
        infinite: take every depth as infinite as far as light is concerned: that of the first photograph.
        alone: as for :class:`Photograph`.
        gains: of each photograph, per channel, shape (k, 3).
        parameters: how they are feathered, and how often each is sampled.
    """

    one_sided = True

    def __init__(
        self,
        panoramas: Sequence[Panorama],
        surfaces: TracedSurfaces,
        infinite: bool = False,
        alone: bool = False,
        gains: NDArray[np.float32] | None = None,
        parameters: PlaceParameters = DEFAULT,
    ) -> None:
        self._parameters = parameters
        self.surfaces = surfaces
        self.each = tuple(
            Photograph(
                panorama,
                surfaces,
                alone=alone,
                gain=None if gains is None or (gain == 1.0).all() else gain,
                parameters=parameters,
            ).beside_others(panorama)
            for panorama, gain in zip(panoramas, np.ones((len(panoramas), 3)) if gains is None else gains, strict=True)
        )
        self._captures = [as_point(photograph.capture) for photograph in self.each]
        self._declared = self.each[0].declared(panoramas[0])
        self._distant = Photograph(panoramas[0], surfaces, True, alone, parameters=parameters) if infinite else None
        if self._distant is None:
            importance = [self._importance(index) for index in range(len(self.each))]
            self.each = tuple(
                photograph.with_importance(panorama, image, alone)
                for photograph, panorama, image in zip(self.each, panoramas, importance, strict=True)
            )
        power = np.array([photograph.map.power for photograph in self.each])
        shares = np.maximum(power / max(power.sum(), 1e-300), parameters.least_photograph_share)
        self._shares: list[float] = (shares / shares.sum()).tolist()

    def with_surfaces(self, surfaces: TracedSurfaces) -> Photographs:
        """See the base class."""
        photographs = copy(self)
        photographs.surfaces = surfaces
        photographs.each = tuple(each.with_surfaces(surfaces) for each in self.each)
        photographs._distant = None if self._distant is None else self._distant.with_surfaces(surfaces)
        return photographs

    def with_mirrored(self, images: Sequence[NDArray[np.float32]]) -> Photographs:
        """See the base class."""
        photographs = copy(self)
        photographs.each = tuple(each.with_mirrored([image]) for each, image in zip(self.each, images, strict=True))
        return photographs

    # -- What is seen -------------------------------------------------------------------------------------------

    def arriving(
        self, ray: mi.Ray3f, hit: RealHit, distance: mi.Float, active: mi.Bool, kept: mi.Bool | bool = False
    ) -> tuple[mi.Color3f, mi.Float, mi.Bool]:
        """The weighted ``M(q)`` and the density of the light samples of all photographs, eq. (13)."""
        if self._distant is not None:
            return self._distant.arriving(ray, hit, distance, active)
        radiance, density, unseen = self._sent(mi.Vector3f(hit.point), hit, ray.d, active)
        cosine = dr.maximum(dr.abs(dr.dot(hit.normal, ray.d)), 1e-6)
        pdf = dr.select(hit.valid, density * dr.square(distance) / cosine, density)
        front = active & hit.valid & (dr.dot(hit.normal, ray.d) < 0.0)
        radiance = self._with_unseen(radiance, hit, front & unseen)
        radiance = self._with_unseen_sky(radiance, hit, ray.d, active & unseen)
        if self.surfaces.deformed:
            radiance = dr.select(hit.valid, self._at_rest(hit, active & hit.valid), radiance)
        return radiance, pdf, hit.valid

    def sharp(self, hit: RealHit, ray: mi.Ray3f) -> mi.Color3f:
        """See the base class."""
        sightings, weights = self._looked_at(hit, ray)
        point = self._point(hit)
        values = [p.sharp_of(s, point, hit.normal, hit.valid) for p, s in zip(self.each, sightings, strict=True)]
        return _weighted(weights.shares, values)

    def shares(self, hit: RealHit, ray: mi.Ray3f) -> list[mi.Float]:
        """See the base class."""
        _, weights = self._looked_at(hit, ray)
        return [dr.select(weights.seen, share, 0.0) for share in weights.shares]

    def surface_radiance(self, hit: RealHit, direction: mi.Vector3f, active: mi.Bool) -> mi.Color3f:
        """See the base class."""
        sightings, weights = self._of_surface(hit, direction, active)
        radiance = _weighted(
            weights.shares, [p.picture_at(s.direction) for p, s in zip(self.each, sightings, strict=True)]
        )
        return self._with_unseen(radiance, hit, active & weights.unseen)

    def mirrored(self, hit: RealHit, direction: mi.Vector3f, active: mi.Bool) -> mi.Color3f:
        """See the base class."""
        sightings, weights = self._of_surface(hit, direction, active)
        values = [p.mirrored_at(s.direction, active) for p, s in zip(self.each, sightings, strict=True)]
        return _weighted(weights.shares, values)

    def sight(self, point: mi.Vector3f, normal: mi.Vector3f) -> tuple[mi.Bool, mi.Bool, mi.Color3f]:
        """See the base class."""
        sightings, finite = self._sightings(point, normal, mi.Bool(True), normal, mi.Bool(True)), mi.Bool(True)
        weights = weigh(sightings, normal, finite)
        values = [p.picture_at(s.direction) for p, s in zip(self.each, sightings, strict=True)]
        return weights.seen, weights.unseen, _weighted(weights.shares, values)

    def shares_at(self, point: mi.Vector3f, normal: mi.Vector3f) -> list[NDArray[np.float32]]:
        """See the base class."""
        finite = mi.Bool(True)
        weights = weigh(self._sightings(point, normal, finite, normal, finite), normal, finite)
        return [share.numpy() for share in weights.shares]

    def surface_shares(self, hit: RealHit, direction: mi.Vector3f, active: mi.Bool) -> list[NDArray[np.float32]]:
        """See the base class."""
        _, weights = self._of_surface(hit, direction, active)
        return [share.numpy() for share in weights.shares]

    def faced(self, points: NDArray[np.float32], normals: NDArray[np.float32]) -> NDArray[np.bool_]:
        """See the base class."""
        point, normal = (as_vectors(each) for each in (points, normals))
        result = np.zeros(len(points), bool)
        for photograph in self.each:
            sighting = photograph.sighting(point, normal, mi.Bool(True), normal, mi.Bool(True))
            seen = ((sighting.clarity > 0.0) & (sighting.counts > 0.0)).numpy()
            result |= seen & photograph.faced(points, normals)
        return result

    def _sightings(
        self, point: mi.Vector3f, normal: mi.Vector3f, finite: mi.Bool, direction: mi.Vector3f, active: mi.Bool
    ) -> list[Sighting]:
        sightings = [photograph.sighting(point, normal, finite, direction, active) for photograph in self.each]
        if self._declared is not None:
            # Sources of declared radiance are those of the first photograph: the others clipped them too.
            first = sightings[0]
            (declared,) = looked_up(self._declared, first.direction, active)
            for other in sightings[1:]:
                other.counts *= 1.0 - dr.select(first.seen, declared, 0.0)
        return sightings

    def _point(self, hit: RealHit) -> mi.Vector3f:
        return mi.Vector3f(dr.select(hit.valid, self.surfaces.rest_point(hit, hit.valid), hit.point))

    def _looked_at(self, hit: RealHit, ray: mi.Ray3f) -> tuple[list[Sighting], Weights]:
        """What a camera's rays see."""
        sightings = self._sightings(self._point(hit), hit.normal, hit.valid, ray.d, mi.Bool(True))
        return sightings, self._weigh(sightings, hit, hit.valid, ray.d, ray.o)

    def _of_surface(self, hit: RealHit, direction: mi.Vector3f, active: mi.Bool) -> tuple[list[Sighting], Weights]:
        """The same for surfaces that are looked at in a direction."""
        point = mi.Vector3f(self.surfaces.rest_point(hit, active))
        sightings = self._sightings(point, hit.normal, mi.Bool(True), direction, active)
        origin = mi.Point3f(point - direction)
        return sightings, self._weigh(sightings, hit, mi.Bool(True), direction, origin)

    def _weigh(
        self,
        sightings: list[Sighting],
        hit: RealHit,
        finite: mi.Bool,
        direction: mi.Vector3f,
        origin: mi.Point3f,
    ) -> Weights:
        """How much each photograph counts for what is looked at from somewhere."""
        sky_distance = self._parameters.sky_distance
        return weigh(sightings, hit.normal, finite, direction, origin, self._captures, sky_distance)

    def _at_rest(self, hit: RealHit, active: mi.Bool) -> mi.Color3f:
        """Light of real surfaces by what the photographs show at their rest positions."""
        point = mi.Vector3f(self.surfaces.rest_point(hit, active))
        sightings = self._sightings(point, hit.normal, mi.Bool(True), hit.normal, active)
        weights = weigh(sightings, hit.normal, mi.Bool(True))
        return _weighted(
            weights.shares, [p.map.radiance(s.direction) for p, s in zip(self.each, sightings, strict=True)]
        )

    def _with_unseen(self, photographed: mi.Color3f, hit: RealHit, unseen: mi.Bool) -> mi.Color3f:
        if not self.surfaces.has_unseen_albedo:
            return photographed
        recovered, valid = self.surfaces.unseen_radiance(hit, unseen)
        return dr.select(valid, recovered, photographed)

    def _with_unseen_sky(
        self, photographed: mi.Color3f, hit: RealHit, direction: mi.Vector3f, unseen: mi.Bool
    ) -> mi.Color3f:
        known = next((photograph for photograph in self.each if photograph.has_unseen_sky), None)
        if known is None:
            return photographed
        behind = unseen & ~hit.valid
        return dr.select(behind, known.sky_at(direction, behind), photographed)

    # -- Sampling their light -----------------------------------------------------------------------------------

    def _sent(
        self, point: mi.Vector3f, hit: RealHit, direction: mi.Vector3f, active: mi.Bool
    ) -> tuple[mi.Color3f, mi.Float, mi.Bool]:
        """What points send as light, the density of the light samples there, and which no photograph sees.

        Args:
            point: world, metres.
            hit: the real surfaces there; sky where it is not valid.
            direction: toward the points, unit, world: from the side that is wanted.
            active: lanes to evaluate.

        Returns:
            Radiance; density per square metre, for sky per steradian; and whether certainly no photograph sees it.
        """
        sightings = self._sightings(point, hit.normal, hit.valid, direction, active)
        weights = weigh(sightings, hit.normal, hit.valid, direction)
        radiance, density = mi.Color3f(0.0), mi.Float(0.0)
        for index, (photograph, sighting) in enumerate(zip(self.each, sightings, strict=True)):
            shown, pdf = photograph.map.radiance_and_pdf(sighting.direction)
            radiance += weights.shares[index] * shown
            drawn = weights.sides[index] & sighting.seen
            density += dr.select(drawn, self._shares[index] * pdf * sighting.solid_angle, 0.0)
        return radiance, density, weights.unseen

    def presample(self, generator: np.random.Generator, count: int) -> LightSample:
        """Directions from each capture point, followed to the first real surface; all have their common density."""
        if self._distant is not None:
            return self._distant.presample(generator, count)
        ends = np.rint(np.cumsum(self._shares) * count).astype(int)
        counts = np.diff(ends, prepend=0).tolist()
        drawn = [self._drawn(index, generator, size) for index, size in enumerate(counts) if size]
        return joined(drawn, [size for size in counts if size])

    def _drawn(self, index: int, generator: np.random.Generator, count: int) -> LightSample:
        photograph = self.each[index]
        direction, _ = photograph.drawn(generator, count)
        hit = self.surfaces.first_real(mi.Ray3f(self._captures[index], direction), mi.Bool(True))
        point = mi.Vector3f(hit.point)
        radiance, density, _ = self._sent(point, hit, direction, mi.Bool(True))
        own = photograph.sighting(point, hit.normal, hit.valid, direction, mi.Bool(True))
        if self.surfaces.deformed:
            radiance = dr.select(hit.valid, self._at_rest(hit, hit.valid), radiance)
        sample = LightSample(
            dr.select(hit.valid, point, direction),
            dr.mulsign(hit.normal, -dr.dot(hit.normal, direction)),
            density & own.seen,
            radiance,
            hit.valid,
            self.surfaces.leaves_with_objects(hit),
            mi.UInt32(0),
        )
        dr.eval(vars(sample))  # At once: one by one would trace all rays again.
        return sample

    def _importance(self, index: int) -> NDArray[np.float32]:
        """Weight of a photograph where each of its pixels looks, shape (height, 2 height)."""
        photograph = self.each[index]
        image = np.empty((photograph.map.height, photograph.map.width), np.float32)
        for band in bands(photograph.map.width, photograph.map.height):
            u, v = (band.column + 0.5) / photograph.map.width, (band.row + 0.5) / photograph.map.height
            hit, direction = photograph.look_along(u, v)
            sightings = self._sightings(mi.Vector3f(hit.point), hit.normal, hit.valid, direction, mi.Bool(True))
            weights = weigh(sightings, hit.normal, hit.valid, direction)
            share = dr.maximum(weights.shares[index], self._parameters.least_importance)
            image[band.rows] = dr.select(sightings[index].counts > 0.0, share, 0.0).numpy().reshape(band.shape)
        return image


def _weighted(shares: Sequence[mi.Float], values: Sequence[mi.Color3f]) -> mi.Color3f:
    return reduce(operator.add, (share * value for share, value in zip(shares, values, strict=True)))
