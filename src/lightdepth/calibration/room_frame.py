"""The directions of a room's edges: vertical, and along and across its walls."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from lightdepth.calibration.arcs import Arcs
from lightdepth.directions import FloatArray
from lightdepth.errors import InputError
from lightdepth.parameters.calibration import DEFAULT, CalibrationParameters


@dataclass(frozen=True)
class RoomFrame:
    """A room's directions in a panorama.

    Attributes:
        rotation: light space to a frame with z up and x and y along the walls, shape (3, 3); y is the wall direction
            nearest to the panorama's centre column.
        confidence: share of random halves of the edges that, solved again, give the same rotation within a degree.
        level_error: expected error of the vertical, degrees.
        heading_error: expected error of the heading, degrees.
        residual: root mean square deviation of the edges that point along x, y or z, degrees.
        arcs: all edges found.
        axis: for each edge 0, 1 or 2 where it points along x, y or z, else -1; shape (n,), int64.
    """

    rotation: FloatArray
    confidence: float
    level_error: float
    heading_error: float
    residual: float
    arcs: Arcs
    axis: NDArray[np.int64]


def find_room_frame(
    arcs: Arcs,
    progress: Callable[[float], None] = lambda share: None,
    seed: int = 0,
    tuned: CalibrationParameters = DEFAULT,
) -> RoomFrame:
    """Find the three perpendicular directions that most edges point along (a Manhattan frame).

    Frames through the vanishing points of random triples of edges are scored by how much length of edges points along
    their axes; the best are refined by iteratively reweighted least squares. The axis nearest to the panorama's zenith
    is taken as the vertical, so the camera must have been upright within 45 degrees.

    Args:
        arcs: the panorama's straight edges.
        progress: is called with the share done, in [0, 1].
        seed: for the random triples.
        tuned: how it is found.

    Raises:
        InputError: there are too few edges, or no three directions that they point along.
    """
    if len(arcs) < tuned.frame_fewest_edges:
        raise InputError(
            f"automatic calibration: {len(arcs)} straight edges found, at least {tuned.frame_fewest_edges} are needed; "
            "use a floor rectangle or verticals instead"
        )
    random = np.random.default_rng(seed)
    rotation = _search(arcs, random, tuned.frame_triples, tuned)
    level, heading, agree = [], [], []
    for done in range(tuned.frame_halves):
        half = arcs.take(random.permutation(len(arcs))[: len(arcs) // 2])
        other = _nearest_quarter_turn(_search(half, random, tuned.frame_half_triples, tuned), rotation)
        step = other @ rotation.T
        level.append(np.degrees(np.arccos(np.clip(step[2, 2], -1.0, 1.0))))
        heading.append(abs(np.degrees(np.arctan2(step[1, 0], step[0, 0]))))
        agree.append(np.degrees(np.arccos(np.clip((np.trace(step) - 1) / 2, -1.0, 1.0))) < tuned.frame_agreement)
        progress((done + 1) / tuned.frame_halves)
    deviation = arcs.deviation(rotation)
    axis = np.abs(deviation).argmin(axis=0)
    deviation = np.take_along_axis(deviation, axis[None], axis=0)[0]
    axis[np.abs(deviation) > tuned.frame_tolerance] = -1
    if (axis < 0).all():
        raise InputError("automatic calibration: no edges of a room found; use a floor rectangle or verticals instead")
    return RoomFrame(
        rotation=rotation,
        confidence=float(np.mean(agree)),
        # A half differs from the whole as much as the whole does from the truth (delete-half jackknife).
        level_error=max(tuned.frame_least_error, float(np.sqrt(np.mean(np.square(level))))),
        heading_error=max(tuned.frame_least_error, float(np.sqrt(np.mean(np.square(heading))))),
        residual=float(np.sqrt(np.mean(deviation[axis >= 0] ** 2))),
        arcs=arcs,
        axis=axis,
    )


def _search(arcs: Arcs, random: np.random.Generator, triples: int, tuned: CalibrationParameters) -> FloatArray:
    """The best frame: rotation from light space, shape (3, 3), whose rows are the axes in light space."""
    share = arcs.length / arcs.length.sum()
    first, second, third = arcs.normal[random.choice(len(arcs), (3, triples), p=share)]
    vanishing = np.cross(first, second)
    across = np.cross(third, vanishing)
    usable = (np.linalg.norm(vanishing, axis=1) > 0.05) & (np.linalg.norm(across, axis=1) > 0.005)
    z = vanishing[usable] / np.linalg.norm(vanishing[usable], axis=1, keepdims=True)
    x = across[usable] / np.linalg.norm(across[usable], axis=1, keepdims=True)
    frames = np.stack([x, np.cross(z, x), z], axis=1)
    if len(frames) == 0:
        frames = np.eye(3)[None]
    best = np.argsort(-_scores(arcs, frames, 2 * tuned.frame_tolerance))[: tuned.frame_kept]
    candidates = np.stack([_refine(arcs, _upright(frames[index]), tuned) for index in best])
    return candidates[np.argmax(_scores(arcs, candidates, tuned.frame_tolerance))]


def _scores(arcs: Arcs, frames: FloatArray, tolerance: float) -> FloatArray:
    """Length of the edges that point along an axis of each frame, each edge counted less the more it deviates."""
    scores = []
    for some in np.array_split(frames, max(1, len(frames) // 64)):
        deviation = np.abs(arcs.deviation(some)).min(axis=1)
        scores.append(np.maximum(0.0, 1.0 - (deviation / tolerance) ** 2) @ arcs.length)
    return np.concatenate(scores)


def _upright(rotation: FloatArray) -> FloatArray:
    """The same axes, named so that z is nearest to the zenith and y nearest to the panorama's centre column."""
    vertical = int(np.argmax(np.abs(rotation[:, 2])))
    z = rotation[vertical] * np.sign(rotation[vertical, 2])
    others = [axis * sign for index, axis in enumerate(rotation) if index != vertical for sign in (1.0, -1.0)]
    y = max(others, key=lambda axis: axis[1])
    return np.stack([np.cross(y, z), y, z])


