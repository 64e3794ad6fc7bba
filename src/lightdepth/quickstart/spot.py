"""Where the new objects stand: on free floor in front of the camera."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import FloatArray, direction_to_latlong
from lightdepth.images.tonemapping import LUMINANCE
from lightdepth.parameters.quickstart import DEFAULT, QuickstartParameters
from lightdepth.quickstart.place import GuessedPlace
from lightdepth.quickstart.pose import GuessedPose


@dataclass(frozen=True)
class FloorSpot:
    """A place on the floor.

    Attributes:
        point: world, metres, shape (3,).
        away: unit, level, from the capture point toward it, shape (3,).
        unlike: how much what is seen there, and on the way there, differs from the floor beside the camera; 0 is the same.
        is_free: whether the floor seems to be seen there, and no furniture.
    """

    point: FloatArray
    away: FloatArray
    unlike: float
    is_free: bool


def find_floor_spot(
    radiance: NDArray[np.float32],
    pose: GuessedPose,
    place: GuessedPlace,
    reach: float,
    depth: float,
    distance: float,
    tuned: QuickstartParameters = DEFAULT,
) -> FloorSpot:
    """Find where the picture looks most like empty floor.

    Args:
        radiance: the panorama, linear RGB, finite, shape (height, 2 height, 3).
        pose: of the panorama.
        place: the guessed place.
        reach: half of the width that the objects need beside each other, metres.
        depth: half of the depth that they need, metres.
        distance: from the point under the camera, metres, that is best for looking at them.
        tuned: what is looked at, and what counts.
    """
    height = tuned.floor_rows
    colours = _colours(radiance, height)
    position = np.array([0.0, 0.0, pose.height])

    def seen(points: FloatArray) -> NDArray[np.float32]:
        u, v = direction_to_latlong((points - position) @ pose.rotation)
        return colours[(v * height).astype(int).clip(0, height - 1), (u * 2 * height).astype(int) % (2 * height)]

    turn = 2.0 * np.pi * np.arange(tuned.around) / tuned.around
    circle = np.stack([np.sin(turn), np.cos(turn), np.zeros(tuned.around)], axis=-1)
    forward = pose.rotation @ [0.0, 1.0, 0.0]
    best: tuple[float, FloorSpot] | None = None
    for far in distance * np.geomspace(tuned.closest, tuned.farthest, tuned.distances):
        for angle in np.radians(np.arange(0.0, 360.0, tuned.turn)):
            away = np.array([np.sin(angle), np.cos(angle), 0.0])
            point = far * away
            needed = reach * np.abs(away[[1, 0]]) + depth * np.abs(away[:2]) + tuned.margin
            if np.any(point[:2] - needed < place.low) or np.any(point[:2] + needed > place.high):
                continue
            if far < tuned.nearest * pose.height:
                continue
            # The floor begins in front of the camera's feet; what differs from it on the way is a thing that stands there.
            near = seen(pose.height * np.linspace(0.3, 0.5, 5)[:, None, None] * away + 0.15 * circle).reshape(-1, 3)
            way = seen(
                np.linspace(0.5 * pose.height, max(far, 0.5 * pose.height), 12)[:, None, None] * away + 0.1 * circle
            )
            patch = seen(point + (max(reach, 0.25) * np.array([0.4, 0.8, 1.2]))[:, None, None] * circle)
            floor = np.median(near, axis=0)
            differs = [np.abs(part.reshape(-1, 3) - floor).sum(axis=-1) for part in (patch, way)]
            unlike = float(sum(np.mean(np.minimum(part, tuned.most_unlike)) for part in differs))
            cost = unlike - tuned.forward * float(away @ forward) + tuned.far * abs(np.log2(far / distance))
            if best is None or cost < best[0]:
                best = cost, FloorSpot(point, away, unlike, unlike < tuned.free)
    if best is not None:
        return best[1]
    # In a cramped place: half way to the wall that is farthest.
    walls = [np.array([0.0, place.high[1]]), np.array([place.high[0], 0.0])]
    walls += [np.array([0.0, place.low[1]]), np.array([place.low[0], 0.0])]
    point = np.array([*max(walls, key=lambda wall: float(np.linalg.norm(wall))) * 0.6, 0.0])
    return FloorSpot(point, point / np.linalg.norm(point), 2.0, False)


def _colours(radiance: NDArray[np.float32], height: int) -> NDArray[np.float32]:
    """Half the logarithm of luminance (sun and shade lie on the same floor) and of two ratios of colours."""
    small = np.maximum(cv2.resize(radiance, (2 * height, height), interpolation=cv2.INTER_AREA), 0.0)
    middle = float(np.median(small @ LUMINANCE)) or 1.0
    logarithm = np.log(np.maximum(small, 1e-4 * middle) / middle)
    brightness = 0.5 * np.log(np.maximum(small @ LUMINANCE, 1e-4 * middle) / middle)
    return np.stack([brightness, *(logarithm[..., c] - logarithm[..., 1] for c in (0, 2))], axis=-1).astype(np.float32)
