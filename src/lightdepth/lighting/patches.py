"""Where the user says that the sun shines: clicked outlines and points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from lightdepth.calibration.clicks import read_clicks
from lightdepth.directions import FloatArray, direction_to_latlong, latlong_to_direction
from lightdepth.errors import InputError
from lightdepth.lighting.panorama_view import PanoramaView


@dataclass(frozen=True)
class Clicks:
    """What the user clicked.

    Attributes:
        polygons: outlines of patches of sun in light space, unit vectors, shape (k, 3) each, k >= 3.
        points: places that the sun lights, world, metres, shape (n, 3).
        normals: of the surfaces there, toward the capture point, shape (n, 3).
    """

    polygons: tuple[FloatArray, ...] = ()
    points: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))
    normals: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))

    def inside(self, view: PanoramaView, pixels: FloatArray) -> NDArray[np.bool_]:
        """Which places in the panorama, shape (n, 2), lie inside one of the outlines."""
        result = np.zeros(len(pixels), dtype=bool)
        for polygon in self.polygons:
            result |= inside(view, polygon, pixels)
        return result


def inside(view: PanoramaView, polygon: FloatArray, pixels: FloatArray) -> NDArray[np.bool_]:
    """Which places in the panorama, shape (n, 2), lie inside an outline whose sides are straight in the world."""
    middle = polygon.mean(axis=0)
    middle /= np.linalg.norm(middle)
    right = np.cross(middle, [0.0, 0.0, 1.0] if abs(middle[2]) < 0.9 else [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    axes = np.stack([right, np.cross(right, middle), middle])
    corners = polygon @ axes.T
    places = latlong_to_direction(pixels[:, 0] / view.width, pixels[:, 1] / view.height) @ axes.T
    ahead = places[:, 2] > 1e-3
    flat = places[:, :2] / np.where(ahead, places[:, 2], 1.0)[:, None]
    outline = corners[:, :2] / corners[:, 2:]
    crossings = np.zeros(len(pixels), dtype=int)
    for (x0, y0), (x1, y1) in zip(outline, np.roll(outline, -1, axis=0), strict=True):
        spans = (y0 > flat[:, 1]) != (y1 > flat[:, 1])
        at = x0 + (flat[:, 1] - y0) * (x1 - x0) / (y1 - y0 if y1 != y0 else 1.0)
        crossings += spans & (flat[:, 0] < at)
    return ahead & (crossings % 2 == 1)


def read_patches(texts: Sequence[str], view: PanoramaView, size: tuple[int, int]) -> Clicks:
    """Read patches of sun: three clicks or more outline one, one or two are places in the sun.

    Args:
        texts: ``"x,y x,y ..."`` in the panorama's pixels.
        view: the photograph.
        size: height and width of the panorama in pixels.

    Raises:
        InputError: something that is no click, a click beside the panorama or where no surface is, or an outline
            that goes around more than half of the panorama.
    """
    polygons: list[FloatArray] = []
    points, normals = [np.zeros((0, 3))], [np.zeros((0, 3))]
    for number, text in enumerate(texts, start=1):
        clicks = read_clicks(text, size, "--patch")
        if not len(clicks):
            raise InputError(f"--patch: patch {number} is empty; write its corners as x,y x,y ...")
        u, v = direction_to_latlong(clicks)
        seen = view.look(np.stack([u * view.width, v * view.height], axis=-1))
        nowhere = np.flatnonzero((seen.surface < 0) | view.opening[seen.surface])
        if len(nowhere):
            raise InputError(
                f"--patch: point {nowhere[0] + 1} of patch {number} lies on no real surface that the sun can light; "
                f"the scene has {', '.join(view.names)}"
            )
        if len(clicks) < 3:
            points.append(seen.point)
            normals.append(seen.normal)
            continue
        middle = clicks.mean(axis=0)
        if np.any(clicks @ middle <= 1e-3):
            raise InputError(f"--patch: patch {number} goes around more than half of the panorama; click smaller ones")
        polygons.append(clicks)
    return Clicks(tuple(polygons), np.concatenate(points), np.concatenate(normals))
