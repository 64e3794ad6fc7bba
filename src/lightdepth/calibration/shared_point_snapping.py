"""Clicks on a second panorama moved to where it shows what the first one shows around its clicks.

The surroundings of a shared point are drawn as the second panorama would show them: each direction meets the modelled
surface where the first panorama saw it. This template is searched around the point by normalised cross-correlation. The
first click then needs no precision: wherever it is, its place is known, and the second is moved to the same place.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.calibration.line_detection import display_brightness, sample_panorama
from lightdepth.calibration.relative_pose import RelativePose, SharedPoints, refine
from lightdepth.directions import FloatArray
from lightdepth.kernel.raycasting import RayCaster
from lightdepth.parameters.calibration import DEFAULT, CalibrationParameters


def snap_shared_points(
    points: SharedPoints,
    pose: RelativePose,
    first: NDArray[np.float32],
    first_rotation: FloatArray,
    second: NDArray[np.float32],
    caster: RayCaster,
    tuned: CalibrationParameters = DEFAULT,
) -> tuple[SharedPoints, RelativePose, NDArray[np.bool_]]:
    """Move the second clicks to where the picture says, and find the pose again.

    Args:
        points: clicked, with the places of those that may be moved, and their normals.
        pose: from these clicks.
        first: panorama, linear RGB, shape (height, 2 height, 3).
        first_rotation: light space of the first to world, shape (3, 3).
        second: panorama, of another size, exposure and white balance perhaps.
        caster: for the modelled surfaces. A point that is on none of them counts as on a plane.
        tuned: what is searched where, and what is believed.

    Returns:
        The points with what was found, the pose, and which points were moved, shape (n,).
    """
    tones = display_brightness(first), display_brightness(second)
    spacing = 2.0 * np.pi / min(first.shape[1], second.shape[1])
    moved = np.zeros(len(points.names), np.bool_)
    snapped, clicked = points, pose
    for _ in range(tuned.match_rounds):
        directions, errors = points.second.copy(), points.click_errors.copy()
        moved[:] = False
        for number in np.flatnonzero(points.placed):
            look = _surface(points, int(number), caster, tuned)
            for larger in tuned.match_coarsenings:
                pixel = larger * spacing
                found = _searched(points, int(number), pose, tones, first_rotation, pixel, look, caster, tuned)
                if found is not None:
                    directions[number], errors[number] = found
                    moved[number] = True
                    break
        if not moved.any():
            return points, clicked, moved
        for _ in range(2):
            snapped = replace(points, second=directions, click_errors=errors)
            pose = refine(snapped, pose, tuned)
            wrong = moved & (pose.residuals > tuned.match_outlier * errors)
            if not wrong.any():
                break
            directions[wrong], errors[wrong], moved[wrong] = points.second[wrong], points.click_errors[wrong], False
    return snapped, pose, moved


Look = Callable[[FloatArray, FloatArray], FloatArray]
"""Places that rays from an origin meet, shape (n, 3); NaN where there are none."""


def _surface(points: SharedPoints, number: int, caster: RayCaster, tuned: CalibrationParameters) -> Look:
    """What is around a point: the modelled surfaces where it is on them, else the plane through it."""
    place, ray = points.places[number], points.first[number]
    away = float(np.linalg.norm(place - points.origin))

    def on_model(origin: FloatArray, rays: FloatArray) -> FloatArray:
        distance = np.asarray(caster.cast(origin, rays).distance, np.float64)
        return np.asarray(origin + rays * np.where(np.isfinite(distance), distance, np.nan)[:, None])

    if np.linalg.norm(on_model(points.origin, ray[None])[0] - place) < tuned.match_nearer * away:
        return on_model
    normal = ray if points.normals is None else points.normals[number]

    def on_plane(origin: FloatArray, rays: FloatArray) -> FloatArray:
        with np.errstate(divide="ignore", invalid="ignore"):
            distance = ((place - origin) @ normal) / (rays @ normal)
        return np.asarray(origin + rays * np.where(distance > 0.0, distance, np.nan)[:, None])

    return on_plane


def _searched(
    points: SharedPoints,
    number: int,
    pose: RelativePose,
    tones: tuple[NDArray[np.float32], NDArray[np.float32]],
    first_rotation: FloatArray,
    spacing: float,
    look: Look,
    caster: RayCaster,
    tuned: CalibrationParameters,
) -> tuple[FloatArray, float] | None:
    """Direction in the second panorama and its standard deviation in radians, or ``None`` where it is not clear."""
    way = points.places[number] - pose.position
    near, far = float(np.linalg.norm(points.places[number] - points.origin)), float(np.linalg.norm(way))
    centre = way / far @ pose.rotation
    # A texel of the first panorama, seen from nearer by the second, is larger than one of the second.
    pixel = spacing * float(np.clip(near / far, 1.0, tuned.match_finest))
    fine = int(np.clip(np.ceil(max(near / far, far / near)), 2, tuned.match_finest))
    half = tuned.match_half
    margin = int(np.ceil(tuned.match_reach * points.click_errors[number] / pixel)) + 1
    frame = _frame(centre)
    rays = _grid(frame, half, fine, pixel)
    ahead = rays.reshape(-1, 3) @ pose.rotation.T
    places = look(pose.position, ahead)
    seen = places - points.origin
    length = np.linalg.norm(seen, axis=1)
    known = np.isfinite(length)
    seen = np.where(known[:, None], seen / np.maximum(length, 1e-9)[:, None], [0.0, 0.0, 1.0])
    known &= ~(np.asarray(caster.cast(points.origin, seen).distance) < (1.0 - tuned.match_nearer) * length)
    if known.mean() < tuned.match_least_known:
        return None
    template = sample_panorama(tones[0], seen @ first_rotation)
    template[~known] = template[known].mean()
    side = 2 * half + 1
    template = template.reshape(side, fine, side, fine).mean(axis=(1, 3))
    around = sample_panorama(tones[1], _grid(frame, half + margin, fine, pixel).reshape(-1, 3))
    side += 2 * margin
    around = around.reshape(side, fine, side, fine).mean(axis=(1, 3))
    likeness = cv2.matchTemplate(around.astype(np.float32), template.astype(np.float32), cv2.TM_CCOEFF_NORMED)
    found = _peak(likeness, tuned)
    if found is None:
        return None
    shift, error = found[0], pixel * max(found[1], tuned.match_error)
    if error > tuned.match_vague * points.click_errors[number]:
        return None
    right, up = (shift - margin) * pixel * np.array([1.0, -1.0])
    direction = centre + right * frame[0] + up * frame[1]
    return direction / np.linalg.norm(direction), error


def _peak(likeness: NDArray[np.float32], tuned: CalibrationParameters) -> tuple[FloatArray, float] | None:
    """Column and row of the one place that is alike, and their standard deviation; ``None`` where there is none."""
    row, column = np.unravel_index(int(np.argmax(likeness)), likeness.shape)
    best = float(likeness[row, column])
    height, width = likeness.shape
    if best < tuned.match_likeness or not (0 < row < height - 1 and 0 < column < width - 1):
        return None
    y, x = np.mgrid[:height, :width]
    others = likeness[np.maximum(np.abs(y - row), np.abs(x - column)) > tuned.match_apart]
    if others.size and 1.0 - best > tuned.match_ambiguity * (1.0 - float(others.max())):
        return None
    # The paraboloid through the nine values around, by least squares.
    around = likeness[row - 1 : row + 2, column - 1 : column + 2].astype(np.float64)
    v, u = (each.ravel() for each in np.mgrid[-1:2, -1:2])
    terms = np.stack([u * u, u * v, v * v, u, v, np.ones(9)], axis=1)
    a, b, c, d, e, _ = np.linalg.lstsq(terms, around.ravel(), rcond=None)[0]
    curvature = np.array([[2.0 * a, b], [b, 2.0 * c]])
    least = -float(np.linalg.eigvalsh(curvature).max())
    if least < 2.0 * tuned.match_sharpness:
        return None
    offset = -np.linalg.solve(curvature, [d, e])
    if np.abs(offset).max() > 1.0:
        return None
    # Noise of variance 1 - likeness in both; the curvature is the mean square of the template's gradient.
    return np.array([column, row]) + offset, float(np.sqrt(2.0 * (1.0 - best) / (tuned.match_independent * least)))


def _frame(direction: FloatArray) -> FloatArray:
    """Unit vectors to the right, up and ahead at a direction, shape (3, 3)."""
    aside = np.array([1.0, 0.0, 0.0]) if abs(direction[2]) > 0.9 else np.array([0.0, 0.0, 1.0])
    right = np.cross(direction, aside)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(right, direction), direction])


def _grid(frame: FloatArray, half: int, fine: int, pixel: float) -> FloatArray:
    """Unit vectors through samples of the pixels around a direction, rows from above, shape (n, n, 3)."""
    side = 2 * half + 1
    offsets = pixel * ((np.arange(side * fine) + 0.5) / fine - 0.5 * side)
    grid = frame[2] + offsets[None, :, None] * frame[0] - offsets[:, None, None] * frame[1]
    return np.asarray(grid / np.linalg.norm(grid, axis=-1, keepdims=True))
