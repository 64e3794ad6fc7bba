"""Scattering at support surfaces: ``f_p`` of the difference integral, and how its directions are drawn.

Theory, eq. (4) to (6): a Lambertian lobe with the recovered albedo and, where the user asks for gloss, a GGX lobe on
top.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import drjit as dr
import mitsuba as mi

from lightdepth.parameters.transport import DEFAULT, TransportParameters
from lightdepth.place.object_bounds import Cones
from lightdepth.scene.model import Gloss

SMALLEST_ALPHA = 1e-3


def index_of_refraction(specular: float) -> float:
    """Of a dielectric whose reflectance at normal incidence is 8 % times its specular level."""
    amplitude = math.sqrt(0.08 * specular)
    return (1.0 + amplitude) / (1.0 - amplitude)


class SpecularLobes:
    """The GGX lobes of the glossy support surfaces, looked up by their index.

    Args:
        glosses: the lobes; index 0 means none, index i + 1 the i-th.
        parameters: how often they are sampled.
    """

    def __init__(self, glosses: Sequence[Gloss], parameters: TransportParameters = DEFAULT) -> None:
        self.glossy_share = parameters.glossy_share
        self.any = len(glosses) > 0
        self._alpha = mi.Float([1.0, *(max(gloss.roughness**2, SMALLEST_ALPHA) for gloss in glosses)])
        self._ior = mi.Float([1.0, *(index_of_refraction(gloss.specular) for gloss in glosses)])
        self._scale = mi.Float([0.0, *(gloss.scale for gloss in glosses)])

    def distribution(self, index: mi.UInt32) -> mi.MicrofacetDistribution:
        """Distribution of the visible normals of lobe ``index``."""
        return mi.MicrofacetDistribution(mi.MicrofacetType.GGX, dr.gather(mi.Float, self._alpha, index), True)

    def fresnel(self, index: mi.UInt32, cosine: mi.Float) -> mi.Float:
        """Fresnel reflectance of a dielectric at the cosine to the half vector, times the scale of the lobe.

        Not Schlick's, which at 50 degrees, where floors are looked at, is a fifth too small for glass and lacquer.
        """
        reflectance, *_ = mi.fresnel(dr.clip(cosine, 0.0, 1.0), dr.gather(mi.Float, self._ior, index))
        return dr.gather(mi.Float, self._scale, index) * reflectance


class SupportScattering:
    """``f_p`` at support points, and a pdf that mixes its lobes with object-directed sampling.

    Args:
        albedo: recovered albedo.
        normal: unit, world, on the side of ``outgoing``.
        outgoing: unit direction to where the path came from, world.
        lobes: the specular lobes that occur.
        gloss: index of the specular lobe at each point, 0 for none.
        cones: the objects' bounds from each point, or ``None`` without object-directed sampling.
        directed: factor on the share of object-directed samples, 0 to 1.
        specular_scale: factor on the specular lobe per channel.
    """

    def __init__(
        self,
        albedo: mi.Color3f,
        normal: mi.Vector3f,
        outgoing: mi.Vector3f,
        lobes: SpecularLobes,
        gloss: mi.UInt32,
        cones: Cones | None,
        directed: mi.Float,
        specular_scale: mi.Color3f | float = 1.0,
    ) -> None:
        self._albedo, self._frame, self._lobes, self._gloss = albedo, mi.Frame3f(normal), lobes, gloss
        self._outgoing = self._frame.to_local(outgoing)
        self._specular_scale = mi.Color3f(specular_scale)
        self._cones = cones
        self._directed = directed * cones.directed_share if cones is not None else mi.Float(0.0)
        share = dr.select(dr.max(self._albedo) > 0.0, mi.Float(lobes.glossy_share), 1.0)
        self._glossy = dr.select(gloss > 0, share, 0.0) if lobes.any else mi.Float(0.0)

    def sample(self, choice: mi.Float, position: mi.Point2f) -> mi.Vector3f:
        """Draw a unit direction in world space; the arguments are uniform in [0, 1)."""
        choice = mi.Float(choice)
        to_objects = choice < self._directed
        rest = (choice - self._directed) / dr.maximum(1.0 - self._directed, 1e-6)
        local = mi.warp.square_to_cosine_hemisphere(position)
        if self._lobes.any:
            half, _ = self._lobes.distribution(self._gloss).sample(self._outgoing, position)
            local = dr.select(rest < self._glossy, mi.reflect(self._outgoing, half), local)
        direction = self._frame.to_world(local)
        if self._cones is not None:
            toward_objects = self._cones.sample(choice / dr.maximum(self._directed, 1e-6), position)
            direction = dr.select(to_objects, toward_objects, direction)
        return direction

    def may_meet_objects(self, direction: mi.Vector3f) -> mi.Bool:
        """Whether unit directions in world space lead into the objects' bounds."""
        return self._cones.pdf(direction) > 0.0 if self._cones is not None else mi.Bool(True)

    def evaluate(self, direction: mi.Vector3f) -> tuple[mi.Color3f, mi.Float]:
        """``f_p |cos|`` and the pdf of :meth:`sample` per steradian for unit directions in world space."""
        local = self._frame.to_local(direction)
        cosine = local.z
        above = cosine > 0.0
        value = self._albedo * (cosine * dr.inv_pi)
        pdf = cosine * dr.inv_pi
        if self._lobes.any:
            specular, specular_pdf = self._specular(local)
            value += specular * self._specular_scale
            pdf = dr.lerp(pdf, specular_pdf, self._glossy)
        pdf = dr.select(above, pdf, 0.0)
        if self._cones is not None:
            pdf = dr.lerp(pdf, self._cones.pdf(direction), self._directed)
        return value & above, pdf

    def _specular(self, local: mi.Vector3f) -> tuple[mi.Float, mi.Float]:
        distribution = self._lobes.distribution(self._gloss)
        half = dr.normalize(self._outgoing + local)
        cosine_half = dr.dot(half, self._outgoing)
        cosine_outgoing = dr.maximum(self._outgoing.z, 1e-4)
        density = distribution.eval(half)
        value = self._lobes.fresnel(self._gloss, cosine_half) * density * distribution.G(self._outgoing, local, half)
        pdf = distribution.pdf(self._outgoing, half) / dr.maximum(4.0 * cosine_half, 1e-6)
        return value / (4.0 * cosine_outgoing), pdf
