"""Light sampling at the vertices of camera paths: of the map by resampled importance sampling, or of synthetic emitters.

Theory, section 3, "Techniques at a vertex": technique 1, with its shadow ray and its MIS weight.
"""

from __future__ import annotations

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from lightdepth.kernel.tracing import first_interaction, meets
from lightdepth.parameters.transport import TransportParameters
from lightdepth.place.light_list import LightList, LightSample
from lightdepth.place.place import Place
from lightdepth.place.real_light import DeclaredLight
from lightdepth.place.real_surfaces import FaceKind
from lightdepth.place.support_scattering import SupportScattering
from lightdepth.place.traced_surfaces import TracedSurfaces, leave, shadow_ray
from lightdepth.transport.light_tracing import LightTracer
from lightdepth.transport.sampler import Sampler


@dataclass
class Vertex:
    """Where paths scatter.

    Attributes:
        point: world, metres.
        normal: geometric, unit, world, on either side.
        si: Mitsuba's description of synthetic surfaces.
        material: its index, of synthetic surfaces.
        support: scattering of support surfaces.
        on_synthetic: which points are synthetic.
        on_support: which are on support, relit or not.
        in_difference: which are on support that is not relit.
    """

    point: mi.Point3f
    normal: mi.Vector3f
    si: mi.SurfaceInteraction3f
    material: mi.UInt32
    support: SupportScattering
    on_synthetic: mi.Bool
    on_support: mi.Bool
    in_difference: mi.Bool


