"""The sources that a panorama clipped: plateaus of its brightest value."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from lightdepth.directions import FloatArray, pixel_directions, pixel_solid_angles
from lightdepth.scene.model import Scene


@dataclass(frozen=True)
class Plateau:
    """A clipped source as the panorama shows it.

    Attributes:
        pixels: shape (height, 2 height), bool.
        pixel: x, y of a place in it, in pixels.
        direction: toward its middle, from the capture point, unit, world, shape (3,).
        angular_radius: angle between its middle and its farthest pixel, degrees.
        solid_angle: steradian.
        sky: whether it lies on no real surface.
    """

    pixels: NDArray[np.bool_]
    pixel: tuple[float, float]
    direction: FloatArray
    angular_radius: float
    solid_angle: float
    sky: bool


def find_plateaus(scene: Scene, distance: NDArray[np.float32]) -> list[Plateau]:
    """What may have been clipped, the largest first; none where no two neighbours are the brightest.

    Args:
        scene: its panorama.
        distance: of the real surfaces at the panorama's pixels, inf for sky, shape (height, 2 height).
    """
    tuned = scene.render.parameters.lighting
    radiance = scene.panorama.radiance
    height, width = radiance.shape[:2]
    brightest = radiance.max(axis=2)
    clipped = brightest >= tuned.plateau_level * float(brightest.max())
    angles = np.repeat(pixel_solid_angles(height, width)[:, None], width, axis=1)
    directions = pixel_directions(height, width)
    found: list[Plateau] = []
    for pixels in _components(clipped, 4 * tuned.most_plateaus):
        if np.count_nonzero(pixels) < tuned.plateau_fewest_pixels:
            continue
        middle = (directions * (pixels * angles)[..., None]).sum(axis=(0, 1))
        middle /= max(float(np.linalg.norm(middle)), 1e-12)
        y, x = np.nonzero(pixels)
        nearest = int(np.argmax(directions[y, x] @ middle))
        angular_radius = float(np.degrees(np.arccos(np.clip((directions[y, x] @ middle).min(), -1.0, 1.0))))
        found.append(
            Plateau(
                pixels,
                (float(x[nearest]) + 0.5, float(y[nearest]) + 0.5),
                scene.panorama.rotation @ middle,
                angular_radius,
                float(angles[pixels].sum()),
                bool(np.mean(np.isinf(distance[pixels])) > 0.5),
            )
        )
    found.sort(key=lambda plateau: -plateau.solid_angle)
    return [each for each in found if each.solid_angle >= tuned.plateau_least_share * found[0].solid_angle][
        : tuned.most_plateaus
    ]


def _components(mask: NDArray[np.bool_], most: int) -> list[NDArray[np.bool_]]:
    """The largest connected parts; the left and the right edge are one."""
    labels, count = ndimage.label(mask, np.ones((3, 3)))
    joined = np.arange(count + 1)
    for row in range(len(labels)):
        for shift in (-1, 0, 1):
            other = row + shift
            if 0 <= other < len(labels) and labels[row, 0] and labels[other, -1]:
                a, b = joined[labels[row, 0]], joined[labels[other, -1]]
                joined[joined == max(a, b)] = min(a, b)
    numbers = joined[labels]
    sizes = np.bincount(numbers.ravel(), minlength=count + 1)
    sizes[0] = 0
    largest = [int(n) for n in np.argsort(-sizes)[:most] if sizes[n] > 0]
    return [numbers == index for index in largest]
