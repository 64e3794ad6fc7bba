"""A box fitted to a room's edges in one panorama: the first guess of the walls, without a click.

The box's sides lie along the room's directions. The best box is searched from many starts in the evidence that the picture
holds (:mod:`lightdepth.reconstruction.room_evidence`), and its edges are then moved onto the nearest ones of the picture.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from lightdepth.calibration.room_frame import RoomFrame
from lightdepth.directions import FloatArray
from lightdepth.parameters.reconstruction import DEFAULT, BoxParameters
from lightdepth.reconstruction.room_evidence import CORNERS, RoomEvidence


@dataclass(frozen=True)
class RoomBox:
    """A box around the capture point, whose floor is one camera height below it.

    Attributes:
        low: its least coordinates in the room's frame seen from the capture point, camera heights, shape (3,).
        high: its greatest coordinates, likewise.
        evidence: share of the length of its edges, as seen, along which the picture shows an edge, in [0, 1].
        is_likely: whether that is enough to take the box for the room.
    """

    low: FloatArray
    high: FloatArray
    evidence: float
    is_likely: bool


def fit_room_box(
    radiance: NDArray[np.float32], frame: RoomFrame, camera_height: float, tuned: BoxParameters = DEFAULT.box
) -> RoomBox:
    """Find the box whose edges the picture shows best.

    Args:
        radiance: the panorama, linear RGB, shape (height, 2 height, 3).
        frame: the room's directions and the straight edges found in the picture.
        camera_height: of the capture point above the floor, metres; with it a ceiling of usual height is expected.
        tuned: what counts as evidence, what is expected, and how it is searched.
    """
    evidence = RoomEvidence(radiance, frame, tuned)
    box = _settle(evidence, _search(evidence, camera_height))
    left, right, back, front, ceiling = box
    shown, angles = _shown(evidence, box[None])
    share = float(np.average(shown[0], weights=angles[0]))
    return RoomBox(np.array([-left, -back, -1.0]), np.array([right, front, ceiling]), share, share >= tuned.likely)


def _usual_height(ceiling: FloatArray, camera_height: float, tuned: BoxParameters) -> FloatArray:
    """What is usual of the heights of rooms, in the units of the evidence, shape of ``ceiling``."""
    height = (1.0 + ceiling) * camera_height
    unusual = tuned.height_weight * np.log1p((np.log(height / tuned.usual_height) / tuned.height_spread) ** 2)
    low = np.maximum(np.log(tuned.low_height / height) / tuned.low_spread, 0.0)
    return -np.asarray(unusual + tuned.low_weight * np.minimum(low**2, 12.0))


def _aside(one: FloatArray, other: FloatArray, weight: float) -> FloatArray:
    """The same of the distances of two walls; a sum over all pairs is over the squares of what each is off the mean."""
    return np.asarray(-0.25 * weight * np.log(one / other) ** 2)


def _search(evidence: RoomEvidence, camera_height: float) -> FloatArray:
    """The best box of a grid, then by small steps from it and from the best for other heights of the ceiling."""
    tuned = evidence.tuned

    def scores(boxes: FloatArray) -> FloatArray:
        asides = sum(
            _aside(boxes[:, one], boxes[:, other], tuned.middle_weight) for one, other in combinations(range(4), 2)
        )
        return np.asarray(evidence.scores(boxes) + _usual_height(boxes[:, 4], camera_height, tuned) + asides)

    ceilings = np.geomspace(tuned.lowest_ceiling, tuned.highest_ceiling, tuned.ceilings)
    found = np.concatenate([_best_walls(evidence, ceiling) for ceiling in ceilings])
    random = np.random.default_rng(0)
    best = []
    for start in found[np.argsort(-scores(found))[: tuned.starts]]:
        box = start
        for size in 0.05 * 0.75 ** np.arange(8):
            steps = random.normal(0.0, size, (tuned.tries, 5)) + random.normal(0.0, size, (tuned.tries, 1))
            tried = np.concatenate([box[None], box * np.exp(steps)])
            value = scores(tried)
            box = tried[np.argmax(value)]
        best.append((float(value.max()), box))
    return max(best, key=lambda item: item[0])[1]


def _best_walls(evidence: RoomEvidence, ceiling: float) -> FloatArray:
    """The best boxes of a grid with this ceiling, shape (n, 5).

    A box's score is a sum over its corners, each of which depends on two walls: for every pair of walls along x, the best
    walls at -y and at +y are found independently of each other.
    """
    tuned = evidence.tuned
    walls = np.geomspace(tuned.nearest_wall, tuned.farthest_wall, tuned.walls)
    one, other = walls[:, None], walls[None]
    apart = _aside(one, other, tuned.middle_weight)
    corners = [
        (evidence.corner(x, y, one, other, np.full((1, 1), ceiling)) + apart).astype(np.float32) for x, y in CORNERS
    ]
    left_back, right_back, right_front, left_front = corners
    back, front = left_back[:, None] + right_back, left_front[:, None] + right_front
    value = back.max(axis=-1) + front.max(axis=-1) + apart
    left, right = np.unravel_index(np.argsort(-value, axis=None)[: tuned.pairs], value.shape)
    # What is usual of the walls along y together is not a sum over corners.
    both = back[left, right][:, :, None] + front[left, right][:, None] + apart
    at_back, at_front = np.unravel_index(both.reshape(len(left), -1).argmax(axis=1), apart.shape)
    best = [walls[index] for index in (left, right, at_back, at_front)]
    return np.stack([*best, np.full(len(left), ceiling)], axis=1)


def _settle(evidence: RoomEvidence, start: FloatArray) -> FloatArray:
    """Smaller and smaller steps of one distance, of all, of all walls, and of opposite walls, near a box."""
    directions = np.concatenate(
        [
            np.eye(5),
            np.ones((1, 5)),
            [[1, 1, 1, 1, 0], [1, 1, 0, 0, 0], [0, 0, 1, 1, 0], [1, -1, 0, 0, 0], [0, 0, 1, -1, 0]],
        ]
    )
    steps = np.concatenate([np.zeros((1, 5)), directions, -directions])
    box, size, farthest = start, 0.02, evidence.tuned.settled
    while size > 0.002:
        tried = np.clip(box * np.exp(size * steps), start * np.exp(-farthest), start * np.exp(farthest))
        shown, angles = _shown(evidence, tried, together=False)
        best = int(np.argmax((shown * angles).sum(axis=1)))
        if best:
            box = tried[best]
        else:
            size /= 2.0
    return box


def _shown(evidence: RoomEvidence, boxes: FloatArray, together: bool = True) -> tuple[FloatArray, FloatArray]:
    """For each edge of each box, how well the picture shows it, and its length as seen, radian, shape (n, 12).

    With ``together`` the better of found edges and differing colours, in [0, 1], else their sum.
    """
    tuned = evidence.tuned
    ends = _ends(boxes)
    angles = np.arccos(np.clip(np.sum(ends[:, :, 0] * ends[:, :, 1], axis=-1), -1.0, 1.0))
    share = (np.arange(tuned.settled_points) + 0.5) / tuned.settled_points
    sine = np.maximum(np.sin(angles), 1e-9)[..., None]
    first, second = (np.sin(part * angles[..., None]) / sine for part in (1.0 - share, share))
    points = first[..., None] * ends[:, :, None, 0] + second[..., None] * ends[:, :, None, 1]
    arcs = evidence.edges[(_AXIS[None, :, None], *evidence.cells(points))].mean(axis=-1)
    across = np.cross(ends[:, :, 0], ends[:, :, 1])
    across *= np.tan(np.radians(tuned.settled_beside)) / np.maximum(
        np.linalg.norm(across, axis=-1, keepdims=True), 1e-12
    )
    one, other = (evidence.colours[evidence.cells(points + sign * across[:, :, None])] for sign in (1.0, -1.0))
    step = one - other
    usual = np.median(step, axis=2)
    unsteady = np.median(np.abs(step - usual[:, :, None]).sum(axis=-1), axis=2)
    size = np.abs(usual).sum(axis=-1)
    colours = size / (size + unsteady + tuned.settled_small_step)
    return np.maximum(arcs, colours) if together else arcs + colours, angles


_AXIS = np.array([0, 1, 0, 1, 0, 1, 0, 1, 2, 2, 2, 2])
"""Which axis each of the twelve edges lies along: the floor's four, the ceiling's four, the upright ones."""


def _ends(boxes: FloatArray) -> FloatArray:
    """Directions of the two ends of each edge, unit, room frame, shape (n, 12, 2, 3)."""
    left, right, back, front, ceiling = boxes.T
    plan = [(-left, -back), (right, -back), (right, front), (-left, front)]
    below = [np.stack([x, y, np.full_like(x, -1.0)], axis=-1) for x, y in plan]
    above = [np.stack([x, y, ceiling], axis=-1) for x, y in plan]
    edges = [(level[i], level[(i + 1) % 4]) for level in (below, above) for i in range(4)]
    edges += list(zip(below, above, strict=True))
    ends = np.stack([np.stack(edge, axis=1) for edge in edges], axis=1)
    return np.asarray(ends / np.linalg.norm(ends, axis=-1, keepdims=True))
