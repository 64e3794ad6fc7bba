"""The circle that a circular fisheye lens paints on the sensor."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.errors import InputError
from lightdepth.parameters.capture import DEFAULT, CaptureParameters


@dataclass(frozen=True)
class Circle:
    """A circle on a photograph, in pixels from the upper left corner.

    Attributes:
        x: centre, to the right.
        y: centre, down.
        radius: pixels.
    """

    x: float
    y: float
    radius: float

    def box(self) -> tuple[int, int, int]:
        """Left edge, upper edge and side of the square around the circle; it may reach beyond the photograph."""
        side = 2 * int(np.ceil(self.radius))
        return round(self.x - side / 2), round(self.y - side / 2), side

    def crop(self, image: NDArray, fill: float = 0) -> NDArray:
        """The square around the circle, ``fill`` where it reaches beyond the photograph.

        Args:
            image: shape (height, width) or (height, width, channels).
            fill: value of the missing pixels.

        Returns:
            Shape (side, side) or (side, side, channels), the dtype of ``image``.
        """
        left, top, side = self.box()
        result = np.full((side, side, *image.shape[2:]), fill, dtype=image.dtype)
        rows = slice(max(top, 0), min(top + side, image.shape[0]))
        columns = slice(max(left, 0), min(left + side, image.shape[1]))
        result[rows.start - top : rows.stop - top, columns.start - left : columns.stop - left] = image[rows, columns]
        return result

    def inside(self, height: int, width: int) -> NDArray[np.bool_]:
        """Which pixel centres of a photograph lie in the circle, shape (height, width)."""
        rows, columns = np.ogrid[:height, :width]
        return (columns + 0.5 - self.x) ** 2 + (rows + 0.5 - self.y) ** 2 <= self.radius**2


def parse_circle(text: str) -> Circle:
    """A circle given as ``x,y,r`` in pixels.

    Raises:
        InputError: it is not three numbers, or the radius is not positive.
    """
    try:
        x, y, radius = (float(part) for part in text.split(","))
    except ValueError:
        x, y, radius = 0.0, 0.0, 0.0
    if not (radius > 0.0 and np.isfinite([x, y, radius]).all()):
        raise InputError(f"--circle is '{text}'; allowed are auto, or x,y,r in pixels with a positive radius r")
    return Circle(x, y, radius)


def find_circle(photographs: Iterable[NDArray], tuned: CaptureParameters = DEFAULT) -> Circle:
    """Find the fisheye circle in a bracket: bright inside, black outside.

    Long exposures show stray light outside the circle; the first photograph with black outside decides.

    Args:
        photographs: from the longest exposure to the shortest, RGB, 8 or 16 bits, each of shape (height, width, 3).
        tuned: what is black, and what a circle.

    Returns:
        The circle, in pixels.

    Raises:
        InputError: there is no such circle.
    """
    for photograph in photographs:
        scale = min(1.0, tuned.circle_side / max(photograph.shape[:2]))
        small = cv2.resize(photograph, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
        light = cv2.blur(small.max(axis=2).astype(np.float32) / np.iinfo(photograph.dtype).max, (3, 3))
        if np.percentile(light, 3) > tuned.circle_black:
            continue
        points = _edge_points(light, tuned)
        if len(points) < tuned.circle_fewest_points:
            continue
        circle, share = _fit(points, tuned)
        if share > tuned.circle_least_share:
            return Circle(circle.x / scale, circle.y / scale, circle.radius / scale)
    raise InputError("no fisheye circle was found in the photographs; state it as --circle x,y,r in pixels")


def refine_circle(circle: Circle, radiance: NDArray[np.float32], tuned: CaptureParameters = DEFAULT) -> Circle:
    """A circle moved to where linear light falls to half of what it is within; as it is where that is seen too seldom.

    Args:
        circle: right within some pixels.
        radiance: linear, shape (height, width, 3).
        tuned: how far it is moved, and by what.
    """
    reach = max(4.0, tuned.circle_reach * circle.radius)
    turn = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    outward = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    radii = np.arange(circle.radius - reach, circle.radius + reach, 0.25)
    at = np.array([circle.x, circle.y]) + outward[:, None] * radii[:, None] - 0.5
    grey = np.ascontiguousarray(radiance.mean(axis=2), np.float32)
    profile = cv2.remap(
        grey, *np.moveaxis(at, -1, 0).astype(np.float32), cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE
    )
    inner = np.median(profile[:, : len(radii) // 4], axis=1)
    outer = np.median(profile[:, -len(radii) // 4 :], axis=1)
    above = profile > 0.5 * (inner + outer)[:, None]
    last = len(radii) - 1 - np.argmax(above[:, ::-1], axis=1)
    lit = (inner > tuned.circle_contrast * outer) & (inner > tuned.circle_lit * np.median(inner))
    good = lit & (last > 0) & (last < len(radii) - 1)
    if good.mean() < tuned.circle_least_lit:
        return circle
    points = np.array([circle.x, circle.y]) + outward[good] * (radii[last[good]] + 0.125)[:, None]
    for tolerance in tuned.circle_tolerances:
        fitted = circle_through(points)
        near = _distance(points, fitted) < tolerance
        if near.sum() < 90:
            break
        points = points[near]
    return circle_through(points)


def _edge_points(light: NDArray[np.float32], tuned: CaptureParameters) -> NDArray[np.float64]:
    """Where rays from outside toward the image's centre first meet light; ``(x, y)`` of shape (n, 2)."""
    height, width = light.shape
    centre = np.array([width / 2.0, height / 2.0])
    dark = np.percentile(light, 2)
    threshold = dark + tuned.circle_edge * (np.percentile(light, 90) - dark)
    points = []
    for angle in np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False):
        direction = np.array([np.cos(angle), np.sin(angle)])
        reach = np.min(centre / np.maximum(np.abs(direction), 1e-9)) - 1.5
        radii = np.arange(reach, 0.25 * min(height, width), -1.0)
        x, y = (centre[:, None] + direction[:, None] * radii).astype(int)
        lit = np.flatnonzero(light[y, x] > threshold)
        # A ray that starts in light has left the frame within the circle, and says nothing.
        if lit.size and lit[0] > 1:
            points.append(centre + direction * (radii[lit[0]] + 0.5))
    return np.array(points).reshape(-1, 2)


def _fit(points: NDArray[np.float64], tuned: CaptureParameters) -> tuple[Circle, float]:
    """The circle through most points by random sampling, refined on them, and the share of points on it."""
    rng = np.random.default_rng(0)
    best = np.zeros(len(points), dtype=bool)
    for _ in range(tuned.circle_trials):
        circle = circle_through(points[rng.choice(len(points), 3, replace=False)])
        on_it = _distance(points, circle) < tuned.circle_tolerance
        if on_it.sum() > best.sum():
            best = on_it
    if best.sum() < 3:
        return Circle(0.0, 0.0, 1.0), 0.0
    return circle_through(points[best]), float(best.mean())


def circle_through(points: NDArray[np.float64]) -> Circle:
    """Least-squares circle (Kasa's): ``x^2 + y^2 = 2 x x0 + 2 y y0 + k``."""
    system = np.column_stack([2.0 * points, np.ones(len(points))])
    x, y, k = np.linalg.lstsq(system, (points**2).sum(axis=1), rcond=None)[0]
    return Circle(float(x), float(y), float(np.sqrt(max(k + x * x + y * y, 0.0))))


def _distance(points: NDArray[np.float64], circle: Circle) -> NDArray[np.float64]:
    return np.abs(np.hypot(points[:, 0] - circle.x, points[:, 1] - circle.y) - circle.radius)
