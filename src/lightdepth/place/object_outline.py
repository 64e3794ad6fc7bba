"""The outline of the synthetic objects: which rays come near them, by spheres around small parts of each."""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from weakref import finalize

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.cameras import Viewpoint
from lightdepth.kernel.arrays import aligned
from lightdepth.parameters.transport import DEFAULT, TransportParameters
from lightdepth.place.object_bounds import Sphere


class ObjectOutline:
    """Spheres around parts of the synthetic objects.

    One sphere around a plant or a lamp on a long arm is mostly empty, and all pixels that it covers would be sampled.

    Args:
        parts: a sphere around each shape, and the vertices, shape (n, 3), and faces, shape (m, 3), of meshes, ``None`` of
            others.
        around_instances: centres, shape (n, 3), and radii, shape (n,), of spheres around instances, which are not divided.
        parameters: how many parts there are.
    """

    def __init__(
        self,
        parts: Sequence[tuple[Sphere, tuple[NDArray[np.floating], NDArray[np.unsignedinteger]] | None]],
        around_instances: tuple[NDArray[np.floating], NDArray[np.floating]] = (np.zeros((0, 3)), np.zeros(0)),
        parameters: TransportParameters = DEFAULT,
    ) -> None:
        centres, radii = ([values] for values in around_instances)
        most = parameters.outline_parts // max(len(parts) + len(around_instances[1]), 1)
        for (centre, radius), mesh in parts:
            spheres = np.asarray(centre)[None], np.array([radius])
            if mesh is not None and most > 1 and len(mesh[1]) > parameters.outline_faces:
                spheres = _kept_parts(*mesh, min(most, -(-len(mesh[1]) // parameters.outline_faces)))
            centres.append(spheres[0])
            radii.append(spheres[1])
        self.centres, self.radii = np.concatenate(centres), np.concatenate(radii)
        if len(self.radii) > parameters.outline_parts:
            self.centres, self.radii = _merged(self.centres, self.radii, parameters.outline_parts)
        self._centres, self._radii = mi.Float(aligned(self.centres)), mi.Float(aligned(self.radii))

    def near(self, ray: mi.Ray3f, margin: mi.Float, view: Viewpoint, pixel: mi.Float) -> mi.Bool:
        """Whether any part comes nearer to rays than an angle, or is blurred over it by the lens.

        Args:
            ray: rays with unit directions, world.
            margin: angle in radians.
            view: the camera that they belong to.
            pixel: angle that a pixel covers there, radians; not less.
        """
        blurred, axis = view.camera.has_aperture, mi.Vector3f(*view.rotation[:, 1].tolist())

        def compare(index: mi.UInt32, found: mi.Bool) -> tuple[mi.UInt32, mi.Bool]:
            offset = dr.gather(mi.Vector3f, self._centres, index) - mi.Vector3f(ray.o)
            radius, distance = dr.gather(mi.Float, self._radii, index), dr.norm(offset)
            off_axis = dr.atan2(dr.norm(dr.cross(offset, ray.d)), dr.dot(offset, ray.d))
            reach = margin + dr.asin(dr.clip(radius / dr.maximum(distance, 1e-12), 0.0, 1.0))
            if blurred:
                depth = dr.dot(offset, axis)
                blur = dr.maximum(view.camera.blur(depth - radius), view.camera.blur(depth + radius))
                reach += blur * pixel
            return index + 1, found | (off_axis <= reach) | (distance <= radius)

        count = dr.opaque(mi.UInt32, len(self.radii))
        state = mi.UInt32(0), dr.zeros(mi.Bool, dr.width(ray))
        _, found = dr.while_loop(state, lambda index, found: (index < count) & ~found, compare)
        return found


_kept: dict[tuple[int, int], tuple[NDArray[np.floating], NDArray[np.floating]]] = {}
"""Parts by the array of the vertices that they are of, and by how many they are."""


def _kept_parts(
    vertices: NDArray[np.floating], faces: NDArray[np.unsignedinteger], count: int
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """:func:`_parts`, found once for each array of vertices in memory: most objects stay when one is moved."""
    key = id(vertices), count
    if key not in _kept:
        _kept[key] = _parts(vertices, faces, count)
        finalize(vertices, _kept.pop, key, None)
    return _kept[key]


def _parts(
    vertices: NDArray[np.floating], faces: NDArray[np.unsignedinteger], count: int
) -> tuple[NDArray[np.floating], NDArray[np.floating]]:
    """Centres and radii of ``count`` spheres around neighbouring faces of a mesh."""
    corners = vertices[faces]
    low, high = corners.min(axis=1), corners.max(axis=1)
    groups = _neighbours(0.5 * (low + high), count)
    centres = np.array([0.5 * (low[group].min(axis=0) + high[group].max(axis=0)) for group in groups])
    distances = (corners[group].reshape(-1, 3) - centre for group, centre in zip(groups, centres, strict=True))
    return centres, np.array([np.linalg.norm(each, axis=1).max() for each in distances])


def _merged(
    centres: NDArray[np.float64], radii: NDArray[np.float64], count: int
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Spheres around neighbouring spheres."""
    groups = _neighbours(centres, count)
    low, high = centres - radii[:, None], centres + radii[:, None]
    middle = np.array([0.5 * (low[group].min(axis=0) + high[group].max(axis=0)) for group in groups])
    reaches = (
        np.linalg.norm(centres[group] - own, axis=1) + radii[group] for group, own in zip(groups, middle, strict=True)
    )
    return middle, np.array([each.max() for each in reaches])


def _neighbours(points: NDArray[np.floating], count: int) -> list[NDArray[np.intp]]:
    """Points in at most ``count`` groups, as indices: those that extend farthest are halved until there are that many."""
    everything = np.arange(len(points))
    heap = [(-float(np.ptp(points, axis=0).max()), 0, everything)]
    for number in range(1, count):
        extent, _, group = heap[0]
        if extent == 0.0:
            break
        here = points[group]
        axis = int(np.argmax(np.ptp(here, axis=0)))
        beyond = here[:, axis] > 0.5 * (here[:, axis].min() + here[:, axis].max())
        first, second = group[~beyond], group[beyond]
        heapq.heapreplace(heap, (-float(np.ptp(points[first], axis=0).max()), -number, first))
        heapq.heappush(heap, (-float(np.ptp(points[second], axis=0).max()), number, second))
    return [group for _, _, group in heap]
