"""The place as the capture point sees it: what most checks look at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import pixel_directions, pixel_solid_angles
from lightdepth.kernel.raycasting import RayCaster
from lightdepth.parameters.checks import DEFAULT, ChecksParameters
from lightdepth.scene.model import Panorama, Scene


@dataclass(frozen=True)
class CaptureView:
    """Rays from the capture point over a grid of directions of ``tuned.rows`` rows, against the real meshes.

    Attributes:
        position: capture point, world, metres, shape (3,).
        sky: whether what no mesh covers is declared sky.
        caster: of the real meshes.
        names: of the real meshes, as hits number them.
        low: least coordinates of the real meshes, world, metres, shape (3,); inf without meshes.
        high: greatest coordinates of the real meshes, world, metres, shape (3,); -inf without meshes.
        directions: unit, world, shape (h, 2 h, 3).
        distance: metres, inf where nothing is hit, shape (h, 2 h).
        surface: index of the mesh that is hit, -1 for none, shape (h, 2 h).
        from_behind: whether the face is wound away from the capture point, shape (h, 2 h).
        solid_angles: share of the sphere that a pixel of each row covers, shape (h, 1).
        tuned: what is reported of it, and how closely it is looked at.
    """

    position: NDArray[np.float64]
    sky: bool
    caster: RayCaster
    names: tuple[str, ...]
    low: NDArray[np.float32]
    high: NDArray[np.float32]
    directions: NDArray[np.float64]
    distance: NDArray[np.float32]
    surface: NDArray[np.int32]
    from_behind: NDArray[np.bool_]
    solid_angles: NDArray[np.float64]
    tuned: ChecksParameters = DEFAULT

    def share(self, which: NDArray[np.bool_]) -> float:
        """Share of the sphere that the marked pixels of shape (h, 2 h) cover, in [0, 1]."""
        return float(np.sum(which * self.solid_angles))


def look_around(scene: Scene, panorama: Panorama | None = None, tuned: ChecksParameters = DEFAULT) -> CaptureView:
    """Cast the rays from a panorama's capture point, by default the first one's.

    The depth that a user may have given plays no part, only meshes do.

    Args:
        scene: the scene.
        panorama: from where.
        tuned: how fine the grid of directions is; the checks of the view go by it as well.
    """
    panorama = panorama or scene.panorama
    meshes = [surface.mesh for surface in scene.real]
    vertices = np.concatenate([np.zeros((0, 3), np.float32), *(mesh.vertices for mesh in meshes)])
    caster = RayCaster(meshes)
    rows = tuned.rows
    directions = pixel_directions(rows, 2 * rows) @ panorama.rotation.T
    hits = caster.cast(panorama.position, directions.reshape(-1, 3))
    shape = directions.shape[:2]
    away = np.einsum("ij,ij->i", hits.normal, directions.reshape(-1, 3)) > 0.0
    return CaptureView(
        position=panorama.position,
        sky=scene.panorama.sky,
        caster=caster,
        names=tuple(surface.name for surface in scene.real),
        low=vertices.min(axis=0, initial=np.inf),
        high=vertices.max(axis=0, initial=-np.inf),
        directions=directions,
        distance=hits.distance.reshape(shape),
        surface=hits.mesh.reshape(shape),
        from_behind=away.reshape(shape),
        solid_angles=pixel_solid_angles(rows, 2 * rows)[:, None] / (4.0 * np.pi),
        tuned=tuned,
    )


def enclosure(caster: RayCaster, point: NDArray[np.floating], count: int = DEFAULT.enclosure_rays) -> float:
    """Share of directions from a point that meet a real surface: 1 in a closed room, at most one half beside it."""
    return float(np.mean(np.isfinite(caster.cast(point, sphere(count)).distance)))


def sphere(count: int) -> NDArray[np.float64]:
    """Evenly distributed unit vectors, shape (count, 3): the Fibonacci lattice."""
    z = 1.0 - (2.0 * np.arange(count) + 1.0) / count
    phi = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    radius = np.sqrt(1.0 - z * z)
    return np.stack([radius * np.cos(phi), radius * np.sin(phi), z], axis=1)
