"""Temporal reuse: what other frames of a shot found on the surfaces that a frame shows.

The change of matte support does not depend on the camera. So where nothing moves, every frame that sees a point of it
estimates the same, and a frame may be the mean of the samples of several. Each pixel is reprojected into the other frames
by the position of what it shows: the *relative* change of irradiance, in which the photograph's texture cancels. A sample
is resampled once, straight from the frame that took it, so that nothing smears with time, and a frame depends on those
around it alone, whoever renders them. Where the scenes of two frames differ, something may have moved: what differs
there by more than noise is rejected, as are all frames beyond, in the same direction of time.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import cv2
import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.cameras import Viewpoint
from lightdepth.film.frame import Frame
from lightdepth.kernel.arrays import aligned
from lightdepth.kernel.start import DEVICE_LOCK
from lightdepth.parameters.film import DEFAULT

MOST_COVERAGE = 0.75
"""Of a pixel by objects; what is left of it tells little of the support."""
DARK = 1e-4
"""Radiance relative to the photograph's median below which a relative change means nothing."""
PLANE = 0.1
"""Distance from the plane of a pixel's surface at which others still show the same one, in pixels there."""
SAME_NORMAL = 0.9
"""Cosine between the normals of two pixels that show the same surface."""
FEWEST_TAPS = 0.5
"""Share of the four pixels around a point, by their weight, that must show its surface."""
WINDOWS = (1, 3, 9)
"""Sides of the squares of pixels over which differences are tested: for edges, and for what is faint."""
REJECTED = 9.0
"""Squared differences above this many times their variance are no noise."""


@dataclass(frozen=True)
class SampledFrame:
    """A frame as its samples alone give it.

    Attributes:
        frame: with the layers depth, normal, support, variance and samples; not denoised.
        view: the camera.
        scene: digest of the scene: where those of two frames are equal, nothing has moved.
    """

    frame: Frame
    view: Viewpoint
    scene: str

    @cached_property
    def change(self) -> _Change:
        """What it found."""
        return _Change.of(self.frame)


@dataclass(frozen=True)
class _Change:
    """Relative changes of matte support.

    Attributes:
        relative: the change over the photograph, shape (height, width, 3), float32.
        variance: of that, likewise.
        weight: samples that it is the mean of, shape (height, width), float32; 0 where it is not known.
        before: the photograph's part of the pixel, shape (height, width, 3).
    """

    relative: NDArray[np.float32]
    variance: NDArray[np.float32]
    weight: NDArray[np.float32]
    before: NDArray[np.float32]

    @classmethod
    def of(cls, frame: Frame) -> _Change:
        assert frame.support is not None
        assert frame.samples is not None
        assert frame.variance is not None
        left = 1.0 - frame.coverage
        before = frame.plate * left[..., None]
        known = (frame.support > 0) & (frame.coverage <= MOST_COVERAGE)
        known &= before.min(axis=2) > DARK * np.median(frame.plate[::4, ::4])
        weight = np.where(known, frame.samples * left, np.float32(0.0)).astype(np.float32)
        scale = np.where(known[..., None], before, np.float32(np.inf)).astype(np.float32)
        relative, variance = frame.change / scale, frame.variance / np.square(scale)
        return cls(relative.astype(np.float32), variance.astype(np.float32), weight, before)


def reuse(frame: Frame, mine: SampledFrame, sides: Iterable[Iterable[SampledFrame]]) -> Frame:
    """A frame with the samples of those around it.

    Args:
        frame: with all its layers.
        mine: the same frame with what it found.
        sides: other frames of the same shot: those before and those after it, the nearest first.

    Returns:
        ``frame`` with another ``change`` and ``variance``, and the error that follows.
    """
    own = mine.change
    rows, columns = np.nonzero(own.weight)
    if not len(rows):
        return frame
    total = own.relative * own.weight[..., None]
    variance = own.variance * np.square(own.weight)[..., None]
    weight = own.weight.copy()
    for side in sides:
        trusted = np.ones(weight.shape, bool)
        for other in side:
            found = _seen_from(mine, other, rows, columns)
            if other.scene != mine.scene:
                trusted &= ~_differs(own, found)
            counted = np.where(trusted, found.weight, np.float32(0.0))
            total += found.relative * counted[..., None]
            variance += found.variance * np.square(counted)[..., None]
            weight += counted
    known = weight > 0.0
    divisor = np.where(known, weight, np.float32(1.0))[..., None]
    change = np.where(known[..., None], total / divisor * own.before, frame.change)
    # Where an object covers part of a pixel, its variance is not that of the change alone.
    assert frame.variance is not None
    alone = (known & (frame.coverage == 0.0))[..., None]
    variance = np.where(alone, variance / np.square(divisor) * np.square(own.before), frame.variance)
    result = replace(frame, change=change, variance=variance, metadata=dict(frame.metadata))
    # What all pixels share, the irradiance's error above all, stays.
    shared = max(float(frame.metadata["error"]) ** 2 - _own_error(frame), 0.0)
    result.metadata["error"] = f"{math.sqrt(shared + _own_error(result)):.5f}"
    return result


