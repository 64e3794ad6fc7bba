"""What a surface shows, and what lobes of several widths would mirror in it, as the capture point sees them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from lightdepth.directions import FloatArray
from lightdepth.kernel.raycasting import RayCaster
from lightdepth.lighting.panorama_view import PanoramaView
from lightdepth.lightmap.file import LightDepthMap
from lightdepth.reconstruction.lights import strongest_sources
from lightdepth.scene.model import Gloss, Panorama, RealSurface, Scene

ROUGHNESSES = (0.04, 0.08, 0.12, 0.16, 0.2, 0.25, 0.3, 0.35, 0.4, 0.45, 0.5, 0.6, 0.7)
"""Of the lobes whose images are estimated;"""
SPECULARS = (0.0, 0.1, 0.25, 0.5, 1.0, 2.5)
"""their levels. Above 1, which no dielectric reaches, they are there to recognise what is none."""


@dataclass(frozen=True)
class MirrorImages:
    """Cells of the panorama that show one surface.

    Attributes:
        row: of each cell in the grid of cells, shape (n,).
        column: likewise; the grid is ``columns`` wide and goes around.
        columns: see there.
        size: pixels of the view along a cell's side.
        shown: M, mean over the cell, shape (n, 3).
        irradiance: E at its middle, shape (n, 3).
        lobes: what a lobe mirrors to the capture point, for each of ``ROUGHNESSES`` and ``SPECULARS``, shape (k, l, n, 3).
        source: index of the bright source that is mirrored there or near it, -1 for none, shape (n,).
        directions: of the bright sources, from the capture point, unit, world, shape (s, 3).
    """

    row: NDArray[np.int64]
    column: NDArray[np.int64]
    columns: int
    size: int
    shown: FloatArray
    irradiance: FloatArray
    lobes: NDArray[np.float32]
    source: NDArray[np.int64]
    directions: FloatArray

    def mirrored(self, roughness: float, specular: float) -> FloatArray:
        """Radiance that a lobe mirrors to the capture point, shape (n, 3); interpolated between those of ``lobes``."""
        (i, j), (u, v) = zip(_between(ROUGHNESSES, roughness), _between(SPECULARS, specular), strict=True)
        (a, b), (c, d) = self.lobes[i : i + 2, j : j + 2]
        return np.asarray((1.0 - u) * ((1.0 - v) * a + v * b) + u * ((1.0 - v) * c + v * d), dtype=np.float64)


def _between(steps: Sequence[float], value: float) -> tuple[int, float]:
    """The step below a value, and how far it is on the way to the next one."""
    at = float(np.interp(value, steps, np.arange(len(steps))))
    lower = min(int(at), len(steps) - 2)
    return lower, at - lower


class Mirror:
    """Estimates mirror images in the surfaces of a scene.

    Args:
        scene: the place; gloss that it declares plays no part.
        view: its photograph.
    """

    def __init__(self, scene: Scene, view: PanoramaView) -> None:
        from lightdepth.kernel.start import start

        start()
        from lightdepth.place.place import Place
        from lightdepth.place.real_surfaces import merge_real_surfaces
        from lightdepth.place.traced_surfaces import TracedSurfaces

        real = tuple(replace(surface, gloss=None) for surface in scene.real)
        self._place = Place(
            scene.panorama,
            TracedSurfaces(merge_real_surfaces(real)),
            declared=scene.lights,
            parameters=scene.render.parameters.place,
        )
        self._seed, self._view, self._tuned = scene.render.seed, view, view.tuned
        self._caster = RayCaster([surface.mesh for surface in real])
        self._surface = view.look(view.centers()).surface.reshape(view.height, view.width)
        self._sources, self.directions = _bright_sources(scene.panorama, real, view)

    def images(self, index: int) -> MirrorImages:
        """The mirror images in one surface, by its index in the scene; without a cell where it is not seen."""
        view = self._view
        here = self._surface == index
        size = int(
            np.clip(
                np.ceil(np.sqrt(np.count_nonzero(here) / self._tuned.mirror_cells)), 1, self._tuned.mirror_largest_cell
            )
        )
        rows, columns = view.height // size, view.width // size
        whole = here[: rows * size, : columns * size].reshape(rows, size, columns, size).all(axis=(1, 3))
        row, column = np.nonzero(whole)
        middles = np.asarray((np.stack([column, row], axis=-1) + 0.5) * size, dtype=np.float64)
        seen = view.look(middles)
        toward = view.position - seen.point
        toward /= np.linalg.norm(toward, axis=1, keepdims=True)
        usable = (seen.surface == index) & (np.einsum("nk,nk->n", seen.normal, toward) > self._tuned.mirror_steepest)
        row, column, middles, toward = row[usable], column[usable], middles[usable], toward[usable]
        points, normals = seen.point[usable], seen.normal[usable]
        shown = view.radiance[: rows * size, : columns * size].reshape(rows, size, columns, size, 3)
        return MirrorImages(
            row,
            column,
            columns,
            size,
            shown.mean(axis=(1, 3), dtype=np.float64)[row, column],
            self._irradiance(points, normals),
            self._lobes(middles, size),
            self._source(points, normals, toward),
            self.directions,
        )

    def _lobes(self, middles: FloatArray, size: int) -> NDArray[np.float32]:
        """What lobes of each roughness and each level mirror, shape (k, l, n, 3)."""
        from lightdepth.place.support_scattering import SpecularLobes
        from lightdepth.recovery.irradiance import estimate_mirrored

        steps = (np.arange(self._tuned.mirror_places) + 0.5) / self._tuned.mirror_places - 0.5
        offsets = size * np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
        seen = self._view.look((middles[:, None] + offsets).reshape(-1, 2))
        points, normals = seen.point.astype(np.float32), seen.normal.astype(np.float32)
        results = np.zeros((len(ROUGHNESSES), len(SPECULARS), len(middles), 3), np.float32)
        for i, roughness in enumerate(ROUGHNESSES):
            for j, specular in enumerate(SPECULARS[1:], start=1):
                found = estimate_mirrored(
                    self._place,
                    points,
                    normals,
                    SpecularLobes((Gloss(roughness, specular),)),
                    np.ones(len(points), np.uint32),
                    np.random.default_rng(self._seed),  # The same for all, so that they share their noise.
                    self._tuned.mirror_samples,
                )
                results[i, j] = found.reshape(len(middles), len(offsets), 3).mean(axis=1)
        return results

    def _irradiance(self, points: FloatArray, normals: FloatArray) -> FloatArray:
        from lightdepth.recovery.irradiance import estimate_irradiance

        generator = np.random.default_rng(self._seed)
        found, _ = estimate_irradiance(
            self._place,
            points.astype(np.float32),
            normals.astype(np.float32),
            generator,
            self._tuned.mirror_irradiance_samples,
        )
        return found.astype(np.float64)

    def _source(self, points: FloatArray, normals: FloatArray, toward: FloatArray) -> NDArray[np.int64]:
        """Which bright source mirror-like surfaces would show at points, or beside what they would show."""
        view = self._view
        mirrored = 2.0 * np.einsum("nk,nk->n", normals, toward)[:, None] * normals - toward
        start = points + 1e-4 * normals
        distance = self._caster.cast(start, mirrored).distance.astype(np.float64)
        far = ~np.isfinite(distance)
        met = np.where(far[:, None], view.position + mirrored, start + np.where(far, 0.0, distance)[:, None] * mirrored)
        x, y = view.pixels(met).T
        return np.asarray(
            self._sources[np.clip(y.astype(int), 0, view.height - 1), x.astype(int) % view.width], dtype=np.int64
        )


def _bright_sources(
    panorama: Panorama, real: Sequence[RealSurface], view: PanoramaView
) -> tuple[NDArray[np.int64], FloatArray]:
    """For each pixel of the view the bright source there or nearest to it, -1 for none; and their directions."""
    radiance = _like(panorama.light_radiance, view)
    depth = RayCaster([surface.mesh for surface in real]).cast(view.position, view.directions(view.centers())).distance
    light_map = LightDepthMap(radiance, depth.reshape(view.height, view.width), panorama.position, panorama.rotation)
    found = strongest_sources(light_map, view.tuned.mirror_sources)
    labels = np.full((view.height, view.width), -1, np.int64)
    for index, source in enumerate(found):
        labels[source.pixels] = index
    if not found:
        return labels, np.zeros((0, 3))
    wide = np.concatenate([labels, labels, labels], axis=1)
    away, (row, column) = ndimage.distance_transform_edt(wide < 0, return_indices=True)
    nearest = np.where(away * 180.0 / view.height <= view.tuned.mirror_near, wide[row, column], -1)
    return nearest[:, view.width : 2 * view.width], np.array([source.direction for source in found])


def _like(radiance: NDArray[np.float32], view: PanoramaView) -> NDArray[np.float32]:
    """The panorama's light in pixels as large as the view's."""
    factor = radiance.shape[0] // view.height
    blocks = radiance.reshape(view.height, factor, view.width, factor, 3)
    return np.asarray(blocks.mean(axis=(1, 3), dtype=np.float32))
