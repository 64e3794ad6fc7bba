"""Light tracing: paths from the lights by way of objects to support or another object, splatted onto the image.

Theory, section 3, "Light tracing". The caustic of a polished object on a floor comes from a small part of its surface,
which a path from the floor seldom meets; a path from the lamp always does. The two are combined by multiple importance
sampling (bidirectional path tracing, Veach and Guibas 1995, reduced to the connection to the camera).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from lightdepth.kernel.tracing import first_hit, interaction, meets
from lightdepth.parameters.transport import DEFAULT, TransportParameters
from lightdepth.place.light_list import LightList, LightSample
from lightdepth.place.object_bounds import ObjectBounds
from lightdepth.place.place import Place
from lightdepth.place.real_surfaces import FaceKind
from lightdepth.place.reflectance import recovered_reflectance
from lightdepth.place.support_scattering import SpecularLobes, SupportScattering
from lightdepth.place.traced_surfaces import TracedSurfaces, leave, shadow_ray
from lightdepth.transport.sampler import Sampler


@dataclass
class Connection:
    """How a camera sees points.

    Attributes:
        origin: where its rays to them start, world, metres.
        film: position on the film, in [0, 1].
        solid_angle: of the pixels there, steradians.
        weight: of splats there; 1 where the image shows a point once and its rays have one origin.
        seen: whether the image shows that direction.
    """

    origin: mi.Point3f
    film: mi.Point2f
    solid_angle: mi.Float
    weight: mi.Float
    seen: mi.Bool


Connect = Callable[[mi.Point3f, Sampler], Connection]
"""From points, world, to their connections to the camera."""


@dataclass
class Splats:
    """Contributions of light paths to the image.

    Attributes:
        film: position on the film, in [0, 1].
        radiance: of the pixel there, times the number of light paths.
        on_object: which lie on an object, and not on support.
        valid: which contribute.
    """

    film: mi.Point2f
    radiance: mi.Color3f
    on_object: mi.Bool
    valid: mi.Bool


@dataclass
class LightPath:
    """Light paths, one in each lane.

    Attributes:
        sampler: their random numbers.
        ray: the next ray, world.
        active: which have not ended.
        flux: in watts.
        pdf_ratio: the factor of the pdf ratio (:meth:`LightTracer.weight`) that depends on their light and their first
            scattering.
        sampled_density: of the light samples that camera paths take of their light, times how many they count as, over
            the cosine at its surface, per square metre; of sky, per steradian.
        finite: false where they come from the sky.
        scatterings: so far, all on objects.
        arrived: which have ended after at least one.
        found: the surfaces that these ended on.
    """

    sampler: Sampler
    ray: mi.Ray3f
    active: mi.Bool
    flux: mi.Color3f
    pdf_ratio: mi.Float
    sampled_density: mi.Float
    finite: mi.Bool
    scatterings: mi.UInt32
    arrived: mi.Bool
    found: mi.PreliminaryIntersection3f


class LightTracer:
    """Light tracing by way of objects to the support, or the object, that the camera sees.

    Args:
        place: the photographed place.
        surfaces: real and synthetic surfaces; no material may have holes.
        bounds: of the objects.
        targets: of those that light paths are sent toward.
        lobes: the specular lobes of real surfaces.
        max_bounces: scatterings, the last one included, that a path may have.
        light_samples: how many light samples of each light of the place those of camera paths at an object count as in
            MIS.
        parameters: how paths are followed.
    """

    def __init__(
        self,
        place: Place,
        surfaces: TracedSurfaces,
        bounds: ObjectBounds,
        targets: ObjectBounds,
        lobes: SpecularLobes,
        max_bounces: mi.UInt32,
        light_samples: Sequence[float],
        parameters: TransportParameters = DEFAULT,
    ) -> None:
        self.place, self.surfaces, self.bounds, self.targets, self.lobes = place, surfaces, bounds, targets, lobes
        self.max_bounces, self.light_samples, self.parameters = max_bounces, tuple(light_samples), parameters

    # -- Multiple importance sampling ----------------------------------------------------------------------------

    @staticmethod
    def pdf_ratio_at_first(
        pixel: mi.Float, distance: mi.Float, cosine: mi.Float, onward_cosine: mi.Float, pdf: mi.Float
    ) -> mi.Float:
        """The factor of the pdf ratio that depends on the camera and on the surface that it sees.

        Args:
            pixel: solid angle of the pixel, steradians, times the number of light paths per camera path.
            distance: from the camera, metres.
            cosine: there, between the normal and the direction to the camera; its sign does not matter.
            onward_cosine: likewise to the next object.
            pdf: of that direction on camera paths, per steradian.
        """
        area = pixel * dr.square(distance) / dr.maximum(dr.abs(cosine), 1e-4)
        return area * dr.abs(onward_cosine) / dr.maximum(pdf, 1e-20)

    def camera_weight(
        self,
        pdf_ratio: mi.Float,
        index: int,
        light: mi.Vector3f,
        finite: mi.Bool,
        pdf: mi.Float,
        distance: mi.Float,
        point: mi.Point3f,
        direction: mi.Vector3f,
        scattering_pdf: mi.Float,
    ) -> mi.Float:
        """MIS weight of camera paths that lead to an object and from there to a light.

        Args:
            pdf_ratio: the factor of the pdf ratio from their first surface; 0 where light tracing cannot find them.
            index: of the light among those of the place.
            light: position, world, metres where ``finite``; of sky the direction toward it.
            finite: false for sky.
            pdf: of the sample among those of its light, as seen from ``point``, per steradian.
            distance: between ``point`` and light, metres.
            point: on the object, world, metres.
            direction: from there to the light, unit, world.
            scattering_pdf: of scattering from the camera path to the light, per steradian; 0 for delta lobes.
        """
        beams = self.targets.beams(light, finite)
        begun = pdf * self.place.path_shares[index]
        density = begun * beams.pdf(point, -direction) * dr.select(finite, dr.rcp(dr.square(distance)), 1.0)
        scattered = self._scattered_share(scattering_pdf, pdf * self.light_samples[index])
        return self.weight(pdf_ratio * (density * scattered))

    @staticmethod
    def _scattered_share(scattering_pdf: mi.Float, sampled_pdf: mi.Float) -> mi.Float:
        """Share of camera paths that reach a light by scattering and not by light sampling."""
        both = scattering_pdf + sampled_pdf
        return dr.select(scattering_pdf > 0.0, scattering_pdf / dr.maximum(both, 1e-20), 1.0)

    @staticmethod
    def weight(pdf_ratio: mi.Float) -> mi.Float:
        """MIS weight of a camera path by the pdf ratio of light tracing to it (power heuristic)."""
        return dr.rcp(1.0 + dr.square(dr.minimum(pdf_ratio, 1e15)))

    # -- Paths ---------------------------------------------------------------------------------------------------

    def trace(self, sampler: Sampler, lights: LightList, connect: Connect, per_path: mi.Float) -> Splats:
        """Trace paths from the light samples of the place, one in each lane, and connect them to the camera.

        Args:
            sampler: their random numbers.
            lights: light samples of the place.
            connect: the camera.
            per_path: light paths per camera path through one pixel.
        """
        return self._splatted(self._scattered_on_objects(self._emitted(sampler, lights)), connect, per_path)

    def _emitted(self, sampler: Sampler, lights: LightList) -> LightPath:
        """Paths that leave the light toward the objects."""
        count = dr.width(sampler.index)
        stratum = mi.Float(dr.arange(mi.UInt32, count)) + sampler.next_1d()
        u = stratum / dr.opaque(mi.Float, count)
        v = sampler.next_1d() if self.place.declared else u
        light = self.place.sample_light(lights, u, v, self.place.path_shares)
        beams = self.targets.beams(light.position, light.finite)
        origin, direction = beams.sample(sampler.next_1d(), mi.Point2f(sampler.next_1d(), sampler.next_1d()))
        cosine = dr.maximum(dr.abs(dr.dot(light.normal, direction)), 1e-6)
        light_density = light.density * dr.select(light.finite, dr.rcp(cosine), 1.0)
        density = light_density * beams.pdf(origin, direction)
        active = (
            (density > 0.0) & (dr.max(light.radiance) > 0.0) & ~light.on_relit & self.place.leaves(light, direction)
        )
        # Beams of the sky begin beyond all objects, so that they meet first what stands before their target. They must
        # get that far through the real surfaces.
        lift = self.bounds.extent(light.position) - dr.dot(mi.Vector3f(origin), light.position)
        origin += dr.select(light.finite, 0.0, light.position * lift)
        outward = mi.Ray3f(origin, -direction)
        active &= light.finite | self.place.unblocked(light, outward, active & ~light.finite)
        ray = mi.Ray3f(origin, direction)
        ray = dr.select(light.finite, leave(origin, light.normal, direction), ray)
        return LightPath(
            sampler,
            ray,
            active,
            flux=light.radiance * self.place.transmittance(light, origin) / dr.maximum(density, 1e-20),
            pdf_ratio=mi.Float(density),
            sampled_density=light_density * self._samples_per_path(light),
            finite=mi.Bool(light.finite),
            scatterings=mi.UInt32(0),
            arrived=mi.Bool(False),
            found=dr.zeros(mi.PreliminaryIntersection3f, count),
        )

    def _samples_per_path(self, light: LightSample) -> mi.Float:
        """How many light samples those of camera paths count as, relative to the share of light paths of their light."""
        shares = zip(self.light_samples, self.place.path_shares, strict=True)
        photograph, *declared = (
            n / max(share, 1e-9) for n, share in shares
        )  # An even photograph sends no light paths.
        result = mi.Float(photograph)
        for index, count in enumerate(declared, 1):
            result = dr.select(light.light == index, mi.Float(count), result)
        return result

    @dr.syntax
    def _scattered_on_objects(self, path: LightPath) -> LightPath:
        """Follow paths from object to object until they end."""
        while dr.hint(path.active, mode="symbolic"):
            path = self._advance(path)
        return path

    def _advance(self, path: LightPath) -> LightPath:
        """Follow paths to the next surface; on an object, scatter them or end them there."""
        sampler, ray, active = path.sampler, path.ray, mi.Bool(path.active)
        context = mi.BSDFContext(mi.TransportMode.Importance)
        first = path.scatterings == 0
        found = first_hit(self.surfaces.all, ray, active=active)
        on_real = active & self.surfaces.is_real(found)
        on_synthetic = active & found.is_valid() & ~on_real
        si = interaction(self.surfaces.all, found, ray, on_synthetic)
        materials = self.surfaces.materials
        material = materials.index(si, on_synthetic)
        smooth = mi.has_flag(materials.flags(material, on_synthetic), mi.BSDFFlags.Smooth)
        may_connect = on_synthetic & ~first & smooth
        connects = may_connect & (sampler.next_1d(active) < self.parameters.connection_probability)
        arrived = (on_real & ~first) | connects
        choice, position = sampler.next_1d(active), mi.Point2f(sampler.next_1d(active), sampler.next_1d(active))
        drawn, weight = materials.sample(material, context, si, choice, position, on_synthetic)
        direction = si.to_world(drawn.wo)
        # Shading normals make scattering asymmetric (Veach 1996): match what they do to the camera path.
        asymmetry = dr.abs(mi.Frame3f.cos_theta(si.wi) * dr.dot(si.n, direction))
        asymmetry /= dr.maximum(dr.abs(mi.Frame3f.cos_theta(drawn.wo) * dr.dot(si.n, ray.d)), 1e-6)
        scattered_flux = path.flux * weight * asymmetry

        reversed_si = mi.SurfaceInteraction3f(si)
        reversed_si.wi = drawn.wo
        _, scattering_pdf = materials.eval_pdf(material, mi.BSDFContext(), reversed_si, si.wi, on_synthetic & first)
        scattering_pdf = dr.select(mi.has_flag(drawn.sampled_type, mi.BSDFFlags.Delta), 0.0, scattering_pdf)
        sampled_pdf = path.sampled_density * dr.select(path.finite, dr.squared_norm(si.p - ray.o), 1.0)
        pdf_ratio = path.pdf_ratio * dr.select(first, self._scattered_share(scattering_pdf, sampled_pdf), 1.0)

        survival = dr.clip(dr.max(weight), 0.0, self.parameters.light_largest_survival)
        survival = dr.select(path.scatterings >= self.parameters.light_roulette_depth, survival, 1.0)
        scattered = (
            on_synthetic & ~connects & (dr.max(scattered_flux) > 0.0) & (path.scatterings + 2 <= self.max_bounces)
        )
        scattered &= sampler.next_1d(active) < survival
        scattered_flux *= dr.rcp(
            dr.maximum(survival, 1e-6) * dr.select(may_connect, 1.0 - self.parameters.connection_probability, 1.0)
        )
        flux = dr.select(scattered, scattered_flux, path.flux)
        flux *= dr.select(connects, 1.0 / self.parameters.connection_probability, 1.0)
        onward = leave(si.p, mi.Vector3f(si.n), direction)
        still = mi.Bool(scattered)
        if self.place.infinite:
            # Nothing real stands before a light that is infinitely far.
            passed = on_real & first
            hit = self.surfaces.real_hit(ray, found, passed)
            onward = dr.select(passed, leave(hit.point, hit.normal, ray.d), onward)
            still |= passed
        return LightPath(
            sampler,
            dr.select(still, onward, ray),
            still,
            flux,
            dr.select(scattered, pdf_ratio, path.pdf_ratio),
            path.sampled_density,
            path.finite,
            path.scatterings + dr.select(scattered, mi.UInt32(1), mi.UInt32(0)),
            path.arrived | arrived,
            dr.select(arrived, found, path.found),
        )

    def _splatted(self, path: LightPath, connect: Connect, per_path: mi.Float) -> Splats:
        """Connect the ends of paths to the camera."""
        ray, incoming, found = path.ray, -path.ray.d, path.found
        on_real = path.arrived & self.surfaces.is_real(found)
        on_object = path.arrived & found.is_valid() & ~on_real
        hit = self.surfaces.real_hit(ray, found, on_real)
        si = interaction(self.surfaces.all, found, ray, on_object)
        point = dr.select(on_object, si.p, hit.point)
        normal = dr.select(on_object, mi.Vector3f(si.n), hit.normal)

        camera = connect(point, path.sampler)
        offset = mi.Vector3f(camera.origin - point)
        distance = dr.norm(offset)
        outgoing = offset * dr.rcp(dr.maximum(distance, 1e-20))
        cosine, incoming_cosine = dr.dot(normal, outgoing), dr.dot(normal, incoming)
        on_object &= camera.seen
        on_support = on_real & camera.seen & self.surfaces.scatters(hit) & (hit.kind != int(FaceKind.RELIT))
        on_support &= (incoming_cosine > 0.0) & (cosine > 0.0)

        rho, specular_scale = recovered_reflectance(self.place, self.surfaces, hit, -outgoing, on_support)
        cones = self.bounds.cones(point)
        support = SupportScattering(
            rho, hit.normal, outgoing, self.lobes, hit.gloss, cones, mi.Float(1.0), specular_scale
        )
        value, pdf = support.evaluate(incoming)
        from_camera = mi.SurfaceInteraction3f(si)
        from_camera.wi = si.to_local(outgoing)
        materials = self.surfaces.materials
        material = materials.index(si, on_object)
        bsdf_value, bsdf_pdf = materials.eval_pdf(material, mi.BSDFContext(), from_camera, si.wi, on_object)
        value, pdf = dr.select(on_object, bsdf_value, value), dr.select(on_object, bsdf_pdf, pdf)

        angle = camera.solid_angle
        pdf_ratio = path.pdf_ratio * self.pdf_ratio_at_first(angle * per_path, distance, cosine, incoming_cosine, pdf)
        radiance = path.flux * value * (1.0 - self.weight(pdf_ratio))
        radiance *= dr.abs(cosine) / dr.maximum(dr.abs(incoming_cosine), 1e-6)
        radiance *= camera.weight
        radiance /= dr.maximum(angle * dr.square(distance), 1e-20)
        active = (on_support | on_object) & (dr.max(radiance) > 0.0)
        sight = shadow_ray(point, normal, outgoing, distance)
        active &= ~meets(self.surfaces.all, sight, active)
        return Splats(camera.film, radiance & active, on_object, active)