class LightSampling:
    """Samples light at vertices: of the map or of synthetic emitters, and of declared lights.

    Args:
        place: the photographed place.
        surfaces: real and synthetic surfaces.
        has_emitters: whether some of the latter emit light.
        parameters: how many candidates.

    Attributes:
        map_share: share of the samples that are of the map; the others are of synthetic emitters.
        samples: how many light samples of each light of the place those at an object count as in MIS.
        light_tracer: what the samples are MIS-weighted against besides scattering, or ``None``.
    """

    def __init__(
        self,
        place: Place,
        surfaces: TracedSurfaces,
        has_emitters: bool,
        parameters: TransportParameters,
    ) -> None:
        self._place, self._surfaces, self._parameters = place, surfaces, parameters
        self.light_tracer: LightTracer | None = None
        self._has_emitters = has_emitters
        self._has_relit = not surfaces.kinds.isdisjoint((FaceKind.RELIT, FaceKind.REMOVED))
        self.map_share = 0.5 if has_emitters else 1.0
        # What little stands out of the map beside declared lights is found by scattering, with less noise and less work.
        self._map_worth = place.path_shares[0] if place.declared else 1.0
        self._candidates = max(round(parameters.candidates * self._map_worth), 1)
        of_map = self.map_share * (parameters.candidates * self._map_worth)
        self.samples = (of_map, *(1.0 for _ in place.declared))

    def counts(self, weight_samples: mi.Float) -> list[mi.Float]:
        """How many light samples of each light of the place those at a vertex count as in MIS.

        Args:
            weight_samples: those of the map there.
        """
        return [weight_samples, *(mi.Float(count) for count in self.samples[1:])]

    def weight_samples(self, in_difference: mi.Bool) -> mi.Float:
        """How many light samples of the map the one at vertices counts as in MIS.

        In difference mode the result depends on whether the one shadow ray is blocked, so its candidates count as one.
        """
        worth = self._map_worth
        return self.map_share * dr.select(in_difference, mi.Float(worth), self._parameters.candidates * worth)

    def direct(
        self,
        sampler: Sampler,
        lights: LightList,
        context: mi.BSDFContext,
        vertex: Vertex,
        active: mi.Bool,
        first: mi.Bool,
        weight_samples: mi.Float,
        pdf_ratio: mi.Float,
    ) -> mi.Color3f:
        """Light sampling at a vertex: of the map or of synthetic emitters, and of declared lights.

        Args:
            sampler: random numbers of the paths.
            lights: light samples of the map.
            context: for the BSDFs.
            vertex: where the paths are.
            active: which of them take a sample.
            first: which of them are at their first vertex.
            weight_samples: how many light samples of the map the one taken counts as in MIS.
            pdf_ratio: of the paths up to there, see :class:`~lightdepth.transport.integrator.Path`.
        """
        u = dr.select(first, sampler.stratified("light")[0], sampler.next_1d(active))
        u_select = dr.select(first, sampler.stratified("candidate")[0], sampler.next_1d(active))
        # Declared lights' samples are added to the map's, so that they may share its random numbers: the most even ones.
        at = mi.Point2f(u, u_select)
        from_map = mi.Bool(True)
        if self._has_emitters:
            from_map = u < self.map_share
            u = dr.select(from_map, u / self.map_share, u)
        u, gain = self._resampled(lights, context, vertex, active & from_map, u, u_select, weight_samples)
        light = lights.sample(u, active & from_map)
        direction, distance, map_pdf = self._place.toward(light, vertex.point)
        mis_pdf, pdf = map_pdf * weight_samples, map_pdf * (self.map_share * self._candidates)
        radiance = light.radiance * gain
        if self._has_emitters:
            reference = dr.zeros(mi.SurfaceInteraction3f)
            reference.p, reference.n = vertex.point, mi.Normal3f(vertex.normal)
            position = mi.Point2f(sampler.next_1d(active), sampler.next_1d(active))
            sampled, weight = self._surfaces.emitting.sample_emitter_direction(
                reference, position, False, active & ~from_map
            )
            direction = dr.select(from_map, direction, sampled.d)
            distance = dr.select(from_map, distance, sampled.dist)
            pdf = dr.select(from_map, pdf, sampled.pdf * (1.0 - self.map_share))
            mis_pdf = dr.select(from_map, mis_pdf, pdf)
            radiance = dr.select(from_map, radiance, weight * sampled.pdf)

        value, scattering_pdf = self.scattering(context, vertex, direction, active)
        value *= radiance * (mis_weight(mis_pdf, scattering_pdf) / dr.maximum(pdf, 1e-20))
        if self.light_tracer is not None:
            camera_weight = self.light_tracer.camera_weight(
                pdf_ratio,
                0,
                light.position,
                light.finite,
                map_pdf,
                distance,
                vertex.point,
                direction,
                scattering_pdf,
            )
            value *= dr.select(vertex.on_synthetic & from_map & ~first, camera_weight, 1.0)
        useful = active & (pdf > 0.0) & (dr.max(value) > 0.0)
        value *= self.visible(vertex, light, direction, distance, from_map, vertex.in_difference & from_map, useful)
        value = dr.select(useful, value, 0.0)
        for index, declared in enumerate(self._place.declared, 1):
            value += self._declared(index, declared, at, sampler, context, vertex, active, first, pdf_ratio)
        return value

    def _declared(
        self,
        index: int,
        declared: DeclaredLight,
        at: mi.Point2f,
        sampler: Sampler,
        context: mi.BSDFContext,
        vertex: Vertex,
        active: mi.Bool,
        first: mi.Bool,
        pdf_ratio: mi.Float,
    ) -> mi.Color3f:
        """One light sample of a declared light, with a shadow ray of its own.

        Whether a sun is visible is nearly the same for all of its samples. One ray for sun and map would be a draw between
        the two, as noisy as the sun's part and the map's are alike.

        Args:
            index: of the light among those of the place.
            declared: the light.
            at: uniform random numbers that pick a place on it.
            sampler: further random numbers of the paths.
            context: for the BSDFs.
            vertex: where the paths are.
            active: which of them take a sample.
            first: which of them are at their first vertex.
            pdf_ratio: of the paths up to there.
        """
        light = declared.sample(at.x, at.y)
        direction, distance, pdf = self._place.toward(light, vertex.point)
        chance = dr.select(declared.may_light(vertex.point), mi.Float(1.0), self._parameters.unlikely_sun)
        tried = active & (sampler.next_1d(active) < chance)
        tried &= ~vertex.in_difference | vertex.support.may_meet_objects(direction)
        value, scattering_pdf = self.scattering(context, vertex, direction, tried)
        weight = mis_weight(pdf, scattering_pdf) / dr.maximum(pdf * chance, 1e-20)
        value *= light.radiance * declared.transmittance(vertex.point) * weight
        if self.light_tracer is not None:
            camera_weight = self.light_tracer.camera_weight(
                pdf_ratio,
                index,
                light.position,
                light.finite,
                pdf,
                distance,
                vertex.point,
                direction,
                scattering_pdf,
            )
            value *= dr.select(vertex.on_synthetic & ~first, camera_weight, 1.0)
        useful = tried & (pdf > 0.0) & (dr.max(value) > 0.0)
        ray = shadow_ray(vertex.point, vertex.normal, direction, distance)
        passed = self._transmittance(ray, useful)
        if self._surfaces.has_removed:
            before = useful & vertex.in_difference
            before &= ~declared.blocked(ray, before)
            after = passed & ~declared.blocked(ray, useful & (passed > 0.0), kept=True)
            return dr.select(useful, value * (after - dr.select(before, mi.Float(1.0), 0.0)), 0.0)
        value *= dr.select(vertex.in_difference, passed - 1.0, passed)
        useful &= dr.max(dr.abs(value)) > 0.0
        return dr.select(useful & ~declared.blocked(ray, useful), value, 0.0)

    def single(self, lights: LightList, u: mi.Float, vertex: Vertex, active: mi.Bool) -> mi.Color3f:
        """Contribution of single light samples of the map, as if each were the only one of its list.

        Args:
            lights: light samples of the map.
            u: uniform random numbers that pick them.
            vertex: where light arrives.
            active: lanes to evaluate.
        """
        light = lights.sample(u, active)
        direction, distance, pdf = self._place.toward(light, vertex.point)
        value, scattering_pdf = self.scattering(mi.BSDFContext(), vertex, direction, active)
        weight_samples = self.weight_samples(vertex.in_difference)
        value *= light.radiance * (mis_weight(pdf * weight_samples, scattering_pdf) / dr.maximum(pdf, 1e-20))
        useful = (vertex.on_synthetic | vertex.on_support) & (pdf > 0.0) & (dr.max(value) > 0.0)
        useful &= ~vertex.in_difference | light.on_relit | vertex.support.may_meet_objects(direction)
        value *= self.visible(vertex, light, direction, distance, mi.Bool(True), vertex.in_difference, useful)
        return dr.select(useful, value, 0.0)

    @dr.syntax
    def _resampled(
        self,
        lights: LightList,
        context: mi.BSDFContext,
        vertex: Vertex,
        active: mi.Bool,
        u: mi.Float,
        u_select: mi.Float,
        weight_samples: mi.Float,
    ) -> tuple[mi.Float, mi.Float]:
        """Resampled importance sampling (Talbot et al. 2005) of one light sample of the map out of several candidates.

        The target is the unoccluded contribution. The sum over the candidates is kept in expectation, and only one
        shadow ray is traced. On support, a candidate whose direction misses all objects' bounds has target 0.

        Args:
            lights: light samples of the map.
            context: for the BSDFs.
            vertex: where light arrives.
            active: which paths take a sample.
            u: uniform random number that picks the candidates, one in each of as many equal parts of the list.
            u_select: uniform random number that picks one among them.
            weight_samples: how many light samples of the map the one taken counts as in MIS.

        Returns:
            The ``u`` of the candidate for :meth:`LightList.sample`, and the factor on its contribution.
        """
        kept, kept_target, total = mi.Float(u), mi.Float(0.0), mi.Float(0.0)
        u_select = mi.Float(u_select)
        candidate = mi.UInt32(0)
        while candidate < self._candidates:
            u_candidate = (u + mi.Float(candidate)) * (1.0 / self._candidates)
            light = lights.outline(u_candidate, active)
            direction, _, pdf = self._place.toward(light, vertex.point)
            value, scattering_pdf = self.scattering(context, vertex, direction, active)
            weight = mis_weight_over_pdf(pdf, scattering_pdf, weight_samples)
            counts = (pdf * weight_samples > 0.0) & (
                ~vertex.in_difference | light.on_relit | vertex.support.may_meet_objects(direction)
            )
            target = dr.select(counts, dr.max(value * light.radiance) * weight, 0.0)
            total += target
            # One random number serves all candidates: rescaled after each decision, it is uniform again.
            whole = dr.maximum(total, 1e-30)
            u_select *= whole
            taken = u_select < target
            u_select = dr.select(taken, u_select, u_select - target)
            u_select /= dr.maximum(dr.select(taken, target, whole - target), 1e-12 * whole)
            kept, kept_target = dr.select(taken, u_candidate, kept), dr.select(taken, target, kept_target)
            candidate += 1
        return kept, dr.select(kept_target > 0.0, total / dr.maximum(kept_target, 1e-30), 0.0)

    def scattering(
        self, context: mi.BSDFContext, vertex: Vertex, direction: mi.Vector3f, active: mi.Bool
    ) -> tuple[mi.Color3f, mi.Float]:
        """``f |cos|`` and the density per steradian of scattering toward directions, on new surfaces and support."""
        on_synthetic = vertex.on_synthetic & active
        bsdf_value, bsdf_pdf = self._surfaces.materials.eval_pdf(
            vertex.material, context, vertex.si, vertex.si.to_local(direction), on_synthetic
        )
        support_value, support_pdf = vertex.support.evaluate(direction)
        return (
            dr.select(vertex.on_synthetic, bsdf_value, support_value),
            dr.select(vertex.on_synthetic, bsdf_pdf, support_pdf),
        )

    def visible(
        self,
        vertex: Vertex,
        light: LightSample,
        direction: mi.Vector3f,
        distance: mi.Float,
        from_map: mi.Bool,
        inverted: mi.Bool,
        active: mi.Bool,
    ) -> mi.Float:
        """Signed visibility of light samples.

        A light sample ``l`` counts where it is what the vertex sees: where no other real surface stands between. At a
        synthetic point it is lost if something new stands between; at a support point in difference mode that is just
        when it counts, as ``-M(l)``. So the new surfaces are tested first, and the real ones only where it matters.

        Args:
            vertex: where light arrives.
            light: the samples of the map.
            direction: toward the samples, unit, world.
            distance: to them, metres.
            from_map: which are samples of the map; the others lie on synthetic emitters.
            inverted: which count where they are blocked.
            active: lanes to evaluate.
        """
        ray = shadow_ray(vertex.point, vertex.normal, direction, distance)
        passed = self._transmittance(ray, active)
        if self._surfaces.has_removed:
            # What was removed stood in the way before, and does not afterwards.
            before = dr.select(self._place.unblocked(light, ray, active & inverted), mi.Float(1.0), 0.0)
            after = passed & self._place.unblocked(light, ray, active & (passed > 0.0), kept=True)
            after = dr.select(from_map & light.on_relit, 0.0, after)
            return dr.select(inverted, after - before, after) & active
        share = dr.select(inverted, passed - 1.0, passed)
        if self._has_relit:
            share = dr.select(from_map & light.on_relit, dr.select(inverted, -1.0, 0.0), share)
        return share & self._place.unblocked(light, ray, active & (share != 0.0))

    def _transmittance(self, ray: mi.Ray3f, active: mi.Bool) -> mi.Float:
        """Share of light that passes all synthetic surfaces along shadow rays."""
        if not self._surfaces.has_synthetic:
            return mi.Float(1.0)
        if self._surfaces.materials.have_holes:
            return self._masked_transmittance(ray, active)
        return dr.select(meets(self._surfaces.synthetic, ray, active), mi.Float(0.0), 1.0)

    @dr.syntax
    def _masked_transmittance(self, ray: mi.Ray3f, active: mi.Bool) -> mi.Float:
        """The same where materials have holes: from surface to surface."""
        materials = self._surfaces.materials
        ray, active, passed = mi.Ray3f(ray), mi.Bool(active), mi.Float(1.0)
        while dr.hint(active, mode="symbolic"):
            si = first_interaction(self._surfaces.synthetic, ray, active)
            active &= si.is_valid()
            transmission = materials.null_transmission(materials.index(si, active), si, active)
            # Not `dr.mean`, which writes the number of lanes into the program: it would be compiled again for each.
            mean = (transmission.x + transmission.y + transmission.z) / 3.0
            passed *= dr.select(active, mean, 1.0)
            active &= passed > 0.0
            remaining = ray.maxt - si.t
            ray = leave(si.p, mi.Vector3f(si.n), ray.d, remaining)
        return passed


def mis_weight(pdf: mi.Float, other: mi.Float) -> mi.Float:
    """Power heuristic; 1 where ``pdf`` is 0, which marks directions that no other technique can draw."""
    squared = dr.square(pdf)
    weight = squared / (squared + dr.square(other))
    return dr.select(pdf > 0.0, weight, 1.0)


def mis_weight_over_pdf(pdf: mi.Float, other: mi.Float, count: mi.Float) -> mi.Float:
    """:func:`mis_weight` of ``count`` samples, over ``pdf``, with one division: it takes most of a candidate's time.

    NaN where both densities are 0.
    """
    weighted = pdf * count
    return count * weighted / (dr.square(weighted) + dr.square(other))
