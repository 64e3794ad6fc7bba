"""Photographs of a mirror ball to one panorama around its centre."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.capture.mirror_ball.geometry import BallView
from lightdepth.capture.mirror_ball.reflectance import metal_reflectance
from lightdepth.directions import FloatArray, pixel_directions
from lightdepth.parameters.mirror_ball import DEFAULT, MirrorBallParameters

Rays = Callable[[FloatArray, FloatArray], NDArray[np.floating]]
"""Distances of the place's surfaces along rays: origins and unit directions of the panorama's light space, metres from the
ball's centre, each of shape (n, 3); inf where there is none."""

BAND = 32
"""Rows of the panorama computed at a time."""
FAR = 1e6
"""Radii: infinitely far."""


@dataclass(frozen=True, eq=False)
class Ball:
    """A photographed mirror ball.

    Attributes:
        name: of the photograph, for messages.
        radiance: linear RGB, shape (height, width, 3), float32.
        clipped: pixels clipped in every exposure, shape (height, width), bool.
        view: where the ball is.
        reflectance: of the ball at normal incidence, shape (3,).
        rotation: camera space to the panorama's light space, shape (3, 3).
        gain: by which the radiance is multiplied, shape (3,).
    """

    name: str
    radiance: NDArray[np.float32]
    clipped: NDArray[np.bool_]
    view: BallView
    reflectance: FloatArray
    rotation: FloatArray = field(default_factory=lambda: np.eye(3))
    gain: FloatArray = field(default_factory=lambda: np.ones(3))


@dataclass(frozen=True)
class Place:
    """The modelled place around the ball.

    Attributes:
        rays: distances of its surfaces.
        radius: of the ball, metres.
    """

    rays: Rays
    radius: float

    def distance(self, directions: FloatArray) -> FloatArray:
        """From the ball's centre, in radii, shape (n,)."""
        metres = np.asarray(self.rays(np.zeros_like(directions), directions), np.float64)
        return np.clip(metres / self.radius, 1.001, FAR)


@dataclass(frozen=True)
class Unwrapped:
    """A panorama from photographs of a ball.

    Attributes:
        radiance: linear RGB, shape (height, 2 height, 3), float32; 0 where not covered.
        covered: directions that some photograph shows, shape (height, 2 height), bool.
        clipped: directions clipped in the photographs that show them, the same shape; lower bounds.
        degrees_per_pixel: of the best photograph, in its coarser direction, the same shape, float32; inf where none.
    """

    radiance: NDArray[np.float32]
    covered: NDArray[np.bool_]
    clipped: NDArray[np.bool_]
    degrees_per_pixel: NDArray[np.float32]


@dataclass(frozen=True)
class Samples:
    """What a photograph says about directions.

    Attributes:
        radiance: without the ball's reflectance, with the photograph's gain, shape (n, 3), float32.
        weight: 0 where it shows nothing, shape (n,).
        clipped: share of clipped pixels, shape (n,).
        degrees_per_pixel: in the coarser direction, shape (n,).
        angle: from the camera, radians, shape (n,).
    """

    radiance: NDArray[np.float32]
    weight: FloatArray
    clipped: NDArray[np.float32]
    degrees_per_pixel: FloatArray
    angle: FloatArray


