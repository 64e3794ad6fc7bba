"""What one panorama says for and against every wall that a box-shaped room could have there.

All evidence is in tables, so that a box is scored by a few look-ups. A wall at a distance has a floor edge, whose place in
the picture depends on the distance, and a ceiling edge, whose place depends on the distance over the ceiling's height.
For both the tables hold running sums along the wall. Five things are evidence:

- straight edges found along the wall's direction, by how rare they are at that elevation in this picture (so that a
  hit among the horizontal edges of furniture counts little);
- a step of colour that stays the same along the edge, apart from the slope of the light;
- what lies on the two sides of an edge: colours as of the floor at the camera's feet, or of the ceiling overhead;
- found edges that would point out of their wall, or stand upright on the ceiling: contradictions, which weigh most;
- whether floor, walls and ceiling have the colours that they should, as areas.

Furniture hides the floor's edges more often than the ceiling's, so that a missing floor edge says less.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, uniform_filter1d

from lightdepth.calibration.room_frame import RoomFrame
from lightdepth.directions import FloatArray, direction_to_latlong, pixel_directions
from lightdepth.images.tonemapping import LUMINANCE
from lightdepth.parameters.reconstruction import DEFAULT, BoxParameters

ANGLES = np.radians(np.arange(-87.5, 88.0, 1.0))
"""Azimuths within a wall, from its normal."""
CORNERS = ((0, 2), (1, 2), (1, 3), (0, 3))
"""Walls that meet, in the order -x, +x, -y, +y."""
NORMALS = np.array([[-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 1.0, 0.0]])
TANGENTS = np.array([[0.0, 1.0, 0.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [1.0, 0.0, 0.0]])
UP = np.array([0.0, 0.0, 1.0])


class RoomEvidence:
    """The tables of one panorama.

    Boxes are (n, 5) arrays: distances of the walls at -x, +x, -y, +y, and of the ceiling, in camera heights.

    Args:
        radiance: the panorama, linear RGB, shape (height, 2 height, 3).
        frame: the room's directions and the straight edges found in the picture.
        tuned: what counts as evidence, and how much.
    """

    def __init__(self, radiance: NDArray[np.float32], frame: RoomFrame, tuned: BoxParameters = DEFAULT.box) -> None:
        self.tuned = tuned
        self.edges = _edge_maps(frame, tuned)
        self.colours = cv2.blur(_colour_map(radiance, frame, tuned.rows), (3, 3))
        # Distances of walls, and distances over the ceiling's height above the camera.
        self._distances = np.geomspace(tuned.least_distance, tuned.greatest_distance, tuned.distances)
        self._ratios = np.geomspace(tuned.least_ratio, tuned.greatest_ratio, tuned.ratios)
        upright = self._upright(tuned.hidden_upright)
        below = self._edge_tables(self._distances, -1.0, tuned.hidden_below, tuned.below_sides)
        above = tuned.above_weight * self._edge_tables(
            self._ratios, 1.0, tuned.hidden_above, tuned.above_sides / tuned.above_weight
        )
        above, below = self._add_contradictions(frame, above, below)
        for sign, grid, table in ((-1.0, self._distances, below), (1.0, self._ratios, above)):
            self._add_areas(sign, grid, table)
        self._below, self._above, self._uprights = (_running_sum(table) for table in (below, above, upright))

    def scores(self, boxes: FloatArray) -> FloatArray:
        """Logarithm of how much likelier the picture is with the box than without, but for its scale, shape (n,)."""
        *walls, ceiling = boxes.T
        return sum((self.corner(x, y, walls[x], walls[y], ceiling) for x, y in CORNERS), np.zeros(len(boxes)))

    def corner(self, x: int, y: int, along_x: FloatArray, along_y: FloatArray, ceiling: FloatArray) -> FloatArray:
        """One corner's share of the score: the sum of a box's four is its score.

        The evidence along a wall is a running sum at its one end less that at its other end, and each end is a corner.

        Args:
            x: 0 or 1, its wall at -x or +x.
            y: 2 or 3, its wall at -y or +y.
            along_x: distances of the former, camera heights; this and the following are broadcast.
            along_y: of the latter.
            ceiling: of the ceiling.
        """
        side_x, side_y = (-1.0 if wall % 2 == 0 else 1.0 for wall in (x, y))
        total = self._upright_sum(side_x * along_x, side_y * along_y, ceiling)
        for wall, distance, side, end in ((x, along_x, side_y, along_y), (y, along_y, side_x, along_x)):
            angle = np.rint(np.degrees(np.arctan2(side * end, distance)) + 88.0).astype(int).clip(0, len(ANGLES))
            total += side * self._below[wall, _rows(self._distances, distance), angle]
            total += side * self._above[wall, _rows(self._ratios, distance / ceiling), angle]
        return total

    def _upright_sum(self, x: FloatArray, y: FloatArray, ceiling: FloatArray) -> FloatArray:
        column = np.rint(np.degrees(np.arctan2(x, y)) * 2.0).astype(int) % 720
        far = np.hypot(x, y)
        bottom, top = (
            np.rint(np.degrees(np.arctan2(height, far)) + 80.0).astype(int).clip(0, 160) for height in (-1.0, ceiling)
        )
        return np.asarray(self._uprights[column, top] - self._uprights[column, bottom])

    def _edge_tables(self, grid: FloatArray, up: float, hidden: float, sides: float) -> FloatArray:
        """Evidence of floor (``up`` = -1) or ceiling edges by wall, distance and azimuth."""
        tuned = self.tuned
        near = self._likeness(up, (-tuned.beside_other, tuned.beside_own))
        found, steps, lengths, elevations, around = [], [], [], [], []
        for wall in range(4):
            tangent = TANGENTS[wall]
            points = _unit(grid[:, None, None] * (NORMALS[wall] + np.tan(ANGLES)[None, :, None] * tangent) + up * UP)
            lengths.append(np.linalg.norm(np.gradient(points, axis=1), axis=-1))
            elevations.append((np.degrees(np.arcsin(np.abs(points[..., 2]))) / 5.0).astype(int).clip(0, 17))
            found.append(self.edges[1 if wall < 2 else 0][self.cells(points)])
            across = _unit(np.cross(np.broadcast_to(tangent, points.shape), points)) * np.tan(np.radians(tuned.beside))
            steps.append(self._steady_step([self.cells(points + offset * across) for offset in (-1.5, -0.5, 0.5, 1.5)]))
            inward = np.where((points + across)[..., 2] * up > points[..., 2] * up, 1.0, -1.0)[..., None] * across
            inside, outside = (
                0.5 * sum(near[self.cells(points + sign * offset * inward)] for offset in (0.8, 2.0))
                for sign in (1.0, -1.0)
            )
            around.append(
                np.clip(np.log(2.0 * inside + 1e-3), -0.4, 0.7)
                + np.clip(np.log(2.0 * (1.0 - outside) + 1e-3), -2.0, 0.7)
            )
        weights, bands = np.stack(lengths), np.stack(elevations)
        arcs, colours = np.stack(found), np.stack(steps)
        rates = (_by_band(values, weights, bands)[bands] for values in (arcs, colours))
        evidence = self._odds(arcs, next(rates), hidden) + _step_odds(colours, next(rates)) + sides * np.stack(around)
        return np.asarray(evidence * weights / np.radians(tuned.correlated))

    def _upright(self, hidden: float) -> FloatArray:
        """Evidence of upright edges by azimuth (half degrees) and elevation (degrees from -80)."""
        azimuth, elevation = np.radians(np.arange(0.0, 360.0, 0.5)), np.radians(np.arange(-80.0, 80.0))

        def at(offset: float) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
            turned = azimuth + offset * np.radians(self.tuned.beside)
            return self.cells(
                np.stack(
                    [
                        np.sin(turned)[:, None] * np.cos(elevation),
                        np.cos(turned)[:, None] * np.cos(elevation),
                        np.broadcast_to(np.sin(elevation), (len(turned), len(elevation))),
                    ],
                    axis=-1,
                )
            )

        arcs = self.edges[2][at(0.0)]
        steps = self._steady_step([at(offset) for offset in (-1.5, -0.5, 0.5, 1.5)])
        middle = np.abs(elevation) < np.radians(40.0)
        evidence = self._odds(arcs, arcs[:, middle].mean(), hidden) + _step_odds(steps, steps[:, middle].mean())
        return np.asarray(self.tuned.upright_weight * evidence / self.tuned.correlated)

    def _steady_step(self, places: list[tuple[NDArray[np.intp], NDArray[np.intp]]]) -> FloatArray:
        """How clear and even a step of colour is between the second and the third of four places, in [0, 1]."""
        along = self.tuned.along
        first, second, third, fourth = (self.colours[place] for place in places)
        # Light slopes on both sides as well; only what is more than that is an edge.
        step = (third - second) - 0.5 * ((fourth - third) + (second - first))
        usual = uniform_filter1d(step, along, axis=1, mode="nearest")
        unsteady = uniform_filter1d(np.abs(step - usual).sum(axis=-1), along, axis=1, mode="nearest")
        size = np.abs(usual).sum(axis=-1)
        return np.asarray(size / (size + unsteady + self.tuned.small_step))

    def _likeness(self, up: float, others: tuple[float, float]) -> NDArray[np.float32]:
        """Probability of the colours of floor or ceiling rather than those of other elevations, shape (h, 2h)."""
        rows, wall_colours = self.tuned.rows, self.tuned.wall_colours
        elevation = (90.0 - (np.arange(rows) + 0.5) * 180.0 / rows)[:, None] * np.ones((1, 2 * rows))
        steps = np.rint(self.colours / np.array([0.25, 0.15, 0.15])).astype(int)
        steps -= steps.min(axis=(0, 1))
        shape = tuple(steps.max(axis=(0, 1)) + 1)
        index = np.ravel_multi_index(tuple(np.moveaxis(steps, -1, 0)), shape)
        histograms = []
        turned = up * elevation
        walls = (
            (turned > others[0]) & (turned < others[1])
            if others[0] < 0.0
            else (elevation > 0) & (elevation < wall_colours)
        )
        for chosen in (turned > self.tuned.own_colours, walls):
            weights = np.cos(np.radians(elevation[chosen]))
            counts = np.bincount(index[chosen], weights, int(np.prod(shape))).reshape(shape)
            histograms.append(gaussian_filter(counts, 0.7) / max(float(counts.sum()), 1e-12))
        own, other = histograms
        return cv2.blur(((own + 3e-4) / (own + other + 6e-4)).ravel()[index].astype(np.float32), (5, 5))

    def _add_contradictions(
        self, frame: RoomFrame, above: FloatArray, below: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Add what found edges say of the surfaces that they would lie on."""
        tuned = self.tuned
        contradiction, agreement = np.log(tuned.contradiction), np.log(tuned.agreement)
        points, axes, weights = _edge_points(frame, tuned)
        for wall in range(4):
            forward = points @ NORMALS[wall]
            azimuth = np.degrees(np.arctan2(points @ TANGENTS[wall], forward))
            column = (azimuth + 88.0).astype(int).clip(0, len(ANGLES) - 1)
            on_wall = np.where(axes == (0 if wall < 2 else 1), contradiction, agreement)
            for is_above, grid, table in ((True, self._ratios, above), (False, self._distances, below)):
                here = (np.abs(azimuth) < 88.0) & ((points[:, 2] > 0.0) == is_above)
                weight = (tuned.above_horizon if is_above else tuned.below_horizon) * weights[here]
                share = tuned.on_ceiling if is_above else tuned.on_floor
                on_level = np.where(axes[here] == 2, share * contradiction, agreement)
                # Of a wall farther away than this, the edge lies in front: on the ceiling or the floor.
                limit = forward[here] / np.maximum(np.abs(points[here, 2]), 1e-9)
                change = np.zeros((len(grid) + 1, len(ANGLES)))
                np.add.at(change[0], column[here], weight * on_wall[here])
                row = np.searchsorted(grid, limit)
                np.add.at(change, (row, column[here]), weight * (on_level - on_wall[here]))
                table[wall] += np.cumsum(change, axis=0)[:-1]
        return above, below

    def _add_areas(self, up: float, grid: FloatArray, table: FloatArray) -> None:
        """Add whether floor or ceiling, and the walls beside them, have their colours."""
        likeness = self._likeness(up, (0.0, self.tuned.wall_colours))
        elevation = np.radians(np.arange(0.5, 90.0))
        edge = np.rint(np.degrees(np.arctan(np.cos(ANGLES) / grid[:, None]))).astype(int).clip(0, 90)
        column = np.arange(len(ANGLES))[None]
        for wall in range(4):
            level = np.cos(ANGLES)[:, None] * NORMALS[wall] + np.sin(ANGLES)[:, None] * TANGENTS[wall]
            points = np.cos(elevation)[:, None] * level[:, None] + up * np.sin(elevation)[:, None] * UP
            share = likeness[self.cells(points)]
            area = self.tuned.areas * np.cos(elevation) / self.tuned.correlated**2
            flat, upright = (
                _running_sum(np.clip(np.log(2.0 * part + 0.02), -1.5, 0.5) * area) for part in (share, 1.0 - share)
            )
            table[wall] += flat[column, 90] - flat[column, edge] + upright[column, edge]

    def cells(self, directions: FloatArray) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Rows and columns of the maps at directions of the room frame."""
        return _cells(directions, self.tuned.rows)

    def _odds(self, found: FloatArray, rate: FloatArray | float, hidden: float) -> FloatArray:
        """Logarithm of the odds that an edge of the room is there, by whether one is found where they are as rare."""
        seen = self.tuned.found
        usual = np.clip(rate, self.tuned.rarest, 0.9)
        there = np.log(hidden + (1.0 - hidden) * seen / usual)
        missing = np.log(hidden + (1.0 - hidden) * (1.0 - seen) / (1.0 - usual))
        return np.where(usual > seen, 0.0, found * there + (1.0 - found) * missing)


def _cells(directions: FloatArray, rows: int) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    u, v = direction_to_latlong(_unit(directions))
    return (v * rows).astype(int).clip(0, rows - 1), (u * 2 * rows).astype(int) % (2 * rows)


def _rows(grid: FloatArray, values: FloatArray) -> NDArray[np.intp]:
    """Nearest entries of a geometric sequence."""
    rows = np.rint(np.log(values / grid[0]) / np.log(grid[1] / grid[0])).astype(int)
    return np.asarray(rows.clip(0, len(grid) - 1))


def _unit(vectors: FloatArray) -> FloatArray:
    return np.asarray(vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12))


def _running_sum(table: FloatArray) -> FloatArray:
    """Sums along the last axis, from 0 on."""
    return np.concatenate([np.zeros((*table.shape[:-1], 1)), np.cumsum(table, axis=-1)], axis=-1)


def _step_odds(step: FloatArray, rate: FloatArray | float) -> FloatArray:
    """What :meth:`RoomEvidence._odds` is for edges, for steps of colour, roughly."""
    return np.clip(4.0 * (step - np.maximum(rate, 0.2) - 0.1), -0.7, 2.0)


def _by_band(values: FloatArray, weights: FloatArray, bands: NDArray[np.int_]) -> FloatArray:
    """Weighted means within 5 degrees of elevation, smoothed over its neighbours, shape (18,)."""
    sums = [np.bincount(bands.ravel(), part.ravel(), 18) for part in (values * weights, weights)]
    top, bottom = (np.convolve(np.pad(part, 2, mode="edge"), [0.5, 1.0, 1.0, 1.0, 0.5], "valid") for part in sums)
    return np.asarray(top / np.maximum(bottom, 1e-9))


def _edge_points(frame: RoomFrame, tuned: BoxParameters) -> tuple[FloatArray, NDArray[np.int_], FloatArray]:
    """Points every degree along the found edges, room frame, the axis that each lies along, and its weight."""
    points, axes, weights = [np.zeros((0, 3))], [np.zeros(0, int)], [np.zeros(0)]
    for ends, axis, length in zip(frame.arcs.ends, frame.axis, np.degrees(frame.arcs.length), strict=True):
        if axis < 0:
            continue
        count = max(1, int(length))
        share = ((np.arange(count) + 0.5) / count)[:, None]
        points.append(_unit(((1.0 - share) * ends[0] + share * ends[1]) @ frame.rotation.T))
        axes.append(np.full(count, axis))
        weights.append(np.full(count, length / count * min(1.0, length / tuned.long_contradiction) / tuned.correlated))
    return np.concatenate(points), np.concatenate(axes), np.concatenate(weights)


def _edge_maps(frame: RoomFrame, tuned: BoxParameters) -> NDArray[np.float32]:
    """For each axis how much a place of the room frame's panorama lies on an edge along it, in [0, 1], shape (3, h, 2h)."""
    rows = tuned.rows
    maps = np.zeros((3, rows, 2 * rows), np.float32)
    pixel = 180.0 / rows
    for ends, axis, length in zip(frame.arcs.ends, frame.axis, np.degrees(frame.arcs.length), strict=True):
        if axis < 0:
            continue
        share = np.linspace(0.0, 1.0, 2 + int(2.0 * length / pixel))[:, None]
        line = ((1.0 - share) * ends[0] + share * ends[1]) @ frame.rotation.T
        np.maximum.at(
            maps[axis], _cells(line, rows), np.float32(np.clip(length / tuned.long_edge, tuned.short_edge, 1.0))
        )
    farthest = int(3.0 * tuned.edge_blur / pixel)
    margin = farthest + 1
    wrapped = np.pad(maps, ((0, 0), (0, 0), (margin, margin)), mode="wrap")
    spread = np.zeros_like(maps)
    for reach in range(farthest + 1):
        disk = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
        weight = np.float32(np.exp(-0.5 * (reach * pixel / tuned.edge_blur) ** 2))
        for axis in range(3):
            grown = cv2.dilate(wrapped[axis], disk)[:, margin:-margin]
            spread[axis] = np.maximum(spread[axis], weight * grown)
    return spread


