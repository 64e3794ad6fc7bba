"""Temporal reuse: what other frames of a shot found on the surfaces that a frame shows.

The change of matte support does not depend on the camera. So where nothing moves, every frame that sees a point of it
estimates the same, and a frame may be the mean of the samples of several. Each pixel is reprojected into the other frames
by the position of what it shows, and takes from there what does not depend on its texture: the change relative to the
photograph. A sample is resampled once, straight from the frame that took it, so that nothing smears with time, and a frame
depends on those around it alone, whoever renders them.

Where the scenes of two frames differ, something may have moved: what differs there by more than noise is rejected, as are
all frames beyond, in the same direction of time. So are objects treated, whose radiance may depend on the camera.
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
from lightdepth.parameters import film
from lightdepth.parameters.reuse import DEFAULT, ReuseParameters


@dataclass(frozen=True)
class SampledFrame:
    """A frame as its samples alone give it.

    Attributes:
        frame: with the layers depth, normal, support, variance and samples; not denoised.
        view: the camera.
        scene: digest of the scene: where those of two frames are equal, nothing has moved.
        dark: share of the median brightness below which errors do not count; see
            :class:`~lightdepth.parameters.film.FilmParameters`.
        tuned: what it takes over from others.
    """

    frame: Frame
    view: Viewpoint
    scene: str
    dark: float = film.DEFAULT.dark
    tuned: ReuseParameters = DEFAULT

    @cached_property
    def light(self) -> _Light:
        """What it found."""
        return _Light.of(self.frame, self.tuned)

    @cached_property
    def surfaces(self) -> _Surfaces:
        """The same on the device, with what its pixels show."""
        return _Surfaces(self)


@dataclass(frozen=True)
class _Light:
    """What a frame found on surfaces: on matte support the change, on objects the radiance.

    Attributes:
        relative: the change over the photograph, or the radiance over the albedo, in which textures cancel, shape (height,
            width, 3), float32.
        variance: of that, likewise.
        weight: samples that it is the mean of, shape (height, width), float32; 0 where it is not known.
        scale: what it is relative to, shape (height, width, 3).
        surface: 0 for none, 1 for support, and above 1 the objects, shape (height, width), uint32.
    """

    relative: NDArray[np.float32]
    variance: NDArray[np.float32]
    weight: NDArray[np.float32]
    scale: NDArray[np.float32]
    surface: NDArray[np.uint32]

    @classmethod
    def of(cls, frame: Frame, tuned: ReuseParameters) -> _Light:
        assert frame.support is not None
        assert frame.object_id is not None
        assert frame.albedo is not None
        assert frame.samples is not None
        assert frame.variance is not None
        left = 1.0 - frame.coverage
        before = frame.plate * left[..., None]
        support = frame.support & (frame.coverage <= tuned.most_coverage)
        support &= before.min(axis=2) > tuned.dark * np.median(frame.plate[::4, ::4])
        covered = (frame.object_id > 0) & (frame.coverage == 1.0)
        surface = np.where(support, 1, np.where(covered, frame.object_id + 1, 0)).astype(np.uint32)
        weight = np.where(support, frame.samples * left, np.where(covered, frame.samples, 0)).astype(np.float32)
        scale = np.where(covered[..., None], np.maximum(frame.albedo, tuned.least_albedo), before).astype(np.float32)
        divisor = np.where((surface > 0)[..., None], scale, np.float32(np.inf)).astype(np.float32)
        relative = np.where(covered[..., None], frame.synthetic, frame.change) / divisor
        variance = frame.variance / np.square(divisor)
        return cls(relative.astype(np.float32), variance.astype(np.float32), weight, scale, surface)


def reuse(frame: Frame, mine: SampledFrame, sides: Iterable[Iterable[SampledFrame]]) -> Frame:
    """A frame with the samples of those around it.

    Args:
        frame: with all its layers.
        mine: the same frame with what it found.
        sides: other frames of the same shot: those before and those after it, the nearest first.

    Returns:
        ``frame`` with other ``change``, ``synthetic`` and ``variance``, and the error that follows.
    """
    own = mine.light
    pixels = _Pixels(mine)
    if not len(pixels.slots):
        return frame
    own_weight = pixels.of(own.weight)
    total = pixels.of(own.relative) * own_weight[:, None]
    variance = pixels.of(own.variance) * np.square(own_weight)[:, None]
    weight = own_weight.copy()
    surface = pixels.of(own.surface)
    for side in sides:
        trusted = np.ones(len(weight), bool)
        for other in side:
            found = pixels.found_by(other)
            doubtful = surface > (1 if other.scene == mine.scene else 0)
            trusted &= ~(doubtful & pixels.differ(found, doubtful))
            counted = np.where(trusted, found.weight, np.float32(0.0))
            total += found.relative * counted[:, None]
            variance += found.variance * np.square(counted)[:, None]
            weight += counted
    scale = pixels.of(own.scale)
    total *= scale / weight[:, None]
    variance *= np.square(scale / weight[:, None])
    support, objects = surface == 1, surface > 1
    # Where an object covers part of a pixel, its variance is not that of the change alone.
    alone = objects | (support & (pixels.of(frame.coverage) == 0.0))
    assert frame.variance is not None
    result = replace(
        frame,
        change=pixels.replaced(frame.change, support, total),
        synthetic=pixels.replaced(frame.synthetic, objects, total),
        variance=pixels.replaced(frame.variance, alone, variance),
        metadata=dict(frame.metadata),
    )
    # What all pixels share, the irradiance's error above all, stays.
    shared = max(float(frame.metadata["error"]) ** 2 - _own_error(frame, mine.dark), 0.0)
    result.metadata["error"] = f"{math.sqrt(shared + _own_error(result, mine.dark)):.5f}"
    return result


def _own_error(frame: Frame, dark: float) -> float:
    """Mean of the squared relative errors of the pixels from the noise of their samples."""
    assert frame.samples is not None
    assert frame.variance is not None
    taken = np.flatnonzero(frame.samples)
    plate, change, synthetic, variance = (
        image.reshape(-1, 3)[taken] for image in (frame.plate, frame.change, frame.synthetic, frame.variance)
    )
    beauty = plate * (1.0 - frame.coverage.reshape(-1)[taken, None]) + change + synthetic
    brightness = np.maximum(beauty.mean(axis=1), 0.0)
    floor = dark * np.median(plate.mean(axis=1)) + 1e-12
    return float(np.mean(variance.mean(axis=1) / np.square(brightness + floor)))


@dataclass(frozen=True)
class _Found:
    """What another frame gives n pixels: as :class:`_Light`, shapes (n, 3), (n, 3) and (n,)."""

    relative: NDArray[np.float32]
    variance: NDArray[np.float32]
    weight: NDArray[np.float32]


class _Pixels:
    """The pixels of a frame that others may know more of.

    Args:
        mine: the frame.

    Attributes:
        slots: row-major indices, ascending, shape (n,).
    """

    def __init__(self, mine: SampledFrame) -> None:
        self._own, self._tuned = mine.light, mine.tuned
        self.slots = np.flatnonzero(self._own.weight)
        if not len(self.slots):
            return
        with DEVICE_LOCK:
            pixel, here = mi.UInt32(aligned(self.slots, np.uint32)), mine.surfaces
            self._point, self._normal, self._angle = here.at(pixel)
            self._which = here.which(pixel)
            dr.eval(self._point, self._normal, self._angle, self._which)

    def of(self, image: NDArray) -> NDArray:
        """Their values out of an image, shape (n, ...)."""
        return np.asarray(image.reshape(-1, *image.shape[2:])[self.slots])

    def replaced(self, image: NDArray[np.float32], chosen: NDArray[np.bool_], values: NDArray) -> NDArray[np.float32]:
        """An image with other values at the chosen ones of them."""
        result = image.copy()
        result.reshape(-1, *image.shape[2:])[self.slots[chosen]] = values[chosen]
        return result

    def found_by(self, other: SampledFrame) -> _Found:
        """What another frame found at the points that they show."""
        with DEVICE_LOCK:
            return self._looked_up(other)

    def _looked_up(self, other: SampledFrame) -> _Found:
        there = other.view.project(self._point, mi.Point2f(0.5))
        width, height = other.view.resolution
        x, y = there.film.x * width - 0.5, there.film.y * height - 0.5
        left, top = dr.floor(x), dr.floor(y)
        size = dr.norm(self._point - there.origin) * dr.sqrt(dr.maximum(there.solid_angle, self._angle))
        surfaces = other.surfaces
        total, noise = mi.Color3f(0.0), mi.Color3f(0.0)
        weight, taps = mi.Float(0.0), mi.Float(0.0)
        for right, below in ((0, 0), (1, 0), (0, 1), (1, 1)):
            column, row = dr.clip(left + right, 0, width - 1), dr.clip(top + below, 0, height - 1)
            tap = mi.UInt32(row) * width + mi.UInt32(column)
            beside, its_normal, _ = surfaces.at(tap)
            taken = dr.gather(mi.Float, surfaces.weight, tap, there.inside)
            same = (taken > 0.0) & (surfaces.which(tap) == self._which)
            same &= dr.abs(dr.dot(beside - self._point, self._normal)) < self._tuned.plane * size
            same &= dr.dot(self._normal, its_normal) > self._tuned.same_normal
            share = dr.select(same, (1.0 - dr.abs(x - left - right)) * (1.0 - dr.abs(y - top - below)), 0.0)
            counted = share * taken
            total += counted * dr.gather(mi.Color3f, surfaces.relative, tap, same)
            # Not less than that of a single one: pixels side by side get shares of the same samples.
            noise += counted * dr.gather(mi.Color3f, surfaces.variance, tap, same)
            weight += counted
            taps += share
        enough = taps > self._tuned.fewest_taps
        scale = dr.select(enough, dr.rcp(dr.maximum(weight, 1e-20)), 0.0)
        total, noise, weight = total * scale, noise * scale, dr.select(enough, weight, 0.0)
        dr.eval(total, noise, weight)
        return _Found(total.numpy().T, noise.numpy().T, weight.numpy())

    def differ(self, found: _Found, doubtful: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Which of them another frame found to be what noise does not explain, shape (n,); right for the doubtful."""
        result = np.zeros(len(self.slots), bool)
        if not doubtful.any():
            return result
        height, width = self._own.weight.shape
        rows, columns = np.divmod(self.slots, width)
        # Of the picture, only what lies around those in doubt, and has a part in their squares.
        margin = self._tuned.largest_window // 2 + self._tuned.around // 2 + 1
        (top, bottom), (left, right) = (
            (max(int(each[doubtful].min()) - margin, 0), min(int(each[doubtful].max()) + margin + 1, size))
            for each, size in ((rows, height), (columns, width))
        )
        here = (rows >= top) & (rows < bottom) & (columns >= left) & (columns < right)
        part = (rows[here] - top, columns[here] - left)
        crop = slice(top, bottom), slice(left, right)
        own, surface = self._own, self._own.surface[crop]

        def image(values: NDArray) -> NDArray:
            whole = np.zeros(surface.shape, values.dtype)
            whole[part] = values
            return whole

        both = found.weight[here] > 0.0
        difference = (found.relative[here] - own.relative[crop][part]).mean(axis=1)
        noise = (found.variance[here] + own.variance[crop][part]).mean(axis=1)
        compared = image(both)
        differs = _differs(
            image(np.where(both, difference, 0.0)), image(np.where(both, noise, 0.0)), compared, surface, self._tuned
        )
        result[here] = differs[part]
        return result


