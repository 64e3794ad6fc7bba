"""The interface of the lights of the photographed place: rays may hit them, with a known density of their own sampling."""

from __future__ import annotations

from abc import ABC, abstractmethod

import mitsuba as mi

from lightdepth.place.traced_surfaces import RealHit


class RealLight(ABC):
    """A light of the place before insertion. A photograph is one: everything that it shows emits light.

    How its light is sampled is its own: the photograph's from a list that all paths share, a sun's afresh at each point.
    A new kind is a file in this folder and an entry in :attr:`lightdepth.place.place.Place.lights`.
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
            Radiance; the pdf of this light's own sampling per steradian at ``x``; and whether it comes from a
            finite distance.
        """
