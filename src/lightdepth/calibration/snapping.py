"""Clicked corners moved to where the picture's edges meet."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.calibration.line_detection import display_brightness, sample_panorama
from lightdepth.calibration.rectangle import FloorRectangle, check_shape, put_in_order
from lightdepth.directions import FloatArray
from lightdepth.parameters.calibration import DEFAULT, CalibrationParameters


def snap_rectangle(
    radiance: NDArray[np.float32],
    rectangle: FloorRectangle,
    camera_height: float | None,
    click_error: float,
    tuned: CalibrationParameters = DEFAULT,
) -> tuple[FloorRectangle, list[str]]:
    """Move the corners to where edges seen along the rectangle's sides meet.

    A side's whole length counts, so that its edge is found to a fraction of a pixel, and one crossing thing does not
    mislead. The clicks are kept where a side shows no edge, and where what was found is no rectangle of the given
    measures.

    Args:
        radiance: the panorama, linear RGB, finite, shape (height, 2 height, 3).
        rectangle: as clicked.
        camera_height: metres above the floor, where known.
        click_error: standard deviation of a click along either axis, degrees.
        tuned: how edges are looked for.

    Returns:
        The rectangle, with the corners' own error where they were moved, and warnings.

    Raises:
        InputError: the four directions cannot be those of a rectangle's corners.
    """
    brightness = display_brightness(radiance)
    pixel = 360.0 / radiance.shape[1]
    ordered, _ = put_in_order(rectangle)
    corners = ordered.corners
    sides = []
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        sides.append(_find_edges(brightness, start, end, tuned.snap_reach * click_error, pixel, tuned))
        if not sides[-1]:
            names = [int(np.argmax((rectangle.corners == corner).all(axis=1))) + 1 for corner in (start, end)]
            return rectangle, [f"no edge is seen from corner {names[0]} to {names[1]}; the clicks were not moved"]
    for edges in sorted(product(*sides), key=lambda edges: -sum(likelihood for likelihood, _ in edges)):
        normals = np.array([normal for _, normal in edges])
        found = np.cross(np.roll(normals, 1, axis=0), normals)
        found /= np.linalg.norm(found, axis=1, keepdims=True)
        found *= np.sign(np.sum(found * corners, axis=1, keepdims=True))
        moved = np.degrees(np.arccos(np.clip(np.sum(found * corners, axis=1), -1.0, 1.0)))
        snapped = replace(ordered, corners=found, error=min(click_error, tuned.snap_error * pixel))
        if moved.max() < 1.5 * tuned.snap_reach * click_error and not check_shape(
            snapped, camera_height, click_error, tuned
        ):
            return snapped, []
    return rectangle, [
        "the edges seen along the rectangle's sides are not those of such a rectangle; the clicks were not moved"
    ]


def _find_edges(
    brightness: NDArray[np.float32],
    start: FloatArray,
    end: FloatArray,
    reach: float,
    pixel: float,
    tuned: CalibrationParameters,
) -> list[tuple[float, FloatArray]]:
    """The edges near a side; a rug's border has several.

    Args:
        brightness: the panorama's, shape (height, 2 height).
        start: the side's first corner, unit vector in light space.
        end: its second.
        reach: degrees across the side by which its ends may be off.
        pixel: size of a pixel, degrees.
        tuned: how they are looked for.

    Returns:
        For each the logarithm of its likelihood, and its great circle's unit normal, shape (3,).
    """
    normal = np.cross(start, end)
    normal /= np.linalg.norm(normal)
    half = np.arctan2(np.linalg.norm(start - end), np.linalg.norm(start + end))
    middle = (start + end) / np.linalg.norm(start + end)
    # Rows go along the side, columns across it, half a pixel each.
    step = np.radians(pixel / 2)
    along = np.linspace(-half, half, int(np.clip(2 * half / step, 24, 400))) * (1.0 - 2.0 * tuned.snap_corner)
    margin = int(np.ceil(reach / pixel * 2)) + 6
    across = step * np.arange(-margin, margin + 1)
    on_side = np.cos(along)[:, None] * middle + np.sin(along)[:, None] * np.cross(normal, middle)
    strip = sample_panorama(brightness, np.cos(across)[:, None] * on_side[:, None] + np.sin(across)[:, None] * normal)
    slope = cv2.Sobel(cv2.GaussianBlur(strip, (0, 0), tuned.snap_blur), cv2.CV_32F, 1, 0)
    # By how much a great circle lies off the side where its ends do by one.
    by_start, by_end = np.sin(half - along) / np.sin(2 * half), np.sin(half + along) / np.sin(2 * half)
    rows = np.arange(len(along), dtype=np.float32)

    def on_circles(picture: NDArray[np.float32], shifts: FloatArray) -> NDArray[np.float32]:
        """The picture along great circles whose ends are off by shifts, radian, shape (n, 2); shape (n, rows)."""
        columns = (shifts[:, :1] * by_start + shifts[:, 1:] * by_end) / step + margin
        return cv2.remap(picture, columns.astype(np.float32), np.broadcast_to(rows, columns.shape), cv2.INTER_LINEAR)

    # A long weak edge rather than a short strong one, and of two alike the one nearer to the clicks.
    grid = np.linspace(-1.0, 1.0, 2 * margin + 1)
    coarse = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
    score = np.abs(on_circles(np.sign(slope) * np.sqrt(np.abs(slope)), np.radians(reach) * coarse).mean(axis=1))
    likelihood = np.log(score + 1e-9) - 0.5 * np.sum(np.square(tuned.snap_reach / 2 * coarse), axis=1)
    grid = np.linspace(-step, step, 21)
    fine = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
    edges = []
    for _ in range(tuned.snap_most_edges):
        index = int(np.argmax(likelihood))
        nearby = np.radians(reach) * coarse[index] + fine
        best = nearby[np.argmax(np.abs(on_circles(slope, nearby).mean(axis=1)))]
        values = on_circles(slope, best[None])[0]
        if np.mean(values * np.sign(values.mean()) > 0) > tuned.snap_least_agreement:
            circle = np.cross(start + best[0] * normal, end + best[1] * normal)
            edges.append((float(likelihood[index]), circle / np.linalg.norm(circle)))
        off = np.abs((coarse - coarse[index]).mean(axis=1)) * reach
        likelihood[off < 2.0 * pixel] = -np.inf
    return edges
