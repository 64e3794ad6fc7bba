"""The ordinary camera, with depth of field and the distortion of its lens."""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from lightdepth.cameras.camera import Camera, FilmPoint
from lightdepth.cameras.distortion import RadialDistortion
from lightdepth.quantities import FARTHEST, Coefficient, Coordinates, FilmOffset, Length

if TYPE_CHECKING:
    import mitsuba as mi

NEAR = 0.01
"""Distance in metres at which the projection's depth is 0; it is 1 infinitely far."""


class Perspective(Camera):
    """Thin-lens camera.

    ``fov`` is the horizontal field of view in degrees, without distortion: the focal length is half the width over the
    tangent of half of it. ``look_at`` replaces ``rotation``; ``aperture`` is the lens's radius in metres (0: everything
    is sharp) and ``focus_distance`` the distance of the sharp plane in metres, which defaults to the distance of
    ``look_at``. ``shift`` moves the image by these shares of its width, to the right and up, as a shift lens does;
    ``principal_point``, in shares of width and height from the upper left corner, is the same in photogrammetry's terms.
    ``distortion`` are the coefficients k1 and k2 of
    :class:`~lightdepth.cameras.distortion.RadialDistortion`, around the principal point.
    """

    type: Literal["perspective"]
    height: int = Field(gt=0, le=65536)
    fov: float = Field(default=60.0, gt=0.0, lt=180.0)
    look_at: Coordinates | None = None
    aperture: float = Field(default=0.0, ge=0.0, le=FARTHEST)
    focus_distance: Length | None = None
    shift: FilmOffset = (0.0, 0.0)
    principal_point: FilmOffset | None = None
    distortion: tuple[Coefficient, Coefficient] = (0.0, 0.0)

    @model_validator(mode="after")
    def _one_orientation_and_a_focus(self) -> Perspective:
        if self.look_at is not None and self.rotation is not None:
            raise ValueError("give rotation or look_at, not both")
        if self.aperture > 0.0 and self.focus_distance is None and self.look_at is None:
            raise ValueError("an aperture needs focus_distance or look_at")
        if self.principal_point is not None and self.shift != (0.0, 0.0):
            raise ValueError("give shift or principal_point, not both: they say the same")
        if not self._lens.none and not self._lens.inverts(self._farthest_corner):
            raise ValueError(
                f"distortion {list(self.distortion)} folds the picture over before its corners, which are "
                f"{self._farthest_corner:.3g} focal lengths from the principal point; k1 and k2 multiply the second and "
                "fourth power of that distance"
            )
        return self

    @property
    def resolution(self) -> tuple[int, int]:  # noqa: D102
        return self.width, self.height

    def _sharp_distance(self) -> float:
        """Distance of the plane in focus, metres."""
        if self.focus_distance is not None:
            return self.focus_distance
        if self.look_at is not None and self.position is not None:
            return math.dist(self.look_at, self.position)
        return 1.0

    @property
    def centre(self) -> tuple[float, float]:
        """Principal point in shares of width and height from the upper left corner."""
        if self.principal_point is not None:
            return self.principal_point
        return 0.5 - self.shift[0], 0.5 + self.shift[1] * self.width / self.height

    def without_distortion(self, scale: float = 1.0) -> Perspective:
        """The same camera with a lens that does not distort.

        Args:
            scale: by how much the picture becomes wider and higher, around its middle, at the same focal length.
        """
        width, height = round(self.width * scale), round(self.height * scale)
        x, y = self.centre
        return self.model_copy(
            update={
                "width": width,
                "height": height,
                "fov": math.degrees(2.0 * math.atan(self._half_width() * width / self.width)),
                "shift": (0.0, 0.0),
                "principal_point": (
                    0.5 + (x - 0.5) * self.width / width,
                    0.5 + (y - 0.5) * self.height / height,
                ),
                "distortion": (0.0, 0.0),
            }
        )

    def film_of(self, target: NDArray[Any]) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Where the film shows points through the middle of the lens, on the host.

        Args:
            target: points, or directions, in camera space, shape (..., 3).

        Returns:
            Positions on the film, x to the right, y down, [0, 1] on the picture, shape (..., 2), float64; and whether
            a point is in front of the camera and not beyond where the distortion folds, shape (...).
        """
        across, depth, up = np.moveaxis(np.asarray(target, np.float64), -1, 0)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            x, z = across / depth, up / depth
            squared = x * x + z * z
            scale = self._lens.scale(squared) / (2.0 * self._half_width())
            film = np.stack(
                [self.centre[0] + scale * x, self.centre[1] - scale * z * (self.width / self.height)], axis=-1
            )
        return film, (depth > 0.0) & (squared < self._lens.fold**2)

    def directions_of(self, film: NDArray[Any]) -> NDArray[np.float64]:
        """Directions in camera space through positions on the film: :meth:`film_of` inverted.

        Args:
            film: as :meth:`film_of` gives them, shape (..., 2), not much outside of the picture.

        Returns:
            Vectors of y = 1, shape (..., 3), float64.
        """
        film = np.asarray(film, np.float64)
        x = 2.0 * self._half_width() * (film[..., 0] - self.centre[0])
        z = 2.0 * self._half_width() * (self.centre[1] - film[..., 1]) * (self.height / self.width)
        radius = np.hypot(x, z)
        undistorted = self._lens.undistorted(np.minimum(radius, self._lens.farthest))
        scale = np.where(radius > 0.0, undistorted / np.maximum(radius, 1e-20), 1.0)
        return np.stack([x * scale, np.ones_like(x), z * scale], axis=-1)

    def camera_rays(self, film: mi.Point2f, lens: mi.Point2f) -> tuple[mi.Point3f, mi.Vector3f, mi.Bool]:  # noqa: D102
        import drjit as dr
        import mitsuba as mi

        half_width = 2.0 * self._half_width()
        x = half_width * (film.x - self.centre[0])
        z = half_width * (self.centre[1] - film.y) * (self.height / self.width)
        if not self._lens.none:
            radius = dr.sqrt(x * x + z * z)
            # What lies outside of the picture by rounding, or by a filter's reach, must not run away.
            within = dr.minimum(radius, self._lens.farthest)
            scale = dr.select(
                radius > 0.0, self._lens.undistorted(within, self._steps) / dr.maximum(radius, 1e-20), 1.0
            )
            x, z = x * scale, z * scale
        direction = mi.Vector3f(x, 1.0, z)
        if self.aperture == 0.0:
            return mi.Point3f(0.0), dr.normalize(direction), mi.Bool(True)
        origin = self._lens_point(lens)
        return origin, dr.normalize(self._sharp_distance() * direction - origin), mi.Bool(True)

    def film_point(self, target: mi.Point3f, lens: mi.Point2f) -> FilmPoint:  # noqa: D102
        import drjit as dr
        import mitsuba as mi

        origin, sharp_distance = self._lens_point(lens), self._sharp_distance()
        # Where the ray crosses the plane in focus, relative to its distance.
        through = origin + (target - origin) * (sharp_distance / dr.maximum(target.y, 1e-20))
        x, z = through.x / sharp_distance, through.z / sharp_distance
        inside, weight = target.y > 0.0, mi.Float(1.0)
        if not self._lens.none:
            squared = x * x + z * z
            inside &= squared < self._largest_square
            squared = dr.minimum(squared, self._largest_square)
            scale = self._lens.scale(squared)
            x, z = x * scale, z * scale
            if self.has_aperture:
                # The solid angle is known for the ray's direction; through the rim of the lens the distortion is that of
                # another place of the picture.
                direction = dr.normalize(mi.Vector3f(target - origin))
                weight = scale * self._lens.slope(squared) / self._stretch(direction)
        half_width = 2.0 * self._half_width()
        film = mi.Point2f(self.centre[0] + x / half_width, self.centre[1] - z / half_width * (self.width / self.height))
        inside = inside & (film.x >= 0.0) & (film.x < 1.0) & (film.y >= 0.0) & (film.y < 1.0)
        return FilmPoint(origin, film, inside, weight)

    def solid_angle(self, direction: mi.Vector3f) -> mi.Float:  # noqa: D102
        import drjit as dr

        cosine = dr.maximum(direction.y, 0.0)
        area = 4.0 * self._half_width() ** 2 * (self.height / self.width)
        angle = area * cosine * dr.square(cosine)
        return angle if self._lens.none else angle / self._stretch(direction)

    def _stretch(self, direction: mi.Vector3f) -> mi.Float:
        """How many times larger the distortion makes areas of the picture, around directions."""
        import drjit as dr

        squared = (dr.square(direction.x) + dr.square(direction.z)) / dr.square(dr.maximum(direction.y, 1e-6))
        squared = dr.minimum(squared, self._largest_square)
        return self._lens.scale(squared) * self._lens.slope(squared)

    def projection_matrix(self) -> NDArray[np.float64]:
        """As for any camera; of a lens that distorts, the matrix of the picture without its distortion."""
        across = 0.5 / self._half_width()
        aspect = self.width / self.height
        return np.array(
            [
                [across, 0.0, 0.0, 0.0],
                [0.0, -across * aspect, 0.0, 0.0],
                [*self.centre, 1.0, 1.0],
                [0.0, 0.0, -NEAR, 0.0],
            ]
        )

    @property
    def has_aperture(self) -> bool:  # noqa: D102
        return self.aperture > 0.0

    def blur(self, depth: mi.Float) -> mi.Float:  # noqa: D102
        import drjit as dr

        pixels = 0.5 * self.width / self._half_width()
        nearness = dr.rcp(dr.maximum(depth, 1e-3))
        return self.aperture * pixels * dr.abs(nearness - 1.0 / self._sharp_distance())

    @property
    def _lens(self) -> RadialDistortion:
        return RadialDistortion(*self.distortion)

    @property
    def _farthest_corner(self) -> float:
        """Distance of the farthest corner from the principal point, in focal lengths."""
        x, y = (max(abs(share), abs(1.0 - share)) for share in self.centre)
        return 2.0 * self._half_width() * math.hypot(x, y * self.height / self.width)

    @property
    def _steps(self) -> int:
        return _steps(self._lens, self._farthest_corner)

    @property
    def _largest_square(self) -> float:
        """Square of the undistorted radius of what the farthest corner shows, and a little more."""
        farthest = min(1.01 * self._farthest_corner, self._lens.farthest)
        return float(self._lens.undistorted(farthest)) ** 2

    def _half_width(self) -> float:
        """Half the image's width at distance 1."""
        return math.tan(math.radians(0.5 * self.fov))

    def _lens_point(self, lens: mi.Point2f) -> mi.Point3f:
        """Uniform over the aperture, camera space, metres."""
        import mitsuba as mi

        disk = self.aperture * mi.warp.square_to_uniform_disk_concentric(lens)
        return mi.Point3f(disk.x, 0.0, disk.y)


@cache
def _steps(lens: RadialDistortion, largest: float) -> int:
    return lens.steps(largest)
