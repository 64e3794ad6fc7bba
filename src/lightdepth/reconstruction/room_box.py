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
from lightdepth.reconstruction.room_evidence import RoomEvidence, cells

POINTS = 24
"""Looked up along each edge of the box at its end."""
CLOSE_BESIDE = 0.6
"""Degrees on either side of an edge at which colours are compared at the end."""
SMALL_DIFFERENCE = 0.06
"""Differences of colour (natural logarithm) that mean little there."""
USUAL_HEIGHT, HEIGHT_SPREAD, HEIGHT_WEIGHT = 2.75, 0.25, 11.5
"""Metres from floor to ceiling, the spread of its logarithm, and the weight of the expectation."""
LOWEST, LOWEST_SPREAD, LOWEST_WEIGHT = 2.3, 0.06, 4.0
"""Metres below which rooms are rare; how soon (natural logarithm), and the weight."""
MIDDLE_WEIGHT = 20.0
"""Weight of the expectation that the camera stands about as far from all walls (squares of logarithms)."""
NEAREST, FARTHEST = 0.3, 9.0
"""Distances of walls that are tried, camera heights."""
NEAR = 0.04
"""By how much (natural logarithm) edges are moved at the end, at most."""
GUESSED = 0.4
"""From this share of evidence on, a box is taken for the room."""


@dataclass(frozen=True)
class RoomBox:
    """A box around the capture point, whose floor is one camera height below it.

    Attributes:
        low: its least coordinates in the room's frame seen from the capture point, camera heights, shape (3,).
        high: its greatest coordinates, likewise.
        evidence: share of the length of its edges, as seen, along which the picture shows an edge, in [0, 1].
    """

    low: FloatArray
    high: FloatArray
    evidence: float

    @property
    def is_likely(self) -> bool:
        """Whether the picture shows enough of the box's edges."""
        return self.evidence >= GUESSED


def fit_room_box(radiance: NDArray[np.float32], frame: RoomFrame, camera_height: float) -> RoomBox:
    """Find the box whose edges the picture shows best.

    Args:
        radiance: the panorama, linear RGB, shape (height, 2 height, 3).
        frame: the room's directions and the straight edges found in the picture.
        camera_height: of the capture point above the floor, metres; with it a ceiling of usual height is expected.
    """
    evidence = RoomEvidence(radiance, frame)
    box = _settle(evidence, _search(evidence, camera_height))
    left, right, back, front, ceiling = box
    shown, angles = _shown(evidence, box[None])
    share = float(np.average(shown[0], weights=angles[0]))
    return RoomBox(np.array([-left, -back, -1.0]), np.array([right, front, ceiling]), share)


def _expected(boxes: FloatArray, camera_height: float) -> FloatArray:
    """What is usual of rooms, in the units of the evidence, shape (n,)."""
    height = (1.0 + boxes[:, 4]) * camera_height
    unusual = HEIGHT_WEIGHT * np.log1p((np.log(height / USUAL_HEIGHT) / HEIGHT_SPREAD) ** 2)
    low = np.maximum(np.log(LOWEST / height) / LOWEST_SPREAD, 0.0)
    walls = np.log(boxes[:, :4])
    aside = MIDDLE_WEIGHT * ((walls - walls.mean(axis=1, keepdims=True)) ** 2).sum(axis=1)
    return -np.asarray(unusual + LOWEST_WEIGHT * np.minimum(low**2, 12.0) + aside)


def _search(evidence: RoomEvidence, camera_height: float) -> FloatArray:
    """Move two walls at a time to where they score best, for many heights of the ceiling; then all by small steps."""

    def scores(boxes: FloatArray) -> FloatArray:
        return evidence.scores(boxes) + _expected(boxes, camera_height)

    random = np.random.default_rng(0)
    distances = np.geomspace(NEAREST, FARTHEST, 76)
    first, second = (part.ravel() for part in np.meshgrid(distances, distances))
    pairs = list(combinations(range(4), 2))
    found: list[tuple[float, FloatArray]] = []
    for ceiling in np.geomspace(0.3, 3.6, 30):
        for walls in (np.full(4, 1.5 * min(ceiling, 1.3)), random.choice(distances[15:50], 4)):
            box, last = np.array([*walls, ceiling]), -np.inf
            while True:
                for pair in random.permutation(len(pairs)):
                    tried = np.repeat(box[None], len(first), axis=0)
                    tried[:, pairs[pair][0]], tried[:, pairs[pair][1]] = first, second
                    value = scores(tried)
                    box = tried[np.argmax(value)]
                if value.max() <= last + 1e-6:
                    break
                last = float(value.max())
            found.append((last, box))
    found.sort(key=lambda item: -item[0])
    best = []
    for _, start in found[:6]:
        box = start
        for size in 0.05 * 0.75 ** np.arange(8):
            steps = random.normal(0.0, size, (600, 5)) + random.normal(0.0, size, (600, 1))
            tried = np.concatenate([box[None], box * np.exp(steps)])
            value = scores(tried)
            box = tried[np.argmax(value)]
        best.append((float(value.max()), box))
    return max(best, key=lambda item: item[0])[1]


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
    box, size = start, 0.02
    while size > 0.002:
        tried = np.clip(box * np.exp(size * steps), start * np.exp(-NEAR), start * np.exp(NEAR))
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
    ends = _ends(boxes)
    angles = np.arccos(np.clip(np.sum(ends[:, :, 0] * ends[:, :, 1], axis=-1), -1.0, 1.0))
    share = (np.arange(POINTS) + 0.5) / POINTS
    sine = np.maximum(np.sin(angles), 1e-9)[..., None]
    first, second = (np.sin(part * angles[..., None]) / sine for part in (1.0 - share, share))
    points = first[..., None] * ends[:, :, None, 0] + second[..., None] * ends[:, :, None, 1]
    arcs = evidence.edges[(_AXIS[None, :, None], *cells(points))].mean(axis=-1)
    across = np.cross(ends[:, :, 0], ends[:, :, 1])
    across *= np.tan(np.radians(CLOSE_BESIDE)) / np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-12)
    one, other = (evidence.colours[cells(points + sign * across[:, :, None])] for sign in (1.0, -1.0))
    step = one - other
    usual = np.median(step, axis=2)
    unsteady = np.median(np.abs(step - usual[:, :, None]).sum(axis=-1), axis=2)
    size = np.abs(usual).sum(axis=-1)
    colours = size / (size + unsteady + SMALL_DIFFERENCE)
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