def _refine(arcs: Arcs, rotation: FloatArray, tuned: CalibrationParameters) -> FloatArray:
    """Least squares of the deviations, long edges counting more, with Tukey's weights, at first more tolerant."""
    for step in range(tuned.frame_steps):
        tolerance = tuned.frame_tolerance * max(1.0, 2.0 - 0.25 * step)
        deviation = arcs.deviation(rotation)
        nearest = np.abs(deviation).argmin(axis=0)
        error = np.take_along_axis(deviation, nearest[None], axis=0)[0]
        weight = np.maximum(0.0, 1.0 - (error / tolerance) ** 2) ** 2
        weight[nearest != 2] *= tuned.frame_horizontal_weight
        weight /= 1.0 + np.radians(tuned.frame_short) / arcs.length
        # Turning the frame by a small rotation vector r about light space's axes changes n . a by r . (a x n).
        leverage = np.take_along_axis(arcs.leverage(rotation), nearest[None], axis=0)[0]
        slope = np.cross(rotation[nearest], arcs.normal) * leverage[:, None]
        curvature = (slope * weight[:, None]).T @ slope
        turn = np.linalg.lstsq(curvature, -(slope * weight[:, None]).T @ np.radians(error), rcond=1e-9)[0]
        rotation = rotation @ Rotation.from_rotvec(turn).as_matrix().T
    return rotation


def _nearest_quarter_turn(rotation: FloatArray, reference: FloatArray) -> FloatArray:
    """The rotation with its heading changed by quarter turns to be nearest to the reference's."""
    quarter = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    turns = [np.linalg.matrix_power(quarter, count) @ rotation for count in range(4)]
    return max(turns, key=lambda turned: float(np.sum(turned * reference)))
