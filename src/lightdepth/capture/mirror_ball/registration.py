"""How the cameras of several photographs of one ball were turned against each other, and how they differ in exposure."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from lightdepth.capture.mirror_ball.unwrapping import Ball, Place, Samples, sample
from lightdepth.directions import FloatArray
from lightdepth.errors import InputError
from lightdepth.parameters.mirror_ball import DEFAULT, MirrorBallParameters


@dataclass(frozen=True)
class Registration:
    """How a photograph relates to the first one.

    Attributes:
        ball: with its rotation and gain.
        turn: degrees by which its camera stood farther around the ball, counter-clockwise seen from above.
        disagreement: median relative difference that is left.
    """

    ball: Ball
    turn: float
    disagreement: float


def register(
    first: Ball,
    other: Ball,
    turn: float | None = None,
    place: Place | None = None,
    tuned: MirrorBallParameters = DEFAULT,
) -> Registration:
    """Find rotation and gain of a photograph from what it and the first one both reflect.

    Args:
        first: its rotation and gain stay.
        other: its own are replaced.
        turn: degrees by which its camera stood farther around the ball, counter-clockwise seen from above, about; ``None``
            tries all.
        place: where the reflected rays end; without it, near things are a little off between the photographs.
        tuned: what is tried and compared.

    Raises:
        InputError: the two disagree by more than a gain.
    """
    step, around, blurs = tuned.turn_step, tuned.turn_around, tuned.turn_blurs
    directions = _sphere(tuned.turn_points)
    distance = None if place is None else place.distance(directions)
    turns = np.arange(-180.0, 180.0, step) if turn is None else turn + np.arange(-around, around + 1.0, step)
    coarse = [_blurred(ball, blurs[0]) for ball in (first, other)]
    # The place's parallax is below this blur.
    few = directions[::6]
    wanted = sample(coarse[0], few, tuned=tuned)
    best, rotation = -np.inf, np.eye(3)
    for tilt in tuned.turn_tilts:
        pitch = Rotation.from_euler("x", tilt, degrees=True)
        for each in turns:
            tried = (pitch.inv() * Rotation.from_euler("z", each, degrees=True) * pitch).as_matrix()
            tried = first.rotation @ tried
            found = sample(replace(coarse[1], rotation=tried), few, tuned=tuned)
            rating = _correlation(wanted, found, tuned)
            if rating > best:
                best, rotation = rating, tried
    gain = np.zeros(3)
    for blur in blurs:
        pair = [_blurred(ball, blur) for ball in (first, other)]
        rotation, gain, left = _refined(pair[0], pair[1], rotation, gain, directions, distance, tuned)
    disagreement = float(np.median(np.abs(left))) if left.size else np.inf
    if not disagreement <= tuned.turn_disagreement:
        raise InputError(
            f"{other.name}: differs from {first.name} by {100.0 * np.expm1(min(disagreement, 9.0)):.0f} % in the median, "
            "however it is turned and with any gain: the two must show one ball in one place under the same light, with "
            "one camera response; state --turn (degrees) if the right turn was not found, or --response"
        )
    forward = (first.rotation.T @ rotation) @ np.array([0.0, 1.0, 0.0])
    ball = replace(other, rotation=rotation, gain=first.gain * np.exp(gain))
    return Registration(ball, float(np.degrees(np.arctan2(-forward[0], forward[1]))), float(np.expm1(disagreement)))


def _refined(
    first: Ball,
    other: Ball,
    rotation: FloatArray,
    gain: FloatArray,
    directions: FloatArray,
    distance: FloatArray | None,
    tuned: MirrorBallParameters,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Rotation, logarithm of the gain, and what is left of the differences of logarithms, shape (n, 3)."""
    wanted = sample(first, directions, distance, tuned=tuned)
    one = _logarithm(wanted.radiance)

    def applied(parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        change = tuned.turn_unit * (parameters - 1.0)
        return np.asarray(Rotation.from_rotvec(change[:3]).as_matrix() @ rotation), gain + change[3:]

    def differences(parameters: FloatArray) -> FloatArray:
        turned, factor = applied(parameters)
        found = sample(replace(other, rotation=turned), directions, distance, tuned=tuned)
        return np.asarray((_logarithm(found.radiance) + factor - one) * _both(wanted, found, tuned)[:, None])

    solved = least_squares(
        lambda parameters: differences(parameters).ravel(),
        np.ones(6),
        loss="soft_l1",
        f_scale=tuned.turn_scale,
        diff_step=0.05,
        max_nfev=tuned.turn_evaluations,
    )
    turned, factor = applied(solved.x)
    found = sample(replace(other, rotation=turned), directions, distance, tuned=tuned)
    left = (_logarithm(found.radiance) + factor - one)[_both(wanted, found, tuned)]
    return turned, factor, np.asarray(left)


def _both(one: Samples, other: Samples, tuned: MirrorBallParameters) -> NDArray[np.bool_]:
    """Which directions both photographs show well, shape (n,)."""
    low, high = np.radians((tuned.turn_nearest, tuned.turn_farthest))
    good = [
        (each.weight > 0.0) & (each.clipped < tuned.turn_clipped) & (each.angle > low) & (each.angle < high)
        for each in (one, other)
    ]
    return np.asarray(good[0] & good[1])


def _correlation(one: Samples, other: Samples, tuned: MirrorBallParameters) -> float:
    """Of the logarithms of luminance."""
    both = _both(one, other, tuned)
    if np.count_nonzero(both) < tuned.turn_least_shared * len(both):
        return -np.inf
    values = [_logarithm(each.radiance[both].mean(axis=1)) for each in (one, other)]
    return float(np.nan_to_num(np.corrcoef(values[0], values[1])[0, 1], nan=-1.0))


def _logarithm(radiance: NDArray[np.floating]) -> FloatArray:
    return np.log(np.maximum(radiance, 1e-9).astype(np.float64))


def _blurred(ball: Ball, degrees: float) -> Ball:
    finest = float(np.max(ball.view.degrees_per_pixel(np.array([1.0]))))
    sigma = degrees / finest
    # What is that soft needs few pixels.
    scale = min(1.0, 4.0 / sigma)
    height, width = (max(2, round(scale * side)) for side in ball.radiance.shape[:2])
    light = cv2.resize(ball.radiance, (width, height), interpolation=cv2.INTER_AREA)
    clipped = cv2.resize(ball.clipped.astype(np.float32), (width, height), interpolation=cv2.INTER_AREA) > 0.0
    view = replace(ball.view, width=width, height=height, focal_length=ball.view.focal_length * width / ball.view.width)
    # The logarithm, so that a lamp does not drown all around it.
    level = 0.01 * np.median(light, axis=(0, 1)) + 1e-9
    soft = np.exp(cv2.GaussianBlur(np.log(np.maximum(light, level)).astype(np.float32), (0, 0), sigma * scale))
    return replace(ball, radiance=np.asarray(soft, np.float32), clipped=clipped, view=view)


def _sphere(count: int) -> FloatArray:
    """Evenly spread unit vectors (Fibonacci's spiral), shape (count, 3)."""
    index = np.arange(count) + 0.5
    z = 1.0 - 2.0 * index / count
    turn = np.pi * (1.0 + np.sqrt(5.0)) * index
    flat = np.sqrt(1.0 - z**2)
    return np.stack([flat * np.cos(turn), flat * np.sin(turn), z], axis=-1)
