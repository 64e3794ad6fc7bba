"""The light that the photograph explains: irradiance at what its pixels show."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lightdepth.directions import FloatArray
from lightdepth.parameters.place import DEFAULT, PlaceParameters
from lightdepth.scene.model import Light, Panorama, RealSurface, Scene


class ExplainedLight:
    """Irradiance from the light-depth map, and from lights that are known already.

    Args:
        panorama: the photograph.
        real: the real surfaces.
        seed: of the random numbers.
        lights: declared ones whose light is explained as well; none by default.
        parameters: what the place is taken to be.
    """

    def __init__(
        self,
        panorama: Panorama,
        real: tuple[RealSurface, ...],
        seed: int = 0,
        lights: Sequence[Light] = (),
        parameters: PlaceParameters = DEFAULT,
    ) -> None:
        from lightdepth.kernel.start import start

        start()
        from lightdepth.place.place import Place
        from lightdepth.place.real_surfaces import merge_real_surfaces
        from lightdepth.place.traced_surfaces import TracedSurfaces

        surfaces = TracedSurfaces(merge_real_surfaces(real))
        self._place = Place(panorama, surfaces, declared=lights, parameters=parameters)
        self._seed = seed

    @classmethod
    def of(cls, scene: Scene, panorama: Panorama | None = None, lights: Sequence[Light] = ()) -> ExplainedLight:
        """The light in a scene's place, with its seed and parameters.

        Args:
            scene: the place.
            panorama: whose light it is; the scene's by default.
            lights: declared ones whose light is explained as well.
        """
        photograph = scene.panorama if panorama is None else panorama
        return cls(photograph, scene.real, scene.render.seed, lights, scene.render.parameters.place)

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