def sample(
    ball: Ball,
    directions: FloatArray,
    distance: FloatArray | None = None,
    photographer: float = 0.0,
    tuned: MirrorBallParameters = DEFAULT,
) -> Samples:
    """Look directions up in a photograph of the ball.

    Args:
        ball: the photograph.
        directions: unit, of the panorama's light space, shape (n, 3).
        distance: from the ball's centre to what is seen there, in radii, shape (n,); ``None`` is infinity.
        photographer: degrees around the camera's direction in which it counts only where nothing else does.
        tuned: how much each direction counts.
    """
    normals, cosine, angle = ball.view.mirror(directions @ ball.rotation, distance)
    seen = np.asarray(np.isfinite(cosine))
    normals, cosine = np.where(seen[:, None], normals, -ball.view.axis), np.where(seen, cosine, 1.0)
    x, y = ball.view.seen_at(normals)
    # OpenCV's maps have at most 32767 entries a side.
    side = int(np.ceil(np.sqrt(len(x))))
    padded = np.full((2, side * side), -1.0, np.float32)
    padded[:, : len(x)] = x - 0.5, y - 0.5
    maps = padded.reshape(2, side, side)
    light = cv2.remap(ball.radiance, maps[0], maps[1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    lost = cv2.remap(ball.clipped.astype(np.float32), maps[0], maps[1], cv2.INTER_LINEAR)
    radiance = light.reshape(-1, 3)[: len(x)] * (ball.gain / metal_reflectance(ball.reflectance, cosine))
    coarse = np.nan_to_num(np.maximum(*ball.view.degrees_per_pixel(angle)), nan=np.inf)
    centre_x, centre_y = ball.view.pixels(ball.view.axis)
    rim_x, rim_y = ball.view.seen_at(_at_rim(ball.view, normals))
    within = np.hypot(rim_x - x, rim_y - y) * np.sign(
        np.hypot(rim_x - centre_x, rim_y - centre_y) - np.hypot(x - centre_x, y - centre_y)
    )
    inside = np.clip((within - tuned.unwrap_none) / (tuned.unwrap_all - tuned.unwrap_none), 0.0, 1.0)
    weight = seen * inside / np.maximum(coarse, 1e-6) ** tuned.unwrap_sharpness
    if photographer > 0.0:
        weight *= np.maximum(
            _smooth(np.degrees(angle), 0.8 * photographer, 1.2 * photographer), tuned.unwrap_photographer
        )
    return Samples(radiance.astype(np.float32), weight, lost.ravel()[: len(x)], coarse, angle)


def visible(
    ball: Ball, place: Place, directions: FloatArray, distance: FloatArray, tuned: MirrorBallParameters = DEFAULT
) -> NDArray[np.bool_]:
    """Which points of the place the ball sees where it reflects them: it is not where its centre is. Shape (n,).

    Args:
        ball: the photograph.
        place: around it.
        directions: unit, of the panorama's light space, from the ball's centre, shape (n, 3).
        distance: of the points from the ball's centre, in radii, shape (n,).
        tuned: what is in front.
    """
    normals, _, _ = ball.view.mirror(directions @ ball.rotation, distance)
    known = np.isfinite(normals[:, 0])
    origins = np.where(known[:, None], normals @ ball.rotation.T, directions)
    way = directions * distance[:, None] - origins
    length = np.linalg.norm(way, axis=1)
    origins = 1.001 * origins * place.radius
    met = np.asarray(place.rays(origins, way / length[:, None]), np.float64) / place.radius
    return np.asarray(met > (1.0 - tuned.unwrap_nearer) * np.minimum(length, FAR))


def natural_width(balls: Sequence[Ball]) -> int:
    """Width of a panorama as fine as the photographs are beside the camera's direction, a multiple of 64."""
    finest = min(float(np.max(ball.view.degrees_per_pixel(np.array([1.0])))) for ball in balls)
    return max(64, round(360.0 / finest / 64.0) * 64)


def unwrap(
    balls: Sequence[Ball],
    width: int,
    place: Place | None = None,
    photographer: float = 0.0,
    progress: Callable[[str, int, int], None] = lambda *_: None,
    tuned: MirrorBallParameters = DEFAULT,
) -> Unwrapped:
    """Unwrap photographs and merge them.

    Args:
        balls: with rotations and gains.
        width: of the panorama in pixels, even.
        place: where the reflected rays end; ``None`` takes everything to be infinitely far.
        photographer: degrees around each camera's direction in which other photographs are preferred.
        progress: called after each band of rows.
        tuned: how finely, and how much each photograph counts.
    """
    height, each_way = width // 2, tuned.unwrap_supersampling
    fine = pixel_directions(each_way * height, each_way * width)
    shape = (height, width)
    result = Unwrapped(
        np.zeros((*shape, 3), np.float32), np.zeros(shape, bool), np.zeros(shape, bool), np.zeros(shape, np.float32)
    )
    for start in range(0, height, BAND):
        stop = min(start + BAND, height)
        directions = fine[each_way * start : each_way * stop].reshape(-1, 3)
        distance = None if place is None else place.distance(directions)
        light, weights = np.zeros((len(directions), 3)), np.zeros(len(directions))
        lost, best = np.zeros(len(directions)), np.full(len(directions), np.inf)
        for ball in balls:
            found = sample(ball, directions, distance, photographer, tuned)
            weight = found.weight
            if place is not None and distance is not None:
                weight = weight * visible(ball, place, directions, distance, tuned)
            light += found.radiance * weight[:, None]
            lost += found.clipped * weight
            weights += weight
            best = np.where(weight > 0.0, np.minimum(best, found.degrees_per_pixel), best)
        known = weights > 0.0
        share = _texels(known.astype(np.float64), width, each_way)
        light = np.divide(light, weights[:, None], out=np.zeros_like(light), where=known[:, None])
        lost = np.divide(lost, weights, out=np.zeros_like(lost), where=known)
        rows = slice(start, stop)
        result.radiance[rows] = _texels(light, width, each_way) / np.maximum(share, 1e-6)[..., None]
        result.covered[rows] = share > 0.5
        result.clipped[rows] = _texels(lost, width, each_way) > 0.5 * np.maximum(share, 1e-6)
        finest = best.reshape(stop - start, each_way, width, each_way).min(axis=(1, 3))
        result.degrees_per_pixel[rows] = finest
        progress("unwrapping", stop, height)
    result.radiance[~result.covered] = 0.0
    result.clipped[~result.covered] = False
    return result


def _texels(values: FloatArray, width: int, each_way: int) -> FloatArray:
    """Means over the samples of each texel, shape (rows, width, ...)."""
    cut = values.reshape(-1, each_way, width, each_way, *values.shape[1:])
    return np.asarray(cut.mean(axis=(1, 3)))


def _at_rim(view: BallView, normals: FloatArray) -> FloatArray:
    """Normals of the outline's points in the same plane with the axis."""
    beside = normals - (normals @ view.axis)[:, None] * view.axis
    beside /= np.maximum(np.linalg.norm(beside, axis=1, keepdims=True), 1e-12)
    return np.asarray(-np.cos(view.rim) * view.axis + np.sin(view.rim) * beside)


def _smooth(values: FloatArray, low: float, high: float) -> FloatArray:
    share = np.clip((values - low) / (high - low), 0.0, 1.0)
    return share * share * (3.0 - 2.0 * share)
