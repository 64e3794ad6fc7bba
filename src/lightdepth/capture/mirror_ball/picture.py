"""A picture in which a person sees whether the balls' outlines were found."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.capture.mirror_ball.unwrapping import Ball
from lightdepth.images.tonemapping import auto_exposure, tone_map

HEIGHT = 480
MARGIN = 1.6
"""Radii around each ball that are shown."""
COLOR = (255, 60, 160)


def draw_outlines(balls: Sequence[Ball]) -> NDArray[np.uint8]:
    """The balls side by side with their outlines, shape (height, width, 3)."""
    pictures = []
    for ball in balls:
        circle = ball.view.circle()
        scale = HEIGHT / (2.0 * MARGIN * circle.radius)
        corner = np.array([circle.x, circle.y]) - MARGIN * circle.radius
        move = np.array([[scale, 0.0, -scale * corner[0]], [0.0, scale, -scale * corner[1]]])
        how = cv2.INTER_AREA if scale < 1.0 else cv2.INTER_CUBIC
        near = np.maximum(cv2.warpAffine(ball.radiance, move, (HEIGHT, HEIGHT), flags=how), 0.0).astype(np.float32)
        tones = np.ascontiguousarray(tone_map(near, auto_exposure(near, np.ones(near.shape[:2], np.float32))))
        points = scale * (np.stack(ball.view.outline(), axis=-1) - corner)
        cv2.polylines(tones, [np.rint(16.0 * points).astype(np.int32)], True, COLOR, 1, cv2.LINE_AA, shift=4)
        pictures.append(tones)
    return np.asarray(np.concatenate(pictures, axis=1), np.uint8)
