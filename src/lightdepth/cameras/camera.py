"""What every camera is: a size, a pose, and rays through its film."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from lightdepth.cameras.topology import Flat, Topology
from lightdepth.quantities import Angles, Coordinates

if TYPE_CHECKING:
    import mitsuba as mi


@dataclass
class FilmPoint:
    """Where a film shows points.

    Attributes:
        origin: the ray through ``film`` that starts here, in camera space, metres, meets the point.
        film: positions on the film in [0, 1], x to the right, y down.
        inside: false where the film does not show the point.
        weight: where the film shows a point in several places, one over the probability with which this one was picked;
            times ``solid_angle t^2``, at the distance ``t`` from the origin, over the area across the ray that a unit of
            film area really covers there, where the rays have no common origin. 1 for most cameras.
    """

    origin: mi.Point3f
    film: mi.Point2f
    inside: mi.Bool
    weight: mi.Float


class Camera(BaseModel, ABC):
    """Base of the cameras: the settings of a ``[camera.NAME]`` table in a scene file.

    Camera space has its origin at the camera, looks along +y, with x to the right and z up. ``rotation`` (XYZ Euler,
    degrees) turns camera space into world; ``position`` is in metres, world. Where neither is given, the scene uses
    the panorama's capture pose.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    type: Any
    width: int = Field(gt=0, le=65536)
    position: Coordinates | None = None
    rotation: Angles | None = None

    @property
    @abstractmethod
    def resolution(self) -> tuple[int, int]:
        """Width and height in pixels."""

    @property
    def topology(self) -> Topology:
        """How the pixels of the film lie beside each other: by default, a picture that ends at its edges."""
        return Flat(*self.resolution)

    @abstractmethod
    def camera_rays(self, film: mi.Point2f, lens: mi.Point2f) -> tuple[mi.Point3f, mi.Vector3f, mi.Bool]:
        """Rays in camera space through points of the film.

        Args:
            film: positions on the film in [0, 1], x to the right, y down.
            lens: uniform random numbers in [0, 1) for the aperture; cameras without one ignore them.

        Returns:
            ``(origins in metres, unit directions, inside)``, where ``inside`` is false for points of the film that
            see nothing (outside a fisheye's circle).
        """

    @abstractmethod
    def film_point(self, target: mi.Point3f, lens: mi.Point2f) -> FilmPoint:
        """Where the film shows points: :meth:`camera_rays` inverted.

        Args:
            target: points in camera space, metres.
            lens: uniform random numbers in [0, 1): for the aperture as in :meth:`camera_rays`, and to pick one of several
                places of the film that show a point.
        """

    @abstractmethod
    def solid_angle(self, direction: mi.Vector3f) -> mi.Float:
        """Steradians that rays of one origin fill per unit of film area, around unit directions in camera space."""

    def pixels_per_degree(self) -> float:
        """Pixels to a degree straight ahead, as far as they are square."""
        import mitsuba as mi

        angle = self.pixel_angle(mi.Vector3f(0.0, 1.0, 0.0)).numpy()[0]
        return float(np.radians(1.0 / np.sqrt(angle)))

    @property
    def has_aperture(self) -> bool:
        """Whether a lens blurs what is not in focus."""
        return False

    def blur(self, depth: mi.Float) -> mi.Float:
        """Radius in pixels of the disk over which the lens blurs points.

        Args:
            depth: of the points along the camera's axis, metres, inf for sky.
        """
        import drjit as dr

        return dr.zeros(type(depth), dr.width(depth))

    def projection_matrix(self) -> NDArray[np.float64] | None:
        """Of cameras that project by one: camera space (x right, y up, z forward) to the film, shape (4, 4).

        It multiplies row vectors; after division by w, x and y are positions on the film in [0, 1]. ``None`` for others.
        """
        return None

    def pixel_angle(self, direction: mi.Vector3f) -> mi.Float:
        """Solid angle of the pixels around unit directions in camera space, steradians."""
        width, height = self.resolution
        return self.solid_angle(direction) * (1.0 / (width * height))
