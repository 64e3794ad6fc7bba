"""OpenEXR's standard attributes in the header of a frame's file: colour, camera, and time."""

from __future__ import annotations

from fractions import Fraction
from importlib import metadata
from typing import Any

import numpy as np
import OpenEXR
from numpy.typing import NDArray

from lightdepth.cameras import Viewpoint
from lightdepth.images.chromaticities import REC709

COLOUR: dict[str, Any] = {"chromaticities": REC709, "colorInteropID": "lin_rec709_scene"}
"""Of every part: pixels are linear Rec.709."""
WORLD_TO_CAMERA, WORLD_TO_NDC = "worldToCamera", "worldToNDC"
WORLD_TO_PANORAMA = "lightdepth:worldToPanorama"
MATRICES = (WORLD_TO_CAMERA, WORLD_TO_NDC, WORLD_TO_PANORAMA)
_MOST_RATE = 60


def software() -> str:
    """Value of the attribute ``software``."""
    return f"lightdepth {metadata.version('lightdepth')}"


def view_matrices(view: Viewpoint, panorama: Viewpoint) -> dict[str, NDArray[np.float32]]:
    """The pose of the camera and of the panorama, shape (4, 4), float32, by the attributes' names.

    They multiply row vectors, ``(p, 1) M``, with ``p`` in world, metres. Camera space is the standard's: x to the right,
    y up, z forward. A perspective camera has its projection as well: after division by w, x and y are in [0, 1] over the
    picture, from its upper left corner.
    """
    world_to_camera = _pose(view)
    found = {WORLD_TO_CAMERA: world_to_camera, WORLD_TO_PANORAMA: _pose(panorama)}
    projection = view.camera.projection_matrix()
    if projection is not None:
        found[WORLD_TO_NDC] = world_to_camera @ projection
    return {name: matrix.astype(np.float32) for name, matrix in found.items()}


def _pose(view: Viewpoint) -> NDArray[np.float64]:
    axes = view.rotation[:, [0, 2, 1]]
    matrix = np.eye(4)
    matrix[:3, :3], matrix[3, :3] = axes, -view.position @ axes
    return matrix


def time_attributes(frame: int | None, rate: Fraction) -> dict[str, Any]:
    """``framesPerSecond`` and ``timeCode`` of a frame of a sequence.

    Frame 0 is at 00:00:00:00; no numbers are dropped. Above 30 frames per second a number counts two frames, which the
    field mark distinguishes (SMPTE ST 12-1). Above 60, and without a frame number, there is no time code.
    """
    attributes: dict[str, Any] = {"framesPerSecond": rate}
    counted = -(-rate.numerator // rate.denominator)  # 23.976 counts 24.
    if frame is None or frame < 0 or counted > _MOST_RATE:
        return attributes
    second = 0
    if counted > _MOST_RATE // 2:
        counted, (frame, second) = -(-counted // 2), divmod(frame, 2)
    seconds, number = divmod(frame, counted)
    code = OpenEXR.TimeCode(seconds // 3600 % 24, seconds // 60 % 60, seconds % 60, number, *[0] * 14)
    code.fieldPhase = bool(second)
    return {**attributes, "timeCode": code}
