"""A camera where it stands: the one place that makes the rays of its pixels and finds where its film shows points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from lightdepth.cameras.camera import Camera
from lightdepth.cameras.topology import Topology

if TYPE_CHECKING:
    import mitsuba as mi

INSIDE = 1.0 - 2.0**-9
"""Largest offset in a pixel where films are cut into charts: in single precision it stays below the next pixel, at all
sizes."""


@dataclass
class CameraRays:
    """Rays through the film.

    Attributes:
        ray: world, unit directions.
        inside: false where the film sees nothing (outside a fisheye's circle).
        solid_angle: of the pixel there, steradians.
    """

    ray: mi.Ray3f
    inside: mi.Bool
    solid_angle: mi.Float


@dataclass
class Projection:
    """Where a film shows points.

    Attributes:
        origin: where the rays to them start, world, metres.
        film: positions on the film in [0, 1], x to the right, y down.
        solid_angle: of the pixel there, steradians, as :class:`CameraRays` has it for the same ray.
        weight: what this place of the film stands for; see :class:`~lightdepth.cameras.camera.FilmPoint`.
        inside: false where the film does not show the point.
    """

    origin: mi.Point3f
    film: mi.Point2f
    solid_angle: mi.Float
    weight: mi.Float
    inside: mi.Bool


@dataclass(frozen=True, eq=False)
class Viewpoint:
    """A camera and its pose.

    Attributes:
        camera: its settings; in a loaded scene ``camera.position`` is always filled in.
        position: shape (3,), float64, world, metres.
        rotation: camera space to world, shape (3, 3), float64; the columns are right, forward and up.
    """

    camera: Camera
    position: NDArray[np.float64]
    rotation: NDArray[np.float64]

    @property
    def resolution(self) -> tuple[int, int]:
        """Width and height of the film in pixels."""
        return self.camera.resolution

    @property
    def topology(self) -> Topology:
        """How the pixels of the film lie beside each other."""
        return self.camera.topology

    def same_pixels(self, other: Viewpoint) -> bool:
        """Whether the pixels of another viewpoint show the same directions from the same point."""
        unposed: dict[str, Any] = {"position": None, "rotation": None, "look_at": None}
        one, another = (each.camera.model_dump() | unposed for each in (self, other))
        return (
            one == another
            and np.allclose(self.position, other.position, rtol=0.0, atol=1e-9)
            and np.allclose(self.rotation, other.rotation, rtol=0.0, atol=1e-9)
        )

    def rays(self, film: mi.Point2f, lens: mi.Point2f) -> CameraRays:
        """Rays through positions on the film in [0, 1], x to the right, y down.

        Args:
            film: the positions.
            lens: uniform random numbers in [0, 1) for the aperture; (0.5, 0.5) is its middle.
        """
        import mitsuba as mi

        origin, direction, inside = self.camera.camera_rays(film, lens)
        ray = mi.Ray3f(self._origin + self._to_world @ origin, self._to_world @ direction)
        return CameraRays(ray, inside, self.camera.pixel_angle(direction))

    def pixel_rays(self, column: mi.Float, row: mi.Float, offset: mi.Point2f, lens: mi.Point2f) -> CameraRays:
        """Rays through pixels, at an offset in [0, 1) from their upper left corner; ``lens`` as for :meth:`rays`."""
        import drjit as dr
        import mitsuba as mi

        if len(self.topology.charts) > 1:  # Rounding must not lead from the edge of one chart into another.
            offset = dr.minimum(offset, INSIDE)
        width, height = self.resolution
        return self.rays(mi.Point2f((column + offset.x) / width, (row + offset.y) / height), lens)

    def project(self, point: mi.Point3f, u: mi.Point2f) -> Projection:
        """Where the film shows points, world; :meth:`rays` inverted.

        Args:
            point: the points.
            u: uniform random numbers in [0, 1), which pick a point of the aperture and one of several places of the
                film that show the point.
        """
        import drjit as dr
        import mitsuba as mi

        target = mi.Point3f(self._to_camera @ (point - self._origin))
        seen = self.camera.film_point(target, u)
        angle = self.camera.pixel_angle(dr.normalize(mi.Vector3f(target - seen.origin)))
        return Projection(self._origin + self._to_world @ seen.origin, seen.film, angle, seen.weight, seen.inside)

    def on_film(self, points: Sequence[NDArray[np.float32]]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Where points appear through the middle of the lens, for NumPy code.

        Args:
            points: their coordinates in world, metres, three arrays of shape (n,), aligned.

        Returns:
            Film coordinates, shape (n, 2), and whether the points are in the picture, shape (n,).
        """
        import mitsuba as mi

        seen, count = self.project(mi.Point3f(*map(mi.Float, points)), mi.Point2f(0.5)), len(points[0])
        film = np.stack([np.broadcast_to(axis.numpy(), count) for axis in (seen.film.x, seen.film.y)], axis=1)
        return film.astype(np.float64), np.broadcast_to(seen.inside.numpy(), count).astype(bool)

    def sight_lines(
        self, film: Sequence[NDArray[np.float32]]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
        """Rays through the middle of the lens, for NumPy code: :meth:`on_film` inverted.

        Args:
            film: film coordinates, x to the right, y down, two arrays of shape (n,), aligned.

        Returns:
            Origins in world, metres, and unit directions, shapes (n, 3); and whether the film has a picture there,
            shape (n,).
        """
        import mitsuba as mi

        seen, count = self.rays(mi.Point2f(*map(mi.Float, film)), mi.Point2f(0.5)), len(film[0])
        origins, directions = (
            np.broadcast_to(each.numpy().T, (count, 3)).astype(np.float64) for each in (seen.ray.o, seen.ray.d)
        )
        return origins, directions, np.broadcast_to(seen.inside.numpy(), count).astype(bool)

    # Variables of the device: a pose that changes compiles no kernel.

    @cached_property
    def _origin(self) -> mi.Point3f:
        import drjit as dr
        import mitsuba as mi

        result = mi.Point3f([float(value) for value in self.position])
        dr.make_opaque(result)
        return result

    @cached_property
    def _to_world(self) -> mi.Matrix3f:
        return _matrix(self.rotation)

    @cached_property
    def _to_camera(self) -> mi.Matrix3f:
        return _matrix(self.rotation.T)

    def __reduce__(self) -> tuple[type[Viewpoint], tuple[Camera, NDArray[np.float64], NDArray[np.float64]]]:
        """Copies and pickles hold no variables of the device."""
        return Viewpoint, (self.camera, self.position, self.rotation)


def _matrix(values: NDArray[np.float64]) -> mi.Matrix3f:
    import drjit as dr
    import mitsuba as mi

    result = mi.Matrix3f(np.asarray(values, dtype=np.float32))
    dr.make_opaque(result)
    return result
