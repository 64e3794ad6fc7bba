"""What every integrator is: an estimator along camera rays of what the film adds to the photograph."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from lightdepth.kernel.tracing import TracedSurfaces
from lightdepth.transport.bounds import ObjectBounds
from lightdepth.transport.place import Place
from lightdepth.transport.randoms import Randoms


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


class Integrator(ABC):
    """Base of the methods' integrators.

    Args:
        place: the photographed place.
        surfaces: real and synthetic surfaces.
        bounds: the objects' bounds, or ``None`` without objects; the film asks for them.
        max_bounces: scatterings after which a path ends; negative for no limit.
    """

    def __init__(
        self, place: Place, surfaces: TracedSurfaces, bounds: ObjectBounds | None = None, max_bounces: int = 8
    ) -> None:
        self.place = place
        self.surfaces = surfaces
        self.bounds = bounds
        self.max_bounces = dr.opaque(mi.UInt32, max_bounces if max_bounces >= 0 else 0xFFFFFFFF)
        self.has_emitters = len(surfaces.all.emitters()) > 0

    @abstractmethod
    def sample(self, randoms: Randoms, ray: mi.Ray3f, active: mi.Bool) -> CameraSamples:
        """Follow one path along each camera ray.

        Args:
            randoms: random numbers of the paths; advanced.
            ray: camera rays, world.
            active: rays outside the camera's image are not followed.
        """
