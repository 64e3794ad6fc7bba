"""What every light of the photographed place is: it can be sampled, and rays may hit it."""

from __future__ import annotations

from abc import ABC, abstractmethod

import mitsuba as mi
import numpy as np

from lightdepth.place.light_list import LightSample
from lightdepth.place.traced_surfaces import RealHit


class RealLight(ABC):
    """A light of the place before insertion. A photograph is one: all that it shows sends light.

    A new kind is a file in this folder and a line in :func:`lightdepth.place.place.real_lights`.
    """

    @abstractmethod
    def presample(self, generator: np.random.Generator, count: int) -> LightSample:
        """Draw ``count`` light samples; the density of each is that of this light's own sampling."""

    @abstractmethod
    def arriving(
        self, ray: mi.Ray3f, hit: RealHit, distance: mi.Float, active: mi.Bool
    ) -> tuple[mi.Color3f, mi.Float, mi.Bool]:
        """Radiance of this light along rays, looking through everything synthetic.

        Args:
            ray: with unit directions ``w``, world.
            hit: ``q(x, w)``, the first real surfaces along them.
            distance: metres from the point ``x``, for which light is sampled, to ``q``.
            active: where it is wanted.

        Returns:
            Radiance; the pdf of :meth:`presample` per steradian at ``x``; and whether it comes from a
            finite distance.
        """
