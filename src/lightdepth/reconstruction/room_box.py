"""A box fitted to a room's edges in one panorama: the first guess of the walls, without a click.

The box's sides lie along the room's directions. Its twelve edges are laid over the picture and scored by the straight
edges found along them, and by how evenly the colours on their two sides differ, which also reveals a faint edge between
white walls and a white ceiling. The best box is searched from many starts and refined.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.calibration.room_frame import RoomFrame
from lightdepth.directions import FloatArray, direction_to_latlong, pixel_directions
from lightdepth.images.tonemapping import LUMINANCE

HEIGHT = 512
"""Rows of the maps that are looked up."""
POINTS = 24
"""Looked up along each edge of the box."""
SPREAD = 1.0
"""Degrees (standard deviation) that a found edge may be off for it to count partly."""
LONG = 10.0
"""Degrees of length from which a found edge counts fully."""
BESIDE, CLOSE_BESIDE = 1.5, 0.6
"""Degrees on either side of an edge at which colours are compared, in the search and at its end."""
SMALL_DIFFERENCE = 0.06
"""Differences of colour (natural logarithm) that mean little."""
MISSING = np.array([0.25, 0.45, 0.35])
"""What a score of evidence must exceed to speak for an edge, on the floor, at the ceiling, and upright. Furniture hides
the floor's edges, so that their absence says less."""
COLOUR_SHARE = np.array([0.4, 0.6, 0.6])
"""Weight of differing colours beside found edges; furniture on the floor has such edges as well."""
USUAL_HEIGHT, HEIGHT_SPREAD, HEIGHT_WEIGHT = 2.75, 0.35, 0.25
"""Metres from floor to ceiling, the spread of its logarithm, and what the expectation counts beside a radian of edge."""
NEAREST, FARTHEST = 0.3, 9.0
"""Distances of walls that are tried, camera heights."""
GUESSED = 0.5
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
    return _Fit(radiance, frame, camera_height).best()


class _Fit:
    """Boxes are (n, 5) arrays: distances of the walls at -x, +x, -y, +y, and of the ceiling, in camera heights."""

    def __init__(self, radiance: NDArray[np.float32], frame: RoomFrame, camera_height: float) -> None:
        self._edges = _edge_maps(frame)
        self._colours = _colour_map(radiance, frame)
        self._camera_height = camera_height
        self._beside = BESIDE

    def best(self) -> RoomBox:
        random = np.random.default_rng(0)
        distances = np.geomspace(NEAREST, FARTHEST, 70)
        found: list[tuple[float, FloatArray]] = []
        for ceiling in np.geomspace(0.3, 4.0, 22):
            for start in range(3):
                walls = random.choice(distances[15:50], 4) if start else np.full(4, 1.5)
                found.append(self._climb(np.array([*walls, ceiling]), distances, random))
        found.sort(key=lambda item: -item[0])
        _, box = max((self._refine(*item, 0.08) for item in found[:5]), key=lambda item: item[0])
        self._beside = CLOSE_BESIDE
        _, box = self._refine(float(self.scores(box[None])[0]), box, 0.02)
        left, right, back, front, ceiling = box
        arcs, colours, angles = self._evidence(box[None])
        share = float(np.average(np.maximum(arcs, colours)[0], weights=angles[0]))
        return RoomBox(np.array([-left, -back, -1.0]), np.array([right, front, ceiling]), share)

    def _climb(self, box: FloatArray, distances: FloatArray, random: np.random.Generator) -> tuple[float, FloatArray]:
        """Move one wall at a time to where it scores best."""
        last = -np.inf
        while True:
            for wall in random.permutation(4):
                tried = np.repeat(box[None], len(distances), axis=0)
                tried[:, wall] = distances
                scores = self.scores(tried)
                box = tried[np.argmax(scores)]
            score = float(scores.max())
            if score <= last + 1e-6:
                return score, box
            last = score

    def _refine(self, score: float, box: FloatArray, size: float) -> tuple[float, FloatArray]:
        """Smaller and smaller steps of one distance, of all, of all walls, and of opposite walls."""
        directions = np.concatenate(
            [
                np.eye(5),
                np.ones((1, 5)),
                [[1, 1, 1, 1, 0], [1, 1, 0, 0, 0], [0, 0, 1, 1, 0], [1, -1, 0, 0, 0], [0, 0, 1, -1, 0]],
            ]
        )
        steps = np.concatenate([directions, -directions])
        while size > 0.002:
            tried = box * np.exp(size * steps)
            scores = self.scores(tried)
            if scores.max() > score + 1e-9:
                score, box = float(scores.max()), tried[np.argmax(scores)]
            else:
                size /= 2.0
        return score, box

    def scores(self, boxes: FloatArray) -> FloatArray:
        """How well the picture shows boxes, radian of edge, shape (n,)."""
        arcs, colours, angles = self._evidence(boxes)
        score = ((arcs + COLOUR_SHARE[_KIND] * colours - MISSING[_KIND]) * angles).sum(axis=1)
        off = np.log((1.0 + boxes[:, 4]) * self._camera_height / USUAL_HEIGHT) / HEIGHT_SPREAD
        return score - HEIGHT_WEIGHT * np.log1p(off**2)

    def _evidence(self, boxes: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """For each edge of each box: found edges, differing colours (in [0, 1]), and its length as seen, radian."""
        ends = _ends(boxes)
        angles = np.arccos(np.clip(np.sum(ends[:, :, 0] * ends[:, :, 1], axis=-1), -1.0, 1.0))
        share = (np.arange(POINTS) + 0.5) / POINTS
        sine = np.maximum(np.sin(angles), 1e-9)[..., None]
        first, second = (np.sin(part * angles[..., None]) / sine for part in (1.0 - share, share))
        points = first[..., None] * ends[:, :, None, 0] + second[..., None] * ends[:, :, None, 1]
        rows, columns = _cells(points)
        arcs = self._edges[_AXIS[None, :, None], rows, columns].mean(axis=-1)
        across = np.cross(ends[:, :, 0], ends[:, :, 1])
        across *= np.tan(np.radians(self._beside)) / np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-12)
        one, other = (self._colours[_cells(points + sign * across[:, :, None])] for sign in (1.0, -1.0))
        step = one - other
        usual = np.median(step, axis=2)
        unsteady = np.median(np.abs(step - usual[:, :, None]).sum(axis=-1), axis=2)
        size = np.abs(usual).sum(axis=-1)
        return arcs, size / (size + unsteady + SMALL_DIFFERENCE), angles


