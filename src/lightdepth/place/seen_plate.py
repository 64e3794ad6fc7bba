"""The photograph of an ordinary camera in the place: what it shows of the real surfaces.

Equations: docs/theory.md, section 10. It lights nothing; where it shows support, the albedo is recovered from it.
"""

from __future__ import annotations

import cv2
import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter

from lightdepth.cameras import Viewpoint
from lightdepth.kernel.arrays import aligned_empty
from lightdepth.kernel.row_bands import bands
from lightdepth.parameters.place import DEFAULT, PlaceParameters
from lightdepth.place.real_surfaces import FaceKind
from lightdepth.place.traced_surfaces import RealHit, TracedSurfaces


class SeenPlate:
    """A plate and the camera that took it.

    Args:
        radiance: of the plate, shape (height, width, 3), float32.
        view: its camera.
        gain: of each channel, what the plate shows over what the panoramas show, shape (3,), float32.
        surfaces: the real surfaces to trace.
        mirrored: radiance that glossy surfaces mirror toward the camera (eq. 6b), in the unit of the panoramas, over the
            whole picture but with fewer pixels, shape (h, w, 3), float32; ``None`` leaves glossy surfaces to the panoramas.
        parameters: which points it is taken to show.

    Attributes:
        radiance: as given.
        view: as given.
        gain: as given.
        scaled: the radiance in the unit of the panoramas, shape (height, width, 3), float32.
    """

    def __init__(
        self,
        radiance: NDArray[np.float32],
        view: Viewpoint,
        gain: NDArray[np.float32],
        surfaces: TracedSurfaces,
        mirrored: NDArray[np.float32] | None = None,
        parameters: PlaceParameters = DEFAULT,
    ) -> None:
        self.radiance, self.view, self.gain = radiance, view, gain
        self.scaled = radiance / gain
        width, height = view.resolution
        padded = aligned_empty((height * width, 4))
        padded[:, :3], padded[:, 3] = (
            self.scaled.reshape(-1, 3),
            self._distances(surfaces, parameters.removed_rim).reshape(-1),
        )
        self._pixels = mi.Float(padded.reshape(-1))
        self._mirrored: mi.Float | None = None
        if mirrored is not None:
            finer = aligned_empty((height * width, 4))
            # Exactly to the picture's pixels, and smooth between those of the coarser image.
            finer[:, :3] = cv2.resize(mirrored, (width, height), interpolation=cv2.INTER_LINEAR).reshape(-1, 3)
            finer[:, 3] = 0.0
            self._mirrored = mi.Float(finer.reshape(-1))
        self._size = dr.opaque(mi.UInt32, width), dr.opaque(mi.UInt32, height)
        view.project(mi.Point3f(0.0), mi.Point2f(0.5))  # Makes the pose's variables, which must not happen in a loop.
        pixel_angle = float(np.radians(1.0 / view.camera.pixels_per_degree()))
        self._off_plane = parameters.seen_depth + parameters.off_plane * pixel_angle

    def _distances(self, surfaces: TracedSurfaces, rim: int) -> NDArray[np.float32]:
        """From the camera to what the pixels' centres see, metres, inf for sky, shape (height, width).

        It is 0 where pixels show what is removed, or lie beside such: they tell nothing of what is behind it.
        """
        width, height = self.view.resolution
        distances = np.empty((height, width), np.float32)
        removed = np.zeros((height, width), bool)
        for band in bands(width, height):
            seen = self.view.pixel_rays(band.column, band.row, mi.Point2f(0.5), mi.Point2f(0.5))
            hit = surfaces.first_real(seen.ray, seen.inside, coherent=True)
            distances[band.rows] = dr.select(hit.valid, hit.distance, dr.inf).numpy().reshape(band.shape)
            if surfaces.has_removed:
                removed[band.rows] = (hit.kind == int(FaceKind.REMOVED)).numpy().reshape(band.shape)
        if removed.any():
            distances[maximum_filter(removed, 2 * rim + 1)] = 0.0
        return distances

    def over(
        self, photographed: mi.Color3f, mirrored: mi.Color3f, hit: RealHit, direction: mi.Vector3f, active: mi.Bool
    ) -> tuple[mi.Color3f, mi.Color3f]:
        """What the plate shows of points of real surfaces, in the unit of the panoramas; else what these show.

        It is the very pixel, so that what a camera ray meets has the albedo that its own pixel shows. Relit surfaces, which
        moved, are left to the panoramas.

        Args:
            photographed: what the panoramas show there.
            mirrored: what of it the points mirror.
            hit: the points.
            direction: of view toward them, unit, world.
            active: lanes to evaluate.

        Returns:
            Radiance, and what of it is mirrored, toward whichever camera showed it.
        """
        projection = self.view.project(hit.point, mi.Point2f(0.5))
        width, height = self._size
        column = dr.minimum(mi.UInt32(dr.maximum(projection.film.x, 0.0) * mi.Float(width)), width - 1)
        row = dr.minimum(mi.UInt32(dr.maximum(projection.film.y, 0.0) * mi.Float(height)), height - 1)
        wanted = active & projection.inside & (hit.kind != int(FaceKind.RELIT))
        if self._mirrored is None:
            wanted &= hit.gloss == 0
        pixel = dr.gather(mi.Vector4f, self._pixels, row * width + column, wanted)
        offset = mi.Vector3f(hit.point - projection.origin)
        distance = dr.norm(offset)
        height_above = dr.dot(hit.normal, offset)
        # By the distance from the surface's plane: at grazing angles, depth varies within a pixel.
        beside = dr.abs(distance - pixel.w) * dr.abs(height_above) * dr.rcp(dr.maximum(distance, 1e-20))
        shows = wanted & (pixel.w > 0.0) & (beside <= self._off_plane * distance)
        shows &= height_above * dr.dot(hit.normal, direction) > 0.0
        radiance = dr.select(shows, dr.maximum(mi.Color3f(pixel.x, pixel.y, pixel.z), 0.0), photographed)
        if self._mirrored is None:
            return radiance, mirrored
        glossy = shows & (hit.gloss > 0)
        here = dr.gather(mi.Vector4f, self._mirrored, row * width + column, glossy)
        return radiance, dr.select(glossy, mi.Color3f(here.x, here.y, here.z), mirrored)
