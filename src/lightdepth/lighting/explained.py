"""The light that the photograph explains: irradiance at what its pixels show."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lightdepth.directions import FloatArray
from lightdepth.scene.model import Panorama, RealSurface, SunLight


class ExplainedLight:
    """Irradiance from the light-depth map, and from suns that are known already.

    Args:
        panorama: the photograph.
        real: the real surfaces.
        seed: of the random numbers.
        suns: whose light is explained as well; none by default.
    """

    def __init__(
        self, panorama: Panorama, real: tuple[RealSurface, ...], seed: int = 0, suns: Sequence[SunLight] = ()
    ) -> None:
        from lightdepth.kernel.start import start

        start()
        from lightdepth.place.place import Place
        from lightdepth.place.real_surfaces import merge_real_surfaces
        from lightdepth.place.traced_surfaces import TracedSurfaces

        self._place = Place(panorama, TracedSurfaces(merge_real_surfaces(real)), suns=suns)
        self._seed = seed

    def irradiance(self, points: FloatArray, normals: FloatArray, samples: int) -> FloatArray:
        """Irradiance, shape (n, 3), at points on surfaces.

        Args:
            points: world, metres, shape (n, 3).
            normals: unit, on the side that receives, shape (n, 3).
            samples: of each of two techniques at each point, an even number.
        """
        from lightdepth.recovery.irradiance import estimate_irradiance

        if not len(points):
            return np.zeros((0, 3))
        generator = np.random.default_rng(self._seed)
        found, _ = estimate_irradiance(
            self._place, points.astype(np.float32), normals.astype(np.float32), generator, samples
        )
        return found.astype(np.float64)
