"""The distortion of a camera as ST maps, and from one."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from lightdepth.cameras.perspective import Perspective
from lightdepth.directions import FloatArray
from lightdepth.errors import InputError
from lightdepth.parameters.calibration import DEFAULT, CalibrationParameters


def pixel_centres(width: int, height: int) -> FloatArray:
    """Positions of the pixels' middles on the film, x to the right, y down, shape (height, width, 2)."""
    x, y = (np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height
    return np.stack(np.broadcast_arrays(x[None, :], y[:, None]), axis=-1)


def undistortion(camera: Perspective, overscan: float = 1.0) -> FloatArray:
    """Where each pixel of the undistorted picture is read in the distorted one.

    Args:
        camera: the camera as it distorts.
        overscan: by how much the undistorted picture is wider and higher than the distorted one.

    Returns:
        Positions on the film of ``camera``, shape (height, width, 2) of the undistorted picture. What the distorted
        picture does not show lies outside of [0, 1].
    """
    straight = camera.without_distortion(overscan)
    film, ahead = camera.film_of(straight.directions_of(pixel_centres(*straight.resolution)))
    return np.where(ahead[..., None], film, -1.0)


def distortion(camera: Perspective, overscan: float = 1.0) -> FloatArray:
    """Where each pixel of the distorted picture is read in the undistorted one: :func:`undistortion` inverted.

    Returns:
        Positions on the undistorted film, shape (height, width, 2) of the distorted picture; those outside of [0, 1]
        are not in it, see :func:`needed_overscan`.
    """
    straight = camera.without_distortion(overscan)
    return straight.film_of(camera.directions_of(pixel_centres(*camera.resolution)))[0]


def needed_overscan(camera: Perspective) -> float:
    """By how much the undistorted picture must be wider and higher to hold all that the distorted one shows."""
    film = distortion(camera)
    return max(1.0, float(2.0 * np.abs(film - 0.5).max()))


@dataclass(frozen=True)
class FittedLens:
    """A lens fitted to an ST map.

    Attributes:
        distortion: k1 and k2.
        principal_point: in shares of width and height from the upper left corner.
        residual: root mean square of what the fitted lens misses the map by, pixels.
        largest: the same, the largest.
    """

    distortion: tuple[float, float]
    principal_point: tuple[float, float]
    residual: float
    largest: float


def fit_lens(
    film: NDArray[np.float64], fov: float, undistorts: bool, tuned: CalibrationParameters = DEFAULT
) -> FittedLens:
    """Find the coefficients by which an ST map distorts.

    Args:
        film: positions as :func:`lightdepth.images.stmap.read_stmap` returns them; without overscan.
        fov: horizontal field of view without distortion, degrees; the coefficients go by it.
        undistorts: whether the map undistorts a picture; else it distorts one.
        tuned: to how many pixels.

    Raises:
        InputError: the map has too few pixels that lie in the other picture.
    """
    height, width = film.shape[:2]
    here, there = pixel_centres(width, height).reshape(-1, 2), film.reshape(-1, 2)
    seen = ((there >= 0.0) & (there <= 1.0)).all(axis=1)
    if seen.sum() < 16:
        raise InputError("hardly any pixel of the ST map points into the other picture (0 to 1)")
    here, there = here[seen], there[seen]
    chosen = np.unique(np.linspace(0, len(here) - 1, tuned.map_pixels).astype(int))
    straight, bent = (here[chosen], there[chosen]) if undistorts else (there[chosen], here[chosen])
    half = np.tan(np.radians(0.5 * fov))
    size = np.array([2.0 * half, 2.0 * half * height / width])

    def missed(vector: FloatArray) -> FloatArray:
        k1, k2, x, y = vector
        centre = np.array([x, y])
        offset = straight - centre
        squared = np.sum((offset * size) ** 2, axis=1, keepdims=True)
        errors = centre + offset * (1.0 + squared * (k1 + squared * k2)) - bent
        return np.asarray((errors * [width, height]).ravel())

    found = least_squares(missed, [0.0, 0.0, 0.5, 0.5], x_scale=[0.1, 0.1, 0.1, 0.1])
    distances = np.hypot(*found.fun.reshape(-1, 2).T)
    k1, k2, x, y = (float(value) for value in found.x)
    return FittedLens((k1, k2), (x, y), float(np.sqrt(np.mean(distances**2))), float(distances.max()))
