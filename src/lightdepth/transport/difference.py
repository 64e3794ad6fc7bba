"""Path tracing of the difference that synthetic objects make to a photographed place.

Theory, eq. (3) and (4): a camera ray that meets a support surface at ``q`` carries ``M(q) + D(q)``. ``M(q)`` is the
photograph and is left to the film; this integrator estimates ``D``, and the radiance of synthetic surfaces, which is
ordinary path tracing in a place whose surfaces send ``M(q) + D(q)``. One bit of state distinguishes the two:
``difference``, set where the last scattering happened on a support surface. It is the paper's ``pt`` (algorithm 1),
inverted.
"""

from __future__ import annotations

import operator
from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass
from functools import reduce

import drjit as dr
import mitsuba as mi

from lightdepth.kernel.tracing import first_hit, interaction
from lightdepth.parameters.transport import DEFAULT, TransportParameters
from lightdepth.place.light_list import LightList
from lightdepth.place.object_bounds import Cones, ObjectBounds
from lightdepth.place.place import Place
from lightdepth.place.real_surfaces import FaceKind
from lightdepth.place.reflectance import recovered_reflectance
from lightdepth.place.support_scattering import SpecularLobes, SupportScattering
from lightdepth.place.traced_surfaces import RealHit, TracedSurfaces, leave, select_hit
from lightdepth.scene.model import Gloss
from lightdepth.transport.integrator import CameraSamples, Integrator, Path
from lightdepth.transport.light_sampling import LightSampling, Vertex, mis_weight
from lightdepth.transport.light_tracing import LightTracer
from lightdepth.transport.radiance_cache import NO_CELL, RadianceCache


@dataclass
class LastScattering:
    """The last scattering of a path.

    Attributes:
        point: where it was, world, metres.
        pdf: of its direction, per steradian; 0 where light sampling could not draw it.
        weight_samples: how many light samples of the map the one there counts as in MIS.
    """

    point: mi.Point3f
    pdf: mi.Float
    weight_samples: mi.Float


@dataclass
class DifferencePath(Path):
    """Paths of the difference.

    Attributes:
        difference: which scattered last on a support surface.
        last: their last scattering.
        smallest_pdf: smallest pdf of a scattered direction along the path, per steradian, delta lobes apart; infinite
            before the first. It gives the footprint.
    """

    difference: mi.Bool
    last: LastScattering
    smallest_pdf: mi.Float