def _colour_map(radiance: NDArray[np.float32], frame: RoomFrame, rows: int) -> NDArray[np.float32]:
    """Logarithms of luminance and of two ratios of colours, in the room frame, shape (h, 2h, 3)."""
    small = np.maximum(cv2.resize(radiance, (2 * rows, rows), interpolation=cv2.INTER_AREA), 0.0)
    luminance = small @ LUMINANCE
    middle = float(np.median(luminance)) or 1.0
    safe = np.maximum(small, 1e-4 * middle)
    logarithm = np.log(safe / middle)
    # Beyond three natural logarithms there are lamps and black corners, whose differences mean no more.
    brightness = np.log(np.maximum(luminance, 1e-4 * middle) / middle)
    ratios = 2.0 * (logarithm[..., (0, 2)] - logarithm[..., (1, 1)])
    colours = np.clip(np.concatenate([brightness[..., None], ratios], axis=-1), -3.0, 3.0).astype(np.float32)
    u, v = direction_to_latlong(pixel_directions(rows, 2 * rows) @ frame.rotation)
    margin = 2
    wrapped = np.concatenate([colours[:, -margin:], colours, colours[:, :margin]], axis=1)
    at = (u * 2 * rows - 0.5 + margin).astype(np.float32), (v * rows - 0.5).astype(np.float32)
    return cv2.remap(wrapped, *at, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
