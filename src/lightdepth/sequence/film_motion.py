"""How far things move on the film while the shutter is open, and how many instants show that smoothly."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from lightdepth.cameras import Viewpoint
from lightdepth.kernel.arrays import aligned_columns
from lightdepth.kernel.start import DEVICE_LOCK
from lightdepth.scene.model import AnalyticShape, CameraView, Mesh, Scene, SyntheticPart

SIDES = np.array([[x, y, z] for x in (-1.0, 1.0) for y in (-1.0, 1.0) for z in (-1.0, 1.0)])

HEIGHTS = {"rectangle": (0.0, 0.0), "disk": (0.0, 0.0), "cylinder": (0.0, 1.0)}
"""Lowest and highest z of unit shapes; others are from -1 to 1."""


def needed_instants(scenes: Sequence[Scene], views: Sequence[CameraView], most: int) -> int:
    """How many instants a frame needs.

    Args:
        scenes: the scene where the shutter opens, in the middle, and where it closes; the middle one's parameters count.
        views: the camera then.
        most: that are allowed.
    """
    tuned = scenes[len(scenes) // 2].render.parameters.motion_blur
    with DEVICE_LOCK:
        way = max((_way(points, views) for points in _followed(scenes, tuned.points)), default=0.0)
        if any(view is not views[0] for view in views):
            real = [_spread(surface.mesh, tuned.points) for surface in scenes[0].real]
            if real:
                some = np.concatenate(real)
                some = some[:: max(1, len(some) // tuned.points)]
                way = max(way, _way([some] * len(views), views, tuned.followed_share))
    return min(max(tuned.fewest_instants, math.ceil(way / tuned.step)), most)


def _followed(scenes: Sequence[Scene], count: int) -> Iterator[list[NDArray[np.float64]]]:
    """Points of each part of the objects, in each scene; those of parts that become others are left out."""
    for things in zip(*(scene.synthetic for scene in scenes), strict=False):
        for parts in zip(*(thing.parts for thing in things), strict=False):
            points = [_points(part, count) for part in parts]
            if len({len(each) for each in points}) == 1:
                yield points


def _points(part: SyntheticPart, count: int) -> NDArray[np.float64]:
    geometry = part.geometry
    if isinstance(geometry, AnalyticShape):
        low, high = HEIGHTS.get(geometry.kind, (-1.0, 1.0))
        corners = np.where(SIDES[:, 2:] < 0.0, [0.0, 0.0, low], [0.0, 0.0, high]) + SIDES * [1.0, 1.0, 0.0]
        return corners @ geometry.to_world[:3, :3].T + geometry.to_world[:3, 3]
    vertices = geometry.vertices
    some = vertices[:: max(1, len(vertices) // count)].astype(np.float64)
    if part.places is None:
        return some
    # One point of each instance, another one of the next.
    places = part.places[:: max(1, len(part.places) // count)]
    some = np.resize(some, (len(places), 3))
    return np.asarray(np.einsum("nij,nj->ni", places[:, :3, :3], some) + places[:, :3, 3])


def _spread(mesh: Mesh, count: int) -> NDArray[np.float64]:
    """Points all over a mesh, about as many on equal areas, shape (count, 3)."""
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    if not areas.sum() > 0.0:
        return mesh.vertices[:1].astype(np.float64)
    rng = np.random.default_rng(0)
    face = rng.choice(len(areas), count, p=areas / areas.sum())
    first, second = np.sqrt(rng.random(count)), rng.random(count)
    weights = np.stack([1.0 - first, first * (1.0 - second), first * second], axis=1)
    return np.asarray(np.einsum("nk,nkd->nd", weights, corners[face]))


def _way(points: Sequence[NDArray[np.float64]], views: Sequence[Viewpoint], share: float = 1.0) -> float:
    """Pixels that the fastest of some points go on the film, those in sight."""
    total, inside = np.zeros(len(points[0])), np.ones(len(points[0]), bool)
    seen = [view.on_film(aligned_columns(part)) for part, view in zip(points, views, strict=True)]
    for (before, seen_before), (after, seen_after) in pairwise(seen):
        size = np.array(views[0].resolution)
        step = np.abs(after - before)
        step = np.minimum(step, 1.0 - np.minimum(step, 1.0))  # A panorama goes on at its other side.
        total += np.linalg.norm(step * size, axis=1)
        inside &= seen_before & seen_after
    return float(np.quantile(total[inside], share)) if inside.any() else 0.0