class DifferenceIntegrator(Integrator[DifferencePath]):
    """The ``difference`` method, and with an infinitely far place the ``directional`` one.

    Args:
        place: the photographed place.
        surfaces: real and synthetic surfaces.
        bounds: the objects' bounds, or ``None`` without objects.
        max_bounces: scatterings after which a path ends; negative for no limit.
        glosses: the specular lobes that real surfaces may have.
        clamp_indirect: largest value that light of two or more bounces may add to a sample, against fireflies, or
            ``None``. Splats of light tracing need no such bound.
        targets: bounds of the objects that light paths are sent toward, or ``None`` for no light tracing; there is none
            either where materials have holes.
        parameters: how paths are followed.
    """

    def __init__(
        self,
        place: Place,
        surfaces: TracedSurfaces,
        bounds: ObjectBounds | None = None,
        max_bounces: int = 8,
        glosses: Sequence[Gloss] = (),
        clamp_indirect: float | None = None,
        targets: ObjectBounds | None = None,
        parameters: TransportParameters = DEFAULT,
    ) -> None:
        super().__init__(place, surfaces, bounds, max_bounces)
        self.parameters = parameters
        self.lobes = SpecularLobes(glosses, parameters)
        self.clamp = None if clamp_indirect is None else dr.opaque(mi.Float, clamp_indirect)
        self.has_relit = FaceKind.RELIT in surfaces.kinds
        self.has_mirrors = self.lobes.any and not place.infinite
        self.has_support = surfaces.changes
        self.light_sampling = LightSampling(place, surfaces, self.has_emitters, parameters)
        if bounds and targets and self.has_support and not surfaces.materials.have_holes and not surfaces.has_unseen:
            self.light_tracer = LightTracer(
                place,
                surfaces,
                bounds,
                targets,
                self.lobes,
                self.max_bounces,
                self.light_sampling.samples,
                parameters,
            )
            self.light_sampling.light_tracer = self.light_tracer

    def new_cache(self) -> RadianceCache | None:
        """See the base class."""
        return RadianceCache(self.bounds, self.parameters) if self.bounds is not None and self.has_support else None

    def begin(self, path: Path) -> DifferencePath:
        """See the base class."""
        last = LastScattering(mi.Point3f(path.ray.o), mi.Float(0.0), mi.Float(1.0))
        return DifferencePath(**vars(path), difference=mi.Bool(False), last=last, smallest_pdf=mi.Float(dr.inf))

    def samples(self, path: DifferencePath) -> CameraSamples:
        """See the base class."""
        return CameraSamples(path.radiance & ~path.covered, path.radiance & path.covered, mi.Bool(path.covered))

    def advance(self, path: DifferencePath, lights: LightList, cache: RadianceCache | None) -> DifferencePath:
        """See the base class."""
        sampler, ray, last = path.sampler, mi.Ray3f(path.ray), copy(path.last)
        radiance, throughput = mi.Color3f(path.radiance), mi.Color3f(path.throughput)
        active, difference, first = mi.Bool(path.active), mi.Bool(path.difference), mi.Bool(path.first)
        covered, depth, cell = mi.Bool(path.covered), mi.UInt32(path.depth), mi.UInt64(path.cell)
        context, parameters = mi.BSDFContext(), self.parameters
        bounds = self.bounds if self.has_support else None

        found = first_hit(self.surfaces.all, ray, active=active)
        on_real = active & self.surfaces.is_real(found)
        on_synthetic = active & found.is_valid() & ~on_real
        on_removed = on_synthetic & self.surfaces.is_removed(found)
        # Cameras do not see these by themselves: the path goes on behind as if nothing were there.
        unseen = on_synthetic & first & self.surfaces.is_unseen(found, on_synthetic)
        hit = self.surfaces.real_hit(ray, found, on_real)
        on_relit = on_real & (hit.kind == int(FaceKind.RELIT))
        si = interaction(self.surfaces.all, found, ray, on_synthetic)

        # What the place sends along the ray: added by eq. (3) at real surfaces, subtracted by eq. (4) where a new
        # surface stands before them and the last scattering was on support.
        blocked = (on_synthetic | on_relit) & difference
        arrived = active & ~on_synthetic & ~on_relit & ~difference & ~first
        radiance += throughput * self._before(ray, hit, blocked, blocked & on_synthetic, arrived, path)
        if self.has_emitters:
            radiance += throughput * self._emission(si, on_synthetic & ~unseen, first, last, depth)

        covered |= first & ((on_synthetic & ~unseen) | on_relit)

        # Only new surfaces and the seen side of support and of glossy environment scatter, up to the last bounce; holes
        # are passed after it too.
        outside = dr.dot(hit.normal, ray.d) < 0.0
        on_support = on_real & self.surfaces.scatters(hit) & outside
        materials = self.surfaces.materials
        material = materials.index(si, on_synthetic)
        scatters = depth < self.max_bounces
        mirrors = arrived & self._mirrors_elsewhere(hit, on_support & ~on_relit & scatters)
        passes = on_synthetic & (unseen | self._has_holes(material, on_synthetic))
        active &= (scatters & (on_synthetic | on_support)) | passes
        rho, specular_scale = self._reflectance(hit, ray.d, active & on_support)
        if self.has_mirrors:
            # What is mirrored toward the capture point gives way to what is mirrored here: the lobe scatters all light and
            # not its change, by a draw between the two.
            shown = specular_scale * self.place.photograph.mirrored(hit, ray.d, mirrors)
            radiance -= dr.select(mirrors, self._clamped(throughput * shown, depth), 0.0)
            chance = dr.select(dr.max(rho) > 0.0, mi.Float(parameters.mirrors_all), 1.0)
            all_light = mirrors & (sampler.next_1d(mirrors) < chance)
            throughput *= dr.select(mirrors, dr.rcp(dr.select(all_light, chance, 1.0 - chance)), 1.0)
            rho = dr.select(all_light, 0.0, rho)
            specular_scale = dr.select(mirrors & ~all_light, 0.0, specular_scale)
        else:
            all_light = mi.Bool(False)
        if cache is not None:
            cached, mean, begins, here = self._cached(cache, path, hit, active & on_support)
            radiance += dr.select(cached, throughput * rho * mean, 0.0)
            active &= ~cached
            # The record of a training path is all that it finds from here on, as if the support were white.
            cell = dr.select(begins, here, cell)
            radiance, throughput = dr.select(begins, 0.0, radiance), dr.select(begins, 1.0, throughput)
            rho = dr.select(begins, 1.0, rho)
        active &= on_synthetic | (dr.max(rho) > 0.0) | ((hit.gloss > 0) & (dr.max(specular_scale) > 0.0))
        point = dr.select(on_synthetic, si.p, hit.point)
        normal = dr.select(on_synthetic, mi.Vector3f(si.n), hit.normal)
        cones: Cones | None = None
        if bounds is not None:
            cones = bounds.cones(point)

        # Russian roulette: by throughput, and between support surfaces by the chance to meet an object.
        between_support = on_support & ~on_relit & ~first & ~all_light
        carried = dr.max(throughput)
        # What was aimed at from far away weighs little only because it was drawn so often.
        density = dr.pi * path.last.pdf
        carried *= dr.select(between_support & (density > parameters.aimed_density), density, 1.0)
        if cones is not None:
            reach = dr.clip(
                parameters.roulette_gain * dr.inv_two_pi * cones.solid_angle, parameters.smallest_reach, 1.0
            )
            carried *= dr.select(between_support, reach, 1.0)
        roulette = between_support | (depth >= parameters.roulette_depth)
        survival = dr.select(roulette, dr.clip(carried, 0.0, parameters.largest_survival), 1.0)
        active &= sampler.next_1d(active) < survival
        throughput *= dr.rcp(dr.maximum(survival, 1e-6))

        in_difference = active & on_support & ~on_relit & ~all_light
        # Object-directed sampling makes the other directions heavier: paths of high throughput use it less, so that
        # weights do not multiply.
        directed = dr.select(in_difference, dr.minimum(dr.rcp(dr.maximum(dr.max(throughput), 1e-6)), 1.0), 0.0)
        support = SupportScattering(rho, hit.normal, -ray.d, self.lobes, hit.gloss, cones, directed, specular_scale)
        scattering = active & on_synthetic & ~unseen
        vertex = Vertex(point, normal, si, material, support, scattering, active & on_support, in_difference)

        # Light sampling, and what it counts as where the next direction meets light.
        weight_samples = self.light_sampling.weight_samples(in_difference)
        direct = self.light_sampling.direct(
            sampler, lights, context, vertex, active & scatters, first, weight_samples, path.pdf_ratio
        )
        radiance += throughput * self._clamped(direct, path.depth)

        # The next direction.
        choice, x, y = sampler.direction(first, active)
        drawn, weight = materials.sample(material, context, si, choice, mi.Point2f(x, y), vertex.on_synthetic)
        support_direction = support.sample(choice, mi.Point2f(x, y))
        support_value, support_pdf = support.evaluate(support_direction)
        direction = dr.select(vertex.on_support, support_direction, si.to_world(drawn.wo))
        direction = dr.select(unseen, ray.d, direction)
        weight = dr.select(unseen, 1.0, weight)
        throughput *= dr.select(vertex.on_support, support_value / dr.maximum(support_pdf, 1e-20), weight)
        pdf = dr.select(mi.has_flag(drawn.sampled_type, mi.BSDFFlags.Delta), 0.0, drawn.pdf)
        pdf = dr.select(vertex.on_support, support_pdf, pdf)
        # Light tracing reaches what the camera sees by way of objects alone.
        pdf_ratio = dr.select(vertex.on_synthetic & ~first, path.pdf_ratio, 0.0)
        if self.light_tracer is not None:
            distance = dr.select(on_synthetic, si.t, hit.distance)
            cosines = dr.dot(normal, ray.d), dr.dot(normal, direction)
            at_first = self.light_tracer.pdf_ratio_at_first(path.pdf_ratio, distance, *cosines, pdf)
            pdf_ratio = dr.select(first & (in_difference | (vertex.on_synthetic & (pdf > 0.0))), at_first, pdf_ratio)

        # Passing through a mask's hole is no scattering: the last one stays as it is.
        through = unseen | (vertex.on_synthetic & mi.has_flag(drawn.sampled_type, mi.BSDFFlags.Null))
        last.point = dr.select(through, last.point, point)
        last.pdf = dr.select(through, last.pdf, pdf)
        last.weight_samples = dr.select(through, last.weight_samples, weight_samples)
        smallest_pdf = dr.select(through | (pdf == 0.0), path.smallest_pdf, dr.minimum(path.smallest_pdf, pdf))
        # What it blocks was subtracted when it was met, so that what shows through it counts in full.
        difference = mi.Bool(in_difference)
        # Behind what was removed, the camera sees what is behind it and not the photograph.
        covered &= ~(through & first & ~on_removed)
        depth = dr.select(through, depth, depth + 1)
        first &= through & ~on_removed
        ray = leave(point, normal, direction)
        active &= (dr.max(throughput) > 0.0) & (scatters | through)
        return DifferencePath(
            sampler,
            ray,
            active,
            radiance,
            throughput,
            first,
            covered,
            depth,
            cell,
            pdf_ratio,
            difference,
            last,
            smallest_pdf,
        )

    def direct_from(self, ray: mi.Ray3f, lights: LightList, u: mi.Float, active: mi.Bool) -> mi.Color3f:
        """Contribution of single light samples at the first hit of rays, as if each were the only one of its list.

        Its mean over a list is the expectation of light sampling along the ray.

        Args:
            ray: camera rays, world.
            lights: light samples of the map.
            u: uniform random numbers that pick them.
            active: lanes to evaluate.
        """
        found = first_hit(self.surfaces.seen, ray, active=active)
        on_real = active & self.surfaces.is_real(found)
        on_synthetic = active & found.is_valid() & ~on_real
        hit = self.surfaces.real_hit(ray, found, on_real)
        si = interaction(self.surfaces.seen, found, ray, on_synthetic)
        on_support = on_real & self.surfaces.scatters(hit) & (dr.dot(hit.normal, ray.d) < 0.0)
        in_difference = on_support & (hit.kind != int(FaceKind.RELIT))
        rho, specular_scale = self._reflectance(hit, ray.d, on_support)
        point = dr.select(on_synthetic, si.p, hit.point)
        cones = self.bounds.cones(point) if self.has_support and self.bounds is not None else None
        directed = dr.select(in_difference, mi.Float(1.0), 0.0)
        support = SupportScattering(rho, hit.normal, -ray.d, self.lobes, hit.gloss, cones, directed, specular_scale)
        vertex = Vertex(
            point,
            dr.select(on_synthetic, mi.Vector3f(si.n), hit.normal),
            si,
            self.surfaces.materials.index(si, on_synthetic),
            support,
            on_synthetic,
            on_support,
            in_difference,
        )
        return self.light_sampling.single(lights, u, vertex, active)

    # -- The terms ----------------------------------------------------------------------------------------------

    def _before(
        self,
        ray: mi.Ray3f,
        hit: RealHit,
        blocked: mi.Bool,
        look_behind: mi.Bool,
        arrived: mi.Bool,
        path: DifferencePath,
    ) -> mi.Color3f:
        """``+M(q)`` where a path arrives at the place, ``-M(q)`` where a new surface blocks it.

        Args:
            ray: the rays that met ``hit`` or something before it.
            hit: real surfaces met.
            blocked: a new surface was met in difference mode.
            look_behind: ``blocked`` by a surface behind which ``q`` is still to be found.
            arrived: a real surface or the sky was met otherwise.
            path: the paths up to there.
        """
        last = path.last
        if not self.place.infinite and self.surfaces.has_real and self.surfaces.has_synthetic:
            hit = select_hit(look_behind, self.surfaces.first_real(ray, look_behind), hit)
        wanted = blocked | arrived
        distance = dr.norm(hit.point - last.point)
        values = []
        arriving = self.place.arriving(ray, hit, distance, wanted, arrived)
        counts = self.light_sampling.counts(last.weight_samples)
        for index, ((radiance, pdf, finite), count) in enumerate(zip(arriving, counts, strict=True)):
            value = self._clamped(radiance * mis_weight(last.pdf, pdf * count), path.depth)
            if self.light_tracer is not None:
                light = dr.select(finite, mi.Vector3f(hit.point), ray.d)
                # Light tracing needs a vertex between the light and what the camera sees.
                pdf_ratio = dr.select(path.depth > 1, path.pdf_ratio, 0.0)
                weight = self.light_tracer.camera_weight(
                    pdf_ratio, index, light, finite, pdf, distance, last.point, ray.d, last.pdf
                )
                value *= dr.select(blocked, 1.0, weight)
            values.append(value)
        total = reduce(operator.add, values)
        return dr.select(wanted, dr.select(blocked, -total, total), 0.0)

    def _cached(
        self, cache: RadianceCache, path: DifferencePath, hit: RealHit, on_support: mi.Bool
    ) -> tuple[mi.Bool, mi.Color3f, mi.Bool, mi.UInt64]:
        """Where paths end in the radiance cache, or begin a record for it: on plain support, with a large footprint.

        There the mean over the cell is as good as the point that happens to be met.

        Args:
            cache: the radiance cache.
            path: the paths that arrive.
            hit: what they meet.
            on_support: which of the active ones meet support.

        Returns:
            Which end, the mean for these, which begin a record, and the cells of all.
        """
        here, edge = cache.cell(hit.point, hit.normal)
        cosine = dr.maximum(-dr.dot(hit.normal, path.ray.d), 1e-3)
        footprint = dr.square(hit.distance) / (path.smallest_pdf * cosine)
        wide = ~path.first & (footprint > self.parameters.smallest_footprint * dr.square(edge))
        eligible = on_support & (hit.kind == int(FaceKind.SUPPORT)) & (hit.gloss == 0) & wide
        trains = cache.training & (path.cell == NO_CELL)
        cached, mean = cache.look_up(here, eligible & ~trains)
        return cached, mean, eligible & trains, here

    def _emission(
        self,
        si: mi.SurfaceInteraction3f,
        on_synthetic: mi.Bool,
        first: mi.Bool,
        last: LastScattering,
        depth: mi.UInt32,
    ) -> mi.Color3f:
        """Light that synthetic surfaces emit along the ray."""
        emitter = si.emitter(self.surfaces.emitting, on_synthetic)
        shines = on_synthetic & (emitter != None)  # noqa: E711 - a comparison of pointers, lane by lane
        reference = dr.zeros(mi.Interaction3f)
        reference.p = last.point
        sampled = mi.DirectionSample3f(self.surfaces.emitting, si, reference)
        pdf = self.surfaces.emitting.pdf_emitter_direction(reference, sampled, shines & ~first)
        weight = dr.select(first, 1.0, mis_weight(last.pdf, pdf * (1.0 - self.light_sampling.map_share)))
        return dr.select(shines, self._clamped(emitter.eval(si, shines) * weight, depth), 0.0)

    def _mirrors_elsewhere(self, hit: RealHit, scattering: mi.Bool) -> mi.Bool:
        """Which of the scattering real surfaces mirror something else to a path than to the capture point."""
        return scattering & (hit.gloss > 0) if self.has_mirrors else mi.Bool(False)

    def _has_holes(self, material: mi.UInt32, active: mi.Bool) -> mi.Bool:
        """Whether light may pass a material without being scattered."""
        if not self.surfaces.materials.have_holes:
            return mi.Bool(False)
        return mi.has_flag(self.surfaces.materials.flags(material, active), mi.BSDFFlags.Null)

    def _reflectance(self, hit: RealHit, direction: mi.Vector3f, active: mi.Bool) -> tuple[mi.Color3f, mi.Color3f]:
        """Recovered albedo and factor on the specular lobe at support points that rays meet, else 0."""
        if not (self.has_support or self.has_relit):
            return mi.Color3f(0.0), mi.Color3f(0.0)
        return recovered_reflectance(self.place, self.surfaces, hit, direction, active)

    def _clamped(self, value: mi.Color3f, depth: mi.UInt32) -> mi.Color3f:
        """Indirect light clamped to the user's bound, where there is one."""
        if self.clamp is None:
            return value
        scale = dr.minimum(1.0, self.clamp / dr.maximum(dr.max(dr.abs(value)), 1e-20))
        return dr.select(depth > 1, value * scale, value)
