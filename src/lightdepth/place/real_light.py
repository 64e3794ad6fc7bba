"""The interface of the lights of the photographed place: rays may hit them, with a known density of their own sampling."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import ClassVar, Self

import mitsuba as mi

from lightdepth.place.light_list import LightSample
from lightdepth.place.traced_surfaces import RealHit, TracedSurfaces


class RealLight(ABC):
    """A light of the place before insertion. A photograph is one: everything that it shows emits light.

    How its light is sampled is its own: the photograph's from a list that all paths share, a declared light's afresh at
    each point, see :class:`DeclaredLight`.
    """

    @abstractmethod
    def arriving(
        self, ray: mi.Ray3f, hit: RealHit, distance: mi.Float, active: mi.Bool, kept: mi.Bool | bool = False
    ) -> tuple[mi.Color3f, mi.Float, mi.Bool]:
        """Radiance of this light along rays, looking through everything synthetic.

        Args:
            ray: with unit directions ``w``, world.
            hit: ``q(x, w)``, the first real surfaces along them.
            distance: metres from the point ``x``, for which light is sampled, to ``q``.
            active: lanes to evaluate.
            kept: for which rays ``hit`` is the first surface that is not removed.

        Returns:
            Radiance; the pdf of this light's own sampling per steradian at ``x``; and whether it comes from ``q``, else
            from infinitely far away.
        """


class DeclaredLight(RealLight):
    """A light that the photograph lacks and the scene declares.

    Integrators know it by these methods alone. A new kind is a file in this folder and a line in
    :data:`lightdepth.place.declared_lights.KINDS`.

    Attributes:
        passes_openings: whether its light comes through surfaces that are openings.
    """

    passes_openings: ClassVar[bool] = False

    @abstractmethod
    def with_surfaces(self, surfaces: TracedSurfaces) -> Self:
        """The same light, blocked by other meshes of the same surfaces."""

    @abstractmethod
    def sample(self, u: mi.Float, v: mi.Float) -> LightSample:
        """Samples of it by uniform random numbers in [0, 1); :class:`~lightdepth.place.place.Place` numbers the light."""

    @abstractmethod
    def blocked(self, ray: mi.Ray3f, active: mi.Bool, kept: bool = False) -> mi.Bool:
        """Whether real surfaces stand in the way of rays that run from a surface up to just before it.

        Args:
            ray: unit directions, world.
            active: which are wanted.
            kept: only those count that are not removed.
        """

    @property
    def has_mask(self) -> bool:
        """Whether something that is not modelled attenuates it: see :meth:`transmittance`."""
        return False

    def transmittance(self, point: mi.Point3f) -> mi.Color3f:
        """Share of its light that what is not modelled lets through to points, world."""
        return mi.Color3f(1.0)

    def may_light(self, point: mi.Point3f) -> mi.Bool:
        """Whether it seems to reach points: where not, it is tested for few of them. Wrong now and then, it may be slow."""
        return mi.Bool(True)
