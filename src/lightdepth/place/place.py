"""The real place before insertion: its surfaces, and its lights behind one interface.

Equations: docs/theory.md, sections 1 and 2. The photograph is the first of its lights; declared ones, which the photograph
does not show, are further ones.
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

from lightdepth.kernel.tracing import meets
from lightdepth.parameters.place import DEFAULT, PlaceParameters
from lightdepth.place.declared_lights import declared_light
from lightdepth.place.light_list import LightList, LightSample
from lightdepth.place.photograph import Photograph
from lightdepth.place.photographed import Photographed
from lightdepth.place.photographs import Photographs
from lightdepth.place.real_light import RealLight
from lightdepth.place.seen_plate import SeenPlate
from lightdepth.place.traced_surfaces import RealHit, TracedSurfaces
from lightdepth.scene.model import Gloss, Light, Panorama


class Place:
    """The photographed place.

    Args:
        panoramas: the photograph and its pose; a sequence where there are several.
        surfaces: the real surfaces to trace.
        infinite: take every depth as infinite: the directional method.
        alone: light sampling is the only technique, so that it must cover all of the map (no MIS compensation).
        declared: the lights that the photograph lacks.
        gains: of each photograph, per channel, shape (k, 3); ``None`` is 1.
        parameters: how it is made of its photographs, and how often its lights are sampled.

    Attributes:
        photograph: what was photographed: one panorama, or several as one.
        lights: all lights, the photograph first.
        declared: those of ``lights`` that the photograph lacks.
        shares: of the light samples for irradiance, for each of ``lights``.
        path_shares: of the light paths, for each of ``lights``.
        glosses: the specular lobes of its surfaces, once what they mirror is known.
        plate: the photograph of an ordinary camera, which is the picture but not the light; ``None`` without one.
    """

    def __init__(
        self,
        panoramas: Panorama | Sequence[Panorama],
        surfaces: TracedSurfaces,
        infinite: bool = False,
        alone: bool = False,
        declared: Sequence[Light] = (),
        gains: NDArray[np.float32] | None = None,
        parameters: PlaceParameters = DEFAULT,
    ) -> None:
        self.parameters = parameters
        self.surfaces = surfaces
        self.infinite = infinite
        self.photograph = _photographed(panoramas, surfaces, infinite, alone, gains, parameters)
        self.declared = tuple(declared_light(light, surfaces, parameters) for light in declared)
        self.glosses: tuple[Gloss, ...] = ()
        self.plate: SeenPlate | None = None
        share = min(parameters.sun_light_share, parameters.most_suns_light_share / max(len(self.declared), 1))
        self.shares = (1.0 - share * len(self.declared), *(share for _ in self.declared))
        # Light that hardly stands out is left to camera paths, in the light of suns too. As in the power heuristic the
        # stronger one gets more than its share: few paths that carry much light are fireflies.
        map_worth, suns_worth = self.standing_out**2, (1.0 - self.standing_out) ** 2
        path_share = max(suns_worth / (map_worth + suns_worth), parameters.least_path_share) / max(
            len(self.declared), 1
        )
        self.path_shares = (1.0 - path_share * len(self.declared), *(path_share for _ in self.declared))

    @property
    def standing_out(self) -> float:
        """Share of the photograph's light above its mean: see :attr:`Photographed.standing_out`."""
        return self.photograph.standing_out

    @property
    def lights(self) -> tuple[RealLight, ...]:
        """All lights, the photograph first."""
        return (self.photograph, *self.declared)

    @property
    def capture(self) -> NDArray[np.float64]:
        """The capture point of the first photograph, shape (3,), world, metres."""
        return self.photograph.capture

    def with_surfaces(self, surfaces: TracedSurfaces) -> Place:
        """The same place traced with other meshes of the same surfaces, refined ones for instance."""
        place = copy(self)
        place.surfaces = surfaces
        place.photograph = self.photograph.with_surfaces(surfaces)
        place.declared = tuple(light.with_surfaces(surfaces) for light in self.declared)
        return place

    def with_mirrored(self, images: Sequence[NDArray[np.float32]], glosses: tuple[Gloss, ...]) -> Place:
        """The same place with the radiance that its glossy surfaces mirror: see :meth:`Photographed.with_mirrored`.

        Args:
            images: see there.
            glosses: the specular lobes that mirror it.
        """
        place = copy(self)
        place.glosses = glosses
        place.photograph = self.photograph.with_mirrored(images)
        return place

    def with_plate(self, plate: SeenPlate) -> Place:
        """The same place with a plate, which gives the albedo of the support that it shows."""
        place = copy(self)
        place.plate = plate
        return place

    # -- Sampling its light -------------------------------------------------------------------------------------

    def presample_lights(self, generator: np.random.Generator, count: int) -> LightList:
        """Draw a list of light samples of the photograph.

        All vertices of a pass share them, so that tracing them is paid once and not at every vertex.

        Args:
            generator: source of randomness.
            count: how many.
        """
        return LightList(self.photograph.presample(generator, count), count)

    def sample_light(self, lights: LightList, u: mi.Float, v: mi.Float, shares: Sequence[float]) -> LightSample:
        """Light samples of all lights by their shares, which their densities include.

        Args:
            lights: those of the photograph.
            u: uniform random numbers in [0, 1) that pick light and sample; evenly spaced ones are stratified over both.
            v: further ones, for declared lights.
            shares: of each of ``lights`` of the place; they sum to one.
        """
        if not self.declared:
            return lights.sample(u, mi.Bool(True))
        begin = shares[0]
        light = lights.sample(u / max(begin, 1e-9), u < begin)
        light.density *= begin
        for index, (declared, share) in enumerate(zip(self.declared, shares[1:], strict=True), 1):
            sample = declared.sample(dr.clip((u - begin) / share, 0.0, 1.0), v)
            sample.density *= share
            sample.light = mi.UInt32(index)
            light = dr.select(u < begin, light, sample)
            begin += share
        return light

    def toward(self, light: LightSample, point: mi.Point3f) -> tuple[mi.Vector3f, mi.Float, mi.Float]:
        """Direction, distance and density of light samples as seen from points.

        Args:
            light: the samples.
            point: world, metres.

        Returns:
            ``(unit direction, distance in metres or inf, density per steradian at the point)``: eq. (8).
        """
        offset = light.position - mi.Vector3f(point)
        squared = dr.squared_norm(offset)
        reciprocal = dr.rsqrt(dr.maximum(squared, 1e-36))
        direction = dr.select(light.finite, offset * reciprocal, light.position)
        cosine = dr.maximum(dr.abs(dr.dot(light.normal, direction)), 1e-6)
        pdf = dr.select(light.finite, light.density * squared / cosine, light.density)
        pdf = dr.select(self.leaves(light, -direction), pdf, 0.0) if self.photograph.one_sided else pdf
        return direction, dr.select(light.finite, squared * reciprocal, dr.inf), pdf

    def leaves(self, light: LightSample, direction: mi.Vector3f) -> mi.Bool:
        """Whether light leaves the samples in unit directions, world: some know one side of their surface only."""
        if not self.photograph.one_sided:
            return mi.Bool(True)
        return ~light.finite | (dr.dot(light.normal, direction) > 0.0)

    def transmittance(self, light: LightSample, point: mi.Point3f) -> mi.Color3f | float:
        """Share of light samples that the masks of declared lights let through to points."""
        if not any(declared.has_mask for declared in self.declared):
            return 1.0
        result = mi.Color3f(1.0)
        for index, declared in enumerate(self.declared, 1):
            result = dr.select(light.light == index, declared.transmittance(point), result)
        return result

    def unblocked(self, light: LightSample, ray: mi.Ray3f, active: mi.Bool, kept: bool = False) -> mi.Bool:
        """Which shadow rays meet no real surface; those toward lights that pass openings pass them as well.

        Args:
            light: the samples that the rays run to.
            ray: from a surface, up to just before the light.
            active: which are wanted; false elsewhere.
            kept: only those count that are not removed.
        """
        if not self.surfaces.has_real:
            return active
        passing = [index for index, declared in enumerate(self.declared, 1) if declared.passes_openings]
        through = reduce(operator.or_, (light.light == index for index in passing), mi.Bool(False))
        tested = active & ~through
        if self.infinite:
            tested = tested & light.finite  # The map's light is taken to come past all surfaces.
        free = active & ~meets(self.surfaces.kept if kept else self.surfaces.real, ray, tested)
        if passing:
            blockers = self.surfaces.kept_blockers if kept else self.surfaces.blockers
            free &= ~meets(blockers, ray, active & through)
        return free

    # -- What is seen -------------------------------------------------------------------------------------------

    def arriving(
        self, ray: mi.Ray3f, hit: RealHit, distance: mi.Float, active: mi.Bool, kept: mi.Bool | bool = False
    ) -> list[tuple[mi.Color3f, mi.Float, mi.Bool]]:
        """Radiance of each light along rays: see :meth:`RealLight.arriving`."""
        return [light.arriving(ray, hit, distance, active, kept) for light in self.lights]


def _photographed(
    panoramas: Panorama | Sequence[Panorama],
    surfaces: TracedSurfaces,
    infinite: bool,
    alone: bool,
    gains: NDArray[np.float32] | None,
    parameters: PlaceParameters,
) -> Photographed:
    """A single panorama needs no weighting."""
    several = [panoramas] if isinstance(panoramas, Panorama) else list(panoramas)
    if len(several) == 1 and several[0].mask is None:
        return Photograph(several[0], surfaces, infinite, alone, parameters=parameters)
    return Photographs(several, surfaces, infinite, alone, gains, parameters)