def _own_error(frame: Frame) -> float:
    """Mean of the squared relative errors of the pixels from the noise of their samples."""
    assert frame.samples is not None
    assert frame.variance is not None
    taken = frame.samples > 0
    brightness = np.maximum(frame.beauty[taken].mean(axis=1), 0.0)
    floor = DEFAULT.dark * np.median(frame.plate[taken].mean(axis=1)) + 1e-12
    return float(np.mean(frame.variance[taken].mean(axis=1) / np.square(brightness + floor)))


def _seen_from(
    mine: SampledFrame, other: SampledFrame, rows: NDArray[np.integer], columns: NDArray[np.integer]
) -> _Change:
    """What another frame found at the points that some pixels of this one show."""
    shape = mine.change.weight.shape
    relative, variance = np.zeros((*shape, 3), np.float32), np.zeros((*shape, 3), np.float32)
    weight = np.zeros(shape, np.float32)
    with DEVICE_LOCK:
        values, variances, weights = _looked_up(mine, other, rows, columns)
    relative[rows, columns], variance[rows, columns], weight[rows, columns] = values, variances, weights
    return _Change(relative, variance, weight, mine.change.before)


def _looked_up(
    mine: SampledFrame, other: SampledFrame, rows: NDArray[np.integer], columns: NDArray[np.integer]
) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32]]:
    """Relative change, variance and weight that another frame gives some pixels."""
    pixel = mi.UInt32(aligned(rows * mine.view.resolution[0] + columns, np.uint32))
    point, normal, angle = _Surfaces(mine).at(pixel)
    there = other.view.project(point, mi.Point2f(0.5))
    width, height = other.view.resolution
    x, y = there.film.x * width - 0.5, there.film.y * height - 0.5
    left, top = dr.floor(x), dr.floor(y)
    size = dr.norm(point - there.origin) * dr.sqrt(dr.maximum(there.solid_angle, angle))
    surfaces = _Surfaces(other)
    values, variances, samples = (
        mi.Float(aligned(part)) for part in (other.change.relative, other.change.variance, other.change.weight)
    )
    total, noise = mi.Color3f(0.0), mi.Color3f(0.0)
    weight, taps = mi.Float(0.0), mi.Float(0.0)
    for right, below in ((0, 0), (1, 0), (0, 1), (1, 1)):
        column, row = dr.clip(left + right, 0, width - 1), dr.clip(top + below, 0, height - 1)
        tap = mi.UInt32(row) * width + mi.UInt32(column)
        beside, its_normal, _ = surfaces.at(tap)
        taken = dr.gather(mi.Float, samples, tap, there.inside)
        same = (taken > 0.0) & (dr.abs(dr.dot(beside - point, normal)) < PLANE * size)
        same &= dr.dot(normal, its_normal) > SAME_NORMAL
        share = dr.select(same, (1.0 - dr.abs(x - left - right)) * (1.0 - dr.abs(y - top - below)), 0.0)
        counted = share * taken
        total += counted * dr.gather(mi.Color3f, values, tap, same)
        # Not less than that of a single one: pixels side by side get shares of the same samples.
        noise += counted * dr.gather(mi.Color3f, variances, tap, same)
        weight += counted
        taps += share
    enough = taps > FEWEST_TAPS
    scale = dr.select(enough, dr.rcp(dr.maximum(weight, 1e-20)), 0.0)
    total, noise, weight = total * scale, noise * scale, dr.select(enough, weight, 0.0)
    dr.eval(total, noise, weight)
    return total.numpy().T, noise.numpy().T, weight.numpy()


class _Surfaces:
    """What the pixels of a frame show in their middle."""

    def __init__(self, sampled: SampledFrame) -> None:
        assert sampled.frame.depth is not None
        assert sampled.frame.normal is not None
        self._view = sampled.view
        depth = np.where(np.isfinite(sampled.frame.depth), sampled.frame.depth, np.float32(0.0))
        self._depth, self._normal = mi.Float(aligned(depth)), mi.Float(aligned(sampled.frame.normal))

    def at(self, pixel: mi.UInt32) -> tuple[mi.Point3f, mi.Vector3f, mi.Float]:
        """Position, normal, and solid angle of pixels."""
        width, _ = self._view.resolution
        middle = mi.Point2f(0.5)
        seen = self._view.pixel_rays(mi.Float(pixel % width), mi.Float(pixel // width), middle, middle)
        normal = dr.gather(mi.Vector3f, self._normal, pixel)
        return seen.ray(dr.gather(mi.Float, self._depth, pixel)), normal, seen.solid_angle


def _differs(own: _Change, found: _Change) -> NDArray[np.bool_]:
    """Where another frame found what noise does not explain, shape (height, width)."""
    both = (own.weight > 0.0) & (found.weight > 0.0)
    difference = np.where(both, (found.relative - own.relative).mean(axis=2), np.float32(0.0))
    noise = np.where(both, (found.variance + own.variance).mean(axis=2), np.float32(0.0))
    # That of a single pixel from few samples is unreliable, and may be nothing at all.
    noise = np.maximum(noise, cv2.blur(noise, (3, 3)))
    result = np.zeros(both.shape, bool)
    for side in WINDOWS:
        mean, expected = (cv2.blur(part, (side, side)) for part in (difference, noise))
        # Means over the square times its area: the variance of a sum is the sum of the variances.
        result |= np.square(mean) * side**2 > REJECTED * expected
    return result
