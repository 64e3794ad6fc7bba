"""Highlights of glossy surfaces, moved to where a camera away from the capture point sees them.

The photograph shows what they mirror toward the capture point (theory, eq. 6b). It is taken away, as far as the photograph
shows it, and replaced by what they mirror toward the camera, both with the same random numbers.
"""

from __future__ import annotations

from dataclasses import replace

import cv2
import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.cameras import Viewpoint
from lightdepth.cameras.viewpoint import CameraRays
from lightdepth.kernel.row_bands import Band
from lightdepth.kernel.variables import as_vectors
from lightdepth.parameters import film, recovery
from lightdepth.place.place import Place
from lightdepth.place.real_surfaces import FaceKind
from lightdepth.place.reflectance import reflectance
from lightdepth.place.support_scattering import SpecularLobes
from lightdepth.place.traced_surfaces import RealHit
from lightdepth.recovery.irradiance import estimate_specular

SAME_POINT = 1e-6
"""Metres between a camera and the capture point, up to which it sees what is mirrored there."""


class Highlights:
    """Moves highlights in the plate of one camera.

    Args:
        place: the photographed place, whose glossy surfaces are known.
        points: how many points each pixel is the mean of.
        draft: few samples will do.
        tuned: how many, and how their noise is shared.
    """

    def __init__(
        self, place: Place, points: int, draft: bool = False, tuned: film.FilmParameters = film.DEFAULT
    ) -> None:
        self.place, self.points, self.blur = place, points, tuned.highlight_blur
        self.lobes = SpecularLobes(place.glosses)
        self.widths = [0.0, *(2.0 * gloss.roughness**2 for gloss in place.glosses)]  # Radians, about.
        samples = tuned.draft_highlight_samples if draft else tuned.highlight_samples
        self.parameters = replace(recovery.DEFAULT, lights_per_sample=tuned.highlight_lights)
        self.samples = max(tuned.fewest_highlight_samples, samples // points // 2 * 2)
        self.generator = np.random.default_rng(0)

    @staticmethod
    def move(view: Viewpoint, place: Place) -> bool:
        """Whether any highlight may lie elsewhere for a camera."""
        moved = np.linalg.norm(view.position - place.capture) > SAME_POINT or len(view.topology.charts) > 1
        return bool(place.glosses) and not place.infinite and bool(moved)

    def of_band(self, band: Band) -> BandHighlights:
        """Sums for some rows of the plate."""
        return BandHighlights(self, band.shape)

    def change(self, hit: RealHit, direction: mi.Vector3f, index: mi.UInt32) -> tuple[NDArray, NDArray]:
        """What changes at some of the points that the camera sees.

        Args:
            hit: what all rays meet.
            direction: of these rays, unit, world.
            index: which of them lie on glossy surfaces.

        Returns:
            The change of radiance, shape (n, 3), and which of the points have any, shape (n,).
        """
        place, photograph = self.place, self.place.photograph
        hit = dr.gather(RealHit, hit, index)
        direction = dr.gather(mi.Vector3f, direction, index)
        normal = dr.mulsign(hit.normal, -dr.dot(hit.normal, direction))
        captures, faced = [], mi.Bool(False)
        for each in photograph.each:
            toward_capture = mi.Vector3f(*each.capture.tolist()) - mi.Vector3f(hit.point)
            toward_capture *= dr.rcp(dr.maximum(dr.norm(toward_capture), 1e-20))
            captures.append(toward_capture)
            faced |= dr.dot(normal, toward_capture) > 0.0
        seen, _, radiance = photograph.sight(mi.Vector3f(hit.point), normal)
        seen &= faced
        shares = photograph.surface_shares(hit, direction, seen)
        irradiance, typical = place.surfaces.irradiance(hit, seen), place.surfaces.typical_albedo(hit, seen)
        points, normals = (value.numpy().T for value in (hit.point, normal))
        gloss, state = hit.gloss.numpy().astype(np.uint32), self.generator.bit_generator.state
        mirrored = []
        for outgoing in (*captures, -direction):
            self.generator.bit_generator.state = state
            mirrored.append(
                estimate_specular(
                    place,
                    points,
                    normals,
                    outgoing.numpy().T,
                    self.lobes,
                    gloss,
                    self.generator,
                    self.samples,
                    self.parameters,
                )
            )
        shown = np.sum([share[:, None] * each for share, each in zip(shares, mirrored, strict=False)], axis=0)
        here = mi.Color3f(as_vectors(shown))
        _, scale = reflectance(radiance, irradiance, here, typical, place.parameters)
        change = scale.numpy().T * (mirrored[-1] - shown)
        valid = seen.numpy()
        return np.where(valid[:, None], change, 0.0), valid


class BandHighlights:
    """Sums of the change over points in the pixels of some rows.

    Args:
        highlights: of the camera.
        shape: rows and columns.
    """

    def __init__(self, highlights: Highlights, shape: tuple[int, int]) -> None:
        self._highlights, self._shape = highlights, shape
        self._sum, self._count = np.zeros((shape[0] * shape[1], 3)), np.zeros(shape[0] * shape[1])
        self._wide = np.zeros(shape[0] * shape[1], bool)

    def add(self, hit: RealHit, seen: CameraRays) -> None:
        """Add what changes at points, one in each pixel."""
        glossy = seen.inside & hit.valid & (hit.gloss > 0) & (hit.kind != int(FaceKind.RELIT))
        index = mi.UInt32(dr.compress(glossy))
        if not dr.width(index):
            return
        dr.eval(hit)
        change, valid = self._highlights.change(hit, seen.ray.d, index)
        pixel = index.numpy()
        self._sum[pixel] += change
        self._count[pixel] += valid
        width = dr.gather(mi.Float, mi.Float(self._highlights.widths), dr.gather(mi.UInt32, hit.gloss, index))
        self._wide[pixel] = (
            width > self._highlights.blur * dr.sqrt(dr.gather(mi.Float, seen.solid_angle, index))
        ).numpy()

    def change(self) -> NDArray[np.float32]:
        """The change of each pixel's radiance, shape (rows, columns, 3)."""
        total = self._sum.reshape(*self._shape, 3).astype(np.float32)
        share = self._count.reshape(self._shape).astype(np.float32)
        size = (self._highlights.blur, self._highlights.blur)
        # Within the surface: neighbours that lie beside it have nothing to share.
        mean = cv2.blur(total, size) / np.maximum(cv2.blur(share, size), 1e-6)[..., None] * share[..., None]
        change = np.where(self._wide.reshape(self._shape)[..., None], mean, total)
        return np.asarray(change / self._highlights.points, dtype=np.float32)