_AXIS = np.array([0, 1, 0, 1, 0, 1, 0, 1, 2, 2, 2, 2])
"""Which axis each of the twelve edges lies along: the floor's four, the ceiling's four, the upright ones."""
_KIND = np.array([0] * 4 + [1] * 4 + [2] * 4)


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


def _cells(directions: FloatArray) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Rows and columns of the maps at directions of the room frame."""
    u, v = direction_to_latlong(directions)
    return (v * HEIGHT).astype(int).clip(0, HEIGHT - 1), (u * 2 * HEIGHT).astype(int) % (2 * HEIGHT)


def _edge_maps(frame: RoomFrame) -> NDArray[np.float32]:
    """For each axis how much a place of the room frame's panorama lies on an edge along it, in [0, 1], shape (3, h, 2h)."""
    maps = np.zeros((3, HEIGHT, 2 * HEIGHT), np.float32)
    pixel = 180.0 / HEIGHT
    for ends, axis, length in zip(frame.arcs.ends, frame.axis, np.degrees(frame.arcs.length), strict=True):
        if axis < 0:
            continue
        share = np.linspace(0.0, 1.0, 2 + int(2.0 * length / pixel))[:, None]
        line = ((1.0 - share) * ends[0] + share * ends[1]) @ frame.rotation.T
        np.maximum.at(maps[axis], _cells(line), np.float32(np.clip(length / LONG, 0.3, 1.0)))
    margin = 16
    wrapped = np.pad(maps, ((0, 0), (0, 0), (margin, margin)), mode="wrap")
    spread = np.zeros_like(maps)
    for reach in range(int(3.0 * SPREAD / pixel) + 1):
        disk = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
        weight = np.float32(np.exp(-0.5 * (reach * pixel / SPREAD) ** 2))
        for axis in range(3):
            grown = cv2.dilate(wrapped[axis], disk)[:, margin:-margin]
            spread[axis] = np.maximum(spread[axis], weight * grown)
    return spread


def _colour_map(radiance: NDArray[np.float32], frame: RoomFrame) -> NDArray[np.float32]:
    """Logarithms of luminance and of two ratios of colours, in the room frame, shape (h, 2h, 3)."""
    small = np.maximum(cv2.resize(radiance, (2 * HEIGHT, HEIGHT), interpolation=cv2.INTER_AREA), 0.0)
    luminance = small @ LUMINANCE
    middle = float(np.median(luminance)) or 1.0
    safe = np.maximum(small, 1e-4 * middle)
    logarithm = np.log(safe / middle)
    # Beyond three natural logarithms there are lamps and black corners, whose differences mean no more.
    brightness = np.log(np.maximum(luminance, 1e-4 * middle) / middle)
    ratios = 2.0 * (logarithm[..., (0, 2)] - logarithm[..., (1, 1)])
    colours = np.clip(np.concatenate([brightness[..., None], ratios], axis=-1), -3.0, 3.0).astype(np.float32)
    u, v = direction_to_latlong(pixel_directions(HEIGHT, 2 * HEIGHT) @ frame.rotation)
    margin = 2
    wrapped = np.concatenate([colours[:, -margin:], colours, colours[:, :margin]], axis=1)
    at = (u * 2 * HEIGHT - 0.5 + margin).astype(np.float32), (v * HEIGHT - 0.5).astype(np.float32)
    return cv2.remap(wrapped, *at, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
