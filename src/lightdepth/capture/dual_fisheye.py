"""Two fisheye circles side by side, as cameras with two lenses back to back write them, to one panorama.

Such lenses see a little more than a hemisphere each, so that a ring around the seam is seen by both. How the two pictures
agree there gives the field of view and how the second lens stands to the first; what lies inside a circle is known by the
kind of lens alone.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from lightdepth.capture.fisheye import Circle, find_circle, refine_circle
from lightdepth.capture.lens import Lens
from lightdepth.capture.panorama import Panorama, blend, natural_width
from lightdepth.capture.photometry import Photograph, Photometry
from lightdepth.capture.stitching import Orientation
from lightdepth.errors import InputError
from lightdepth.images.filling import fill, mark
from lightdepth.parameters.capture import DEFAULT, CaptureParameters

STEPS = 5
"""That ``progress`` counts."""


@dataclass(frozen=True)
class DualOptions:
    """How to stitch two circles; the attributes are as in :class:`lightdepth.capture.stitching.Options`.

    Attributes:
        projection: a key of :data:`lightdepth.capture.lens.PROJECTIONS`.
        fov: degrees across a circle; ``None`` finds it.
        distortion: of the lenses, see :class:`Lens`.
        circles: in pixels of the whole picture, left or upper one first; ``None`` finds them.
        turn: degrees by which the first picture is turned clockwise to stand upright.
        width: of the panorama in pixels, even; ``None`` for as many as the pictures have.
        uncovered: "fill", "mark" or "black".
        gains: make up for differences of exposure between the two.
    """

    projection: str = "fisheye"
    fov: float | None = None
    distortion: tuple[float, float, float] = (0.0, 0.0, 0.0)
    circles: tuple[Circle, Circle] | None = None
    turn: float = 0.0
    width: int | None = None
    uncovered: str = "fill"
    gains: bool = True


@dataclass(frozen=True)
class DualStitched:
    """A panorama from two circles, and how it came about.

    Attributes:
        panorama: with uncovered directions treated as asked.
        circles: in pixels of the whole picture.
        fov: degrees across a circle.
        lenses: of the squares around the circles, with their poses.
        photometry: gains that were applied.
        agreement: correlation of the two pictures around the seam, at most 1.
        warnings: what the user should look at.
    """

    panorama: Panorama
    circles: tuple[Circle, Circle]
    fov: float
    lenses: tuple[Lens, Lens]
    photometry: Photometry
    agreement: float
    warnings: list[str]


def stitch_dual(
    picture: Orientation,
    options: DualOptions,
    progress: Callable[[str, int, int], None] = lambda *_: None,
    tuned: CaptureParameters = DEFAULT,
) -> DualStitched:
    """Find the circles, the field of view and how the lenses stand to each other, remap and blend.

    The first lens looks to the middle of the panorama.

    Args:
        picture: both circles, one beside or above the other.
        options: how.
        progress: called with a step's name, its number and the number of steps.
        tuned: what is tried and compared.

    Raises:
        InputError: the picture is not twice as long as wide, or a circle lies outside it.
    """
    warnings: list[str] = []
    progress("circles", 0, STEPS)
    circles = options.circles or _find_circles(picture, warnings, tuned)
    parts = [_cut(picture, circle, tuned) for circle in circles]
    progress("seam", 1, STEPS)
    model = _Model(options.projection, options.distortion, circles, options.turn)
    seam = _Seam([part.radiance for part in parts], [part.seen for part in parts], tuned)
    fov, back, agreement = _aligned(model, seam, options.fov, tuned)
    if agreement < tuned.dual_agreeing:
        warnings.append(
            f"{picture.name}: the two circles agree little where they overlap (correlation {agreement:.2f} of 1): "
            "look at the seam; state --fov, --circles, or the kind of --lens"
        )
    lenses = model.lenses(fov, back)
    progress("exposures", 2, STEPS)
    photometry = _photometry(parts, lenses, options.gains, tuned)
    stops = float(np.log2(photometry.gains[1] / photometry.gains[0]).mean())
    if abs(stops) > tuned.large_gain:
        warnings.append(f"{picture.name}: the exposures of the two lenses differ by {stops:+.2f} stops")
    photographs = [
        Photograph(
            part.radiance, np.where(part.reliable, 1.0, tuned.stitch_distrust).astype(np.float32) * part.seen, lens
        )
        for part, lens in zip(parts, lenses, strict=True)
    ]
    progress("blending", 3, STEPS)
    panorama = blend(photographs, photometry, options.width or natural_width(lenses), tuned)
    progress("uncovered directions", 4, STEPS)
    radiance = panorama.radiance
    if options.uncovered == "fill":
        radiance = fill(radiance, panorama.covered)
    elif options.uncovered == "mark":
        radiance = mark(radiance, panorama.covered)
    return DualStitched(replace(panorama, radiance=radiance), circles, fov, lenses, photometry, agreement, warnings)


def _find_circles(picture: Orientation, warnings: list[str], tuned: CaptureParameters) -> tuple[Circle, Circle]:
    """The circle in each half of a picture; where its edge is not seen, the largest that fits."""
    height, width = picture.radiance.shape[:2]
    aside = width >= height
    if abs(max(width, height) - 2 * min(width, height)) > 0.1 * max(width, height):
        raise InputError(
            f"{picture.name}: is {width} x {height} pixels; two circles side by side are about twice as long as wide. "
            'State other layouts by --circles "x,y,r x,y,r"'
        )
    found = []
    for index in range(2):
        left, top = (index * width // 2, 0) if aside else (0, index * height // 2)
        half = picture.radiance[top:, left:][: height if aside else height // 2, : width // 2 if aside else width]
        level = max(float(np.percentile(half, 90)), 1e-12)
        codes = np.clip(255.0 * np.sqrt(np.maximum(half, 0.0) / level), 0, 255).astype(np.uint8)
        try:
            circle = refine_circle(find_circle([codes], tuned), half, tuned)
        except InputError:
            rows, columns = half.shape[:2]
            circle = Circle(columns / 2.0, rows / 2.0, min(rows, columns) / 2.0)
            warnings.append(f"{picture.name}: circle {index + 1} shows no edge; it is taken to fill its half")
        found.append(replace(circle, x=circle.x + left, y=circle.y + top))
    return found[0], found[1]


def _cut(picture: Orientation, circle: Circle, tuned: CaptureParameters) -> Orientation:
    """The square around a circle."""
    left, top, side = circle.box()
    height, width = picture.radiance.shape[:2]
    if not (0.0 <= circle.x <= width and 0.0 <= circle.y <= height):
        raise InputError(
            f"{picture.name}: the circle {circle.x:g},{circle.y:g},{circle.radius:g} lies outside its {width} x {height} "
            "pixels"
        )
    local = Circle(circle.x - left, circle.y - top, tuned.dual_rim * circle.radius)
    seen = circle.crop(picture.seen) & local.inside(side, side)
    return Orientation(picture.name, circle.crop(picture.radiance), seen, circle.crop(picture.reliable) & seen)


@dataclass(frozen=True)
class _Model:
    """What is known of the two lenses."""

    projection: str
    distortion: tuple[float, float, float]
    circles: tuple[Circle, Circle]
    turn: float

    def lenses(self, fov: float, back: NDArray[np.float64]) -> tuple[Lens, Lens]:
        """The lenses of the squares around the circles.

        Args:
            fov: degrees across a circle.
            back: yaw, pitch and roll of the second lens beyond looking backward, degrees, shape (3,).
        """
        poses = ((0.0, 0.0, self.turn), (180.0 + back[0], back[1], self.turn + back[2]))
        return tuple(  # type: ignore[return-value]
            self._lens(circle, fov, pose) for circle, pose in zip(self.circles, poses, strict=True)
        )

    def _lens(self, circle: Circle, fov: float, pose: tuple[float, float, float]) -> Lens:
        left, top, side = circle.box()
        shift = (circle.x - left - side / 2.0, circle.y - top - side / 2.0)
        lens = Lens(side, side, self.projection, fov, self.distortion, shift, *pose)
        half = np.radians(fov) / 2.0
        edge = lens.rotation @ [np.sin(half), np.cos(half), 0.0]
        for _ in range(6):  # The field of view across the square with which the circle has the wanted one.
            x, y = lens.project(edge)
            radius = float(np.hypot(x - side / 2.0 - shift[0], y - side / 2.0 - shift[1]))
            lens = replace(lens, fov=lens.fov * radius / circle.radius)
        return lens


class _Seam:
    """Two pictures around the seam between their lenses.

    Args:
        radiance: of each, shape (side, side, 3).
        seen: of each, shape (side, side).
        tuned: at how many points they are compared.
    """

    def __init__(
        self, radiance: list[NDArray[np.float32]], seen: list[NDArray[np.bool_]], tuned: CaptureParameters
    ) -> None:
        self._tuned = tuned
        self._seen = [each.astype(np.float32) for each in seen]
        floor = max(float(np.median(np.concatenate([r[s] for r, s in zip(radiance, seen, strict=True)]))), 1e-12)
        self._logs = [np.log(np.maximum(each.mean(axis=2), 0.0) / floor + 0.02).astype(np.float32) for each in radiance]
        self._blurred = self._logs

    def blur(self, pixels: float) -> None:
        """Compare blurred pictures from here on; what lies outside a circle plays no part."""
        self._blurred = []
        for logs, seen in zip(self._logs, self._seen, strict=True):
            weight = cv2.GaussianBlur(seen, (0, 0), pixels)
            self._blurred.append(cv2.GaussianBlur(logs * seen, (0, 0), pixels) / np.maximum(weight, np.float32(1e-3)))

    def agreement(self, lenses: tuple[Lens, Lens], band: float) -> float:
        """Correlation of the two within ``band`` degrees of the seam, each circle around it by itself, from -1 to 1."""
        directions = _ring(band, self._tuned)
        looks, known = [], np.ones(directions.shape[:2], bool)
        for lens, logs, seen in zip(lenses, self._blurred, self._seen, strict=True):
            x, y = (
                np.clip(np.nan_to_num(axis - 0.5, nan=-1e4), -1e4, 1e5).astype(np.float32)
                for axis in lens.project(directions)
            )
            looks.append(cv2.remap(logs, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT))
            known &= cv2.remap(seen, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT) > 0.99
        total, weight = 0.0, 0.0
        for first, second, both in zip(*looks, known, strict=True):
            if both.sum() < self._tuned.dual_around // 2:
                continue
            first, second = first[both] - first[both].mean(), second[both] - second[both].mean()
            spread = float(np.sqrt(np.square(first).sum() * np.square(second).sum()))
            total, weight = total + float((first * second).sum()), weight + spread
        return total / weight if weight > 0.0 else -1.0


def _ring(band: float, tuned: CaptureParameters) -> NDArray[np.float64]:
    """Directions around the seam, which passes through the poles, shape (across, around, 3)."""
    turn = np.linspace(0.0, 2.0 * np.pi, tuned.dual_around, endpoint=False)
    off = np.radians(np.linspace(-band, band, tuned.dual_across))[:, None]
    forward = np.broadcast_to(np.sin(off), (tuned.dual_across, tuned.dual_around))
    return np.stack([np.cos(off) * np.cos(turn), forward, np.cos(off) * np.sin(turn)], axis=-1)


def _aligned(
    model: _Model, seam: _Seam, fov: float | None, tuned: CaptureParameters
) -> tuple[float, NDArray[np.float64], float]:
    """Field of view, pose of the second lens, and how well the two agree."""
    blurs, step = tuned.dual_blurs, tuned.dual_fov_step
    seam.blur(blurs[0])
    fovs = np.array([fov])
    if fov is None:
        fovs = np.arange(tuned.dual_smallest_fov, tuned.dual_largest_fov + 0.5 * step, step)
    tries = [(each, np.array([0.0, 0.0, roll])) for each in fovs for roll in (0.0, 90.0, 180.0, 270.0)]
    found = max(tries, key=lambda pair: seam.agreement(model.lenses(float(pair[0]), pair[1]), tuned.dual_band))
    values = np.array([found[0], *found[1]])
    free = slice(0, 4) if fov is None else slice(1, 4)
    for blur in blurs:
        seam.blur(blur)
        band = float(np.clip(tuned.dual_rim * values[0] / 2.0 - 90.5, tuned.dual_band, tuned.dual_widest_band))

        def cost(step: NDArray[np.float64], around: NDArray[np.float64] = values, band: float = band) -> float:
            tried = around.copy()
            tried[free] += step
            return -seam.agreement(model.lenses(float(tried[0]), tried[1:]), band)

        count = values[free].size
        simplex = np.vstack([np.zeros(count), np.eye(count) * (1.5 if blur == blurs[0] else 0.3)])
        result = minimize(
            cost,
            np.zeros(count),
            method="Nelder-Mead",
            options={"initial_simplex": simplex, "maxfev": tuned.dual_evaluations, "xatol": 0.005, "fatol": 1e-6},
        )
        values = values.copy()
        values[free] += result.x
    return float(values[0]), values[1:], float(-result.fun)


def _photometry(
    parts: list[Orientation], lenses: tuple[Lens, Lens], gains: bool, tuned: CaptureParameters
) -> Photometry:
    """Gains of the two pictures by their overlap. Vignetting cannot be known: both see the seam at the same radius."""
    directions = _ring(tuned.dual_gain_band, tuned).reshape(-1, 3)
    looks, known = [], np.ones(len(directions), bool)
    for part, lens in zip(parts, lenses, strict=True):
        x, y = (np.nan_to_num(axis, nan=-1.0) for axis in lens.project(directions))
        column, row = x.astype(int).clip(0, lens.width - 1), y.astype(int).clip(0, lens.height - 1)
        inside = (x >= 0) & (x < lens.width) & (y >= 0) & (y < lens.height)
        looks.append(cv2.blur(part.radiance, (5, 5))[row, column].astype(np.float64))
        known &= inside & part.reliable[row, column] & (looks[-1].min(axis=1) > 0.0)
    if known.sum() < tuned.dual_around // 4:
        return Photometry((0.0, 0.0, 0.0), np.ones((2, 3)), float("nan"), float("nan"))
    ratio = np.log(looks[1][known] / looks[0][known])
    # Half to each, so that neither lens decides the exposure.
    offset = np.median(ratio, axis=0) if gains else np.zeros(3)
    before, after = (float(np.median(np.abs(ratio - shift))) for shift in (0.0, offset))
    return Photometry((0.0, 0.0, 0.0), np.exp(np.stack([0.5 * offset, -0.5 * offset])), before, after)