class _Surfaces:
    """What a frame found, on the device, and what its pixels show in their middle."""

    def __init__(self, sampled: SampledFrame) -> None:
        assert sampled.frame.depth is not None
        assert sampled.frame.normal is not None
        self._view, light = sampled.view, sampled.light
        depth = np.where(np.isfinite(sampled.frame.depth), sampled.frame.depth, np.float32(0.0))
        self._depth, self._normal = mi.Float(aligned(depth)), mi.Float(aligned(sampled.frame.normal))
        self._which = mi.UInt32(aligned(light.surface, np.uint32))
        self.relative, self.variance, self.weight = (
            mi.Float(aligned(part)) for part in (light.relative, light.variance, light.weight)
        )

    def which(self, pixel: mi.UInt32) -> mi.UInt32:
        """Which surface pixels show, as :class:`_Light` counts them."""
        return dr.gather(mi.UInt32, self._which, pixel)

    def at(self, pixel: mi.UInt32) -> tuple[mi.Point3f, mi.Vector3f, mi.Float]:
        """Position, normal, and solid angle of pixels."""
        width, _ = self._view.resolution
        middle = mi.Point2f(0.5)
        seen = self._view.pixel_rays(mi.Float(pixel % width), mi.Float(pixel // width), middle, middle)
        normal = dr.gather(mi.Vector3f, self._normal, pixel)
        return seen.ray(dr.gather(mi.Float, self._depth, pixel)), normal, seen.solid_angle


def _differs(
    difference: NDArray[np.float32],
    noise: NDArray[np.float32],
    both: NDArray[np.bool_],
    surface: NDArray[np.uint32],
    tuned: ReuseParameters,
) -> NDArray[np.bool_]:
    """Where a difference is more than noise explains.

    Args:
        difference: between what two frames found, shape (height, width); 0 where either found nothing.
        noise: its variance, likewise.
        both: where both found something.
        surface: which one the pixels show.
        tuned: what is no noise.
    """
    # That of a single pixel from few samples is unreliable, and may be nothing at all.
    noise = np.maximum(noise, cv2.blur(noise, (3, 3)))
    result = np.zeros(both.shape, bool)
    side = tuned.largest_window
    while side > 0:
        mean, expected = (cv2.blur(part, (side, side)) for part in (difference, noise))
        # Means over the square times its area: the variance of a sum is the sum of the variances.
        result |= np.square(mean) * side**2 > tuned.rejected * expected
        side //= 3
    result = cv2.dilate(result.astype(np.uint8), np.ones((tuned.around, tuned.around), np.uint8)) > 0
    compared, rejected = (np.bincount(surface[part]) for part in (both, both & result))
    mirroring = rejected > tuned.mirroring * compared[: len(rejected)]
    mirroring[:2] = False  # Support mirrors nothing; its shadows move here and there.
    return np.asarray(result | np.isin(surface, np.flatnonzero(mirroring)))
