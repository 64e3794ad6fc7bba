"""Where a mirror ball is in a photograph."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from lightdepth.capture.fisheye import Circle
from lightdepth.capture.mirror_ball.geometry import BallView, view_from_circle, view_from_cone
from lightdepth.capture.mirror_ball.rim import sharpened
from lightdepth.directions import FloatArray
from lightdepth.errors import InputError
from lightdepth.parameters.mirror_ball import DEFAULT, MirrorBallParameters


@dataclass(frozen=True)
class Optics:
    """What is known about the camera: one of the two.

    Attributes:
        focal_length: of the lens in pixels.
        distance: of the camera from the ball's centre, in radii.
    """

    focal_length: float | None = None
    distance: float | None = None

    def view(self, name: str, width: int, height: int, circle: Circle) -> BallView:
        """The ball behind a circle; see :func:`view_from_circle`."""
        return view_from_circle(name, width, height, circle, self.focal_length, self.distance)


def find_ball(
    name: str,
    radiance: NDArray[np.float32],
    optics: Optics,
    reflectance: FloatArray,
    tuned: MirrorBallParameters = DEFAULT,
) -> BallView:
    """Find the ball's outline.

    Circles that edges suggest are rated by how much of their outline is an edge, compared with what is
    just outside; the best one is fitted to a fraction of a pixel.

    Args:
        name: of the photograph, for messages.
        radiance: linear RGB, shape (height, width, 3).
        optics: the camera's.
        reflectance: of the ball at normal incidence, shape (3,).
        tuned: what is searched, and what an outline is.

    Raises:
        InputError: there is no ball, or it is cut off by the photograph's frame.
    """
    height, width = radiance.shape[:2]
    tones = _tones(radiance)
    promising: list[tuple[float, BallView]] = []
    for circle in _candidates(tones, tuned):
        try:
            view = optics.view(name, width, height, circle)
        except InputError:
            continue
        promising.append((_edge_strength(tones, view, tuned.find_coarse, tuned), view))
    promising.sort(key=lambda each: -each[0])
    best: tuple[float, BallView] | None = None
    for _, view in promising[: tuned.find_fitted]:
        view = _fitted(tones, view, optics, name, tuned.find_coarse, tuned)
        rating = _edge_strength(tones, view, tuned.find_rated, tuned)
        if best is None or rating > best[0]:
            best = rating, view
    if best is None or _edge_share(tones, best[1], tuned) < tuned.outline_least_share:
        raise InputError(
            f"{name}: no mirror ball was found: no circle in it has an edge almost all around; the ball must lie "
            "within the frame, in front of a background that differs from it; or state its circle as --circle x,y,r"
        )
    view = _fitted(tones, best[1], optics, name, tuned.find_fine, tuned)
    view = sharpened(radiance, view, reflectance, tuned)
    if optics.focal_length is None:
        view = optics.view(name, width, height, view.circle())
    check_inside(name, view)
    return view


def check_inside(name: str, view: BallView) -> None:
    """Refuse a ball that the photograph's frame cuts off.

    Raises:
        InputError: it is.
    """
    x, y = view.outline()
    beyond = {
        "left": -float(np.nanmin(x)),
        "right": float(np.nanmax(x)) - view.width,
        "upper": -float(np.nanmin(y)),
        "lower": float(np.nanmax(y)) - view.height,
    }
    side = max(beyond, key=lambda side: beyond[side])
    if beyond[side] > 0.0 or not (np.isfinite(x).all() and np.isfinite(y).all()):
        circle = view.circle()
        raise InputError(
            f"{name}: the ball (circle {circle.x:.1f},{circle.y:.1f},{circle.radius:.1f}) is cut off by the frame: it "
            f"reaches {beyond[side]:.1f} pixels beyond the {side} edge; the whole ball must be in the photograph"
        )


def _tones(radiance: NDArray[np.float32]) -> NDArray[np.float32]:
    """Logarithm of luminance, its noise in the dark held down."""
    light = radiance.mean(axis=2)
    floor = 0.02 * float(np.median(light)) + 1e-12
    return np.log(np.maximum(light, 0.0) + np.float32(floor)).astype(np.float32)


def _candidates(tones: NDArray[np.float32], tuned: MirrorBallParameters) -> list[Circle]:
    """Circles by Hough's transform, the most distinct first."""
    scale = min(1.0, tuned.find_side / max(tones.shape))
    small = cv2.resize(tones, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    low, high = np.percentile(small, [1.0, 99.0])
    grey = np.clip(255.0 * (small - low) / max(float(high - low), 1e-6), 0.0, 255.0).astype(np.uint8)
    grey = cv2.GaussianBlur(grey, (0, 0), 1.0)
    least = max(6, round(tuned.find_smallest * max(grey.shape)))
    found: list[Circle] = []
    for contrast in tuned.find_contrasts:
        circles = cv2.HoughCircles(
            grey, cv2.HOUGH_GRADIENT, 1.0, 4.0, param1=contrast, param2=tuned.find_votes, minRadius=least,
            maxRadius=max(grey.shape) // 2,
        )  # fmt: skip
        if circles is not None:
            for x, y, radius in circles.reshape(-1, circles.shape[-1])[: tuned.find_candidates, :3]:
                found.append(Circle((x + 0.5) / scale, (y + 0.5) / scale, float(radius) / scale))
    return found


def _fitted(
    tones: NDArray[np.float32], view: BallView, optics: Optics, name: str, step: float, tuned: MirrorBallParameters
) -> BallView:
    """The outline near ``view`` along which the tones step most; ``step`` is the width of the search, in radii."""
    circle = view.circle()
    pixel = step * circle.radius

    def moved(change: FloatArray) -> BallView:
        near = Circle(circle.x + pixel * change[0], circle.y + pixel * change[1], circle.radius + pixel * change[2])
        return optics.view(name, view.width, view.height, near) if optics.focal_length is None else _cone(near)

    def _cone(near: Circle) -> BallView:
        # The outline is an ellipse in the photograph; the circle nearest to it is moved, and it with that.
        x, y = view.outline(count=64)
        factor = near.radius / circle.radius
        return view_from_cone(
            name,
            view.width,
            view.height,
            view.focal_length,
            near.x + factor * (x - circle.x),
            near.y + factor * (y - circle.y),
        )

    def cost(change: FloatArray) -> float:
        try:
            there = moved(change)
        except InputError:
            return 0.0
        return -_edge_strength(tones, there, 0.5 * step, tuned)

    start = np.concatenate([np.zeros((1, 3)), 0.7 * np.eye(3)])
    found = minimize(cost, np.zeros(3), method="Nelder-Mead", options={"initial_simplex": start, "xatol": 0.01,
                     "fatol": 1e-5, "maxiter": tuned.find_iterations})  # fmt: skip
    return moved(found.x)


def _steps(tones: NDArray[np.float32], view: BallView, width: float, scale: float = 1.0) -> FloatArray:
    """How much the tones change from just within the outline to just outside it; NaN outside the photograph.

    Args:
        tones: shape (height, width).
        view: the ball.
        width: of the step, in radii; at least a pixel.
        scale: of the outline.
    """
    width = max(width, 1.0 / view.circle().radius)
    sides = []
    for side in (-1.0, 1.0):
        # Two samples a side: an edge is blurred over a pixel or two.
        parts = [_look(tones, *view.outline(scale + side * part * width)) for part in (0.5, 1.0)]
        sides.append(0.5 * (parts[0] + parts[1]))
    return np.asarray(sides[1] - sides[0])


def _edge_strength(tones: NDArray[np.float32], view: BallView, width: float, tuned: MirrorBallParameters) -> float:
    """Mean step along the outline less that just outside it; there is none outside the photograph.

    A ball shows all of its place, so that it is full of edges itself; what is around it is calmer.
    """
    width = max(width, 1.0 / view.circle().radius)
    here, beyond = (
        float(np.mean(np.nan_to_num(np.abs(_steps(tones, view, width, scale))).clip(0.0, tuned.outline_cap)))
        for scale in (1.0, 1.0 + tuned.outline_beyond * width)
    )
    return here - beyond


def _edge_share(tones: NDArray[np.float32], view: BallView, tuned: MirrorBallParameters) -> float:
    """Share of the outline at which the tones step, much more than just outside."""
    width = max(tuned.outline_width, 1.5 / view.circle().radius)
    here, beyond = (
        np.nan_to_num(np.abs(_steps(tones, view, width, scale))) for scale in (1.0, 1.0 + tuned.outline_beyond * width)
    )
    return float(np.mean((here > tuned.outline_edge) & (here > tuned.outline_stronger * beyond)))


def _look(tones: NDArray[np.float32], x: FloatArray, y: FloatArray) -> FloatArray:
    inside = (x >= 0.0) & (y >= 0.0) & (x <= tones.shape[1]) & (y <= tones.shape[0])
    maps = (np.where(inside, value - 0.5, -9.0).astype(np.float32)[None] for value in (x, y))
    values = cv2.remap(tones, *maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)[0]
    return np.where(inside, values, np.nan)
