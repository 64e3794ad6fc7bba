"""What every light of the photographed place is: something that can be sampled, and that rays may come upon."""

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
        """What this light sends along rays, looking through everything synthetic.

        Args:
            ray: with unit directions ``w``, world.
            hit: ``q(x, w)``, the first real surfaces along them.
            distance: metres from the point ``x``, for which light is sampled, to ``q``.
            active: where it is wanted.

        Returns:
            Radiance; the density per steradian at ``x`` with which :meth:`presample` finds it; and whether it comes from a
            finite distance.
        """
