"""The lights of a median cut drawn over the panorama."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import direction_to_latlong
from lightdepth.images.tonemapping import LUMINANCE, auto_exposure, tone_map
from lightdepth.lightmap.median_cut import PointLights

RECTANGLE = (90, 170, 255)


def draw_median_cut(radiance: NDArray[np.float32], lights: PointLights) -> NDArray[np.uint8]:
    """Draw the cut's rectangles as lines and each light as a disk of its colour, its area as the light's power.

    Args:
        radiance: the panorama, linear RGB, shape (height, 2 height, 3).
        lights: made from it.

    Returns:
        sRGB, 1024 to 2048 pixels wide.
    """
    rows, columns = radiance.shape[:2]
    width = int(np.clip(columns, 1024, 2048))
    height = width // 2
    method = cv2.INTER_AREA if columns > width else cv2.INTER_LINEAR
    resized = np.maximum(cv2.resize(radiance, (width, height), interpolation=method), 0.0)
    picture = tone_map(resized, auto_exposure(resized) - 1.0)
    for top, bottom, left, right in lights.rectangle:
        corners = [np.array([x * width / columns, y * height / rows]) for x, y in ((left, top), (right, bottom))]
        start, end = (np.minimum(np.rint(corner), [width - 1, height - 1]).astype(int) for corner in corners)
        cv2.rectangle(picture, start.tolist(), end.tolist(), RECTANGLE, 1)
    u, v = direction_to_latlong(lights.direction)
    brightness = lights.power @ LUMINANCE
    radii = 4.0 * width / 1024 * np.sqrt(brightness / max(brightness.mean(), 1e-12))
    for x, y, radius, power in zip(u * width, v * height, radii, lights.power, strict=True):
        colour = (255.0 * (power / max(power.max(), 1e-12)) ** (1 / 2.2)).round().astype(int).tolist()
        centre = (round(float(x) * 16), round(float(y) * 16))
        shown = round(16 * float(np.clip(radius, 2.0, 16.0)))
        cv2.circle(picture, centre, shown + 24, (20, 20, 20), -1, cv2.LINE_AA, 4)
        cv2.circle(picture, centre, shown, colour, -1, cv2.LINE_AA, 4)
    return picture
