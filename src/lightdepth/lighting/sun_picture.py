"""The picture by which a person judges a recovered sun: the outlines of what it lights, drawn over the panorama."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.images.tonemapping import auto_exposure, tone_map
from lightdepth.lighting.panorama_view import PanoramaView
from lightdepth.lighting.sun import RecoveredSun
from lightdepth.lighting.sunlight import Sunlight
from lightdepth.scene.lights.frame import azimuth_and_elevation
from lightdepth.scene.model import Scene

OUTLINE, PAIR_LIT, PAIR_SHADED = (255, 60, 200), (255, 235, 60), (60, 160, 255)
MOST_PAIRS = 150


def draw_sun(scene: Scene, sun: RecoveredSun) -> NDArray[np.uint8]:
    """Outline what the sun lights, and mark the places that were compared: yellow in the sun, blue in the shade.

    Args:
        scene: the place.
        sun: recovered.

    Returns:
        sRGB, shape (h, 2 h, 3), 1024 to 2048 pixels wide.
    """
    view, sunlight = PanoramaView(scene), Sunlight(scene)
    width = int(np.clip(view.width, 1024, 2048))
    height = width // 2
    scale = width / view.width
    resized = np.maximum(cv2.resize(view.radiance, (width, height), interpolation=cv2.INTER_LINEAR), 0.0)
    # Dark, so that the patch differs from the rest.
    picture = tone_map(resized, auto_exposure(resized) - 1.0)
    y, x = np.mgrid[:height, :width]
    pixels = (np.stack([x.ravel(), y.ravel()], axis=-1) + 0.5) / scale
    seen = view.look(pixels)
    usable = (seen.surface >= 0) & ~view.opening[seen.surface]
    lit = np.zeros(len(pixels), dtype=np.uint8)
    lit[usable] = sunlight.lit(seen.point[usable], seen.normal[usable], sun.direction)
    outlines, _ = cv2.findContours(lit.reshape(height, width), cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)
    cv2.drawContours(picture, outlines, -1, OUTLINE, 1, cv2.LINE_AA)
    pairs = sun.irradiance.pairs
    chosen = np.linspace(0, len(pairs.lit) - 1, min(MOST_PAIRS, len(pairs.lit))).astype(int)
    for places, colour in ((pairs.lit, PAIR_LIT), (pairs.shaded, PAIR_SHADED)):
        for px, py in places[chosen] * scale:
            cv2.circle(picture, (round(px % width), round(py)), 1, colour, -1, cv2.LINE_AA)
    azimuth, elevation = azimuth_and_elevation(sun.direction)
    red, green, blue = sun.irradiance.value
    where, strength = f"azimuth {azimuth:.1f}, elevation {elevation:.1f}", f"{red:.3g} {green:.3g} {blue:.3g}"
    words = f"{where}, irradiance {strength}: {sun.confidence}"
    for colour, thickness in (((20, 20, 20), 4), ((255, 225, 120), 1)):
        cv2.putText(picture, words, (12, height - 14), cv2.FONT_HERSHEY_SIMPLEX, 0.5, colour, thickness, cv2.LINE_AA)
    return np.asarray(picture)
