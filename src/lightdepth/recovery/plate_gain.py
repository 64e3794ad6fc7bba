"""The gain of a plate: from what the panoramas show of a surface to what the plate shows of it, per channel.

Theory, section 10, eq. (16). Exposure and white balance are a factor per channel. Where the plate differs by more, its
camera is wrong, the light was another, or a tone curve was applied to it, and no factor can correct that.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.cameras import Viewpoint
from lightdepth.kernel.arrays import aligned
from lightdepth.parameters.balance import DEFAULT, BalanceParameters
from lightdepth.place.place import Place


@dataclass(frozen=True)
class PlateBalance:
    """How a plate compares with the panoramas.

    Attributes:
        gain: of each channel, shape (3,), float32.
        shared: blocks of the plate that are compared.
        deviation: typical relative deviation of these, after the gain; nan where there are none.
        disagrees: share of them that differ by more than a quarter.
        modelled: share of the plate's pixels that show a real surface.
        seen: share of the plate's pixels that show what a panorama sees too.
        problem: why the plate cannot be used; ``None`` where it can.
    """

    gain: NDArray[np.float32]
    shared: int
    deviation: float
    disagrees: float
    modelled: float
    seen: float
    problem: str | None = None


def solve_plate_gain(
    radiance: NDArray[np.float32],
    view: Viewpoint,
    place: Place,
    given: tuple[float, float, float] | None = None,
    tuned: BalanceParameters = DEFAULT,
) -> PlateBalance:
    """Solve the gain of a plate, or compare a given one.

    Args:
        radiance: of the plate, shape (height, width, 3), float32.
        view: its camera.
        place: the photographed place.
        given: the gain, where it is known.
        tuned: what no gain explains, among others.
    """
    size = max(1, round(view.resolution[0] / tuned.plate_blocks))
    shown, seen = _panoramas(view, place, size, tuned)
    ratio, dark = _ratios(radiance, shown, seen.comparable, size, tuned)
    gain = np.ones(3, np.float32) if given is None else np.asarray(given, np.float32)
    if len(ratio) < tuned.fewest:
        nothing = (
            f"shows next to nothing that a panorama sees too ({len(ratio)} of {seen.comparable.size} parts of it can "
            "be compared), so that its gain cannot be solved; correct the camera or the model, or give gain = [r, g, b]"
        )
        return PlateBalance(gain, len(ratio), np.nan, 0.0, seen.modelled, seen.seen, nothing if given is None else None)
    if given is None:
        gain = np.exp(np.median(ratio, axis=0)).astype(np.float32)
    off = np.abs(ratio - np.log(gain)).max(axis=1)
    typical = float(np.median(off))
    problem = None
    if given is None:
        contrast = _contrast(ratio, dark, tuned.plate_correlation)
        if contrast is not None and not 1.0 / tuned.plate_contrast <= contrast <= tuned.plate_contrast:
            problem = (
                f"its contrast is {contrast:.2g} times that of the panoramas, which no gain explains: it is not linear "
                "(a log or video curve, or a look); give the plate as linear EXR, or as it left the camera, or give gain = "
                "[r, g, b]"
            )
        elif typical > math.log(tuned.too_far):
            problem = (
                f"differs from the panoramas by {100.0 * np.expm1(typical):.0f} % in the typical part, which no gain "
                "explains; is its camera right, and was it taken in the same light? If so, give gain = [r, g, b]"
            )
    disagrees = float((off > math.log(tuned.disagrees)).mean())
    return PlateBalance(gain, len(ratio), float(np.expm1(typical)), disagrees, seen.modelled, seen.seen, problem)


@dataclass(frozen=True)
class _Seen:
    """What is known of the blocks.

    Attributes:
        comparable: wholly on one face that a panorama sees, not at a grazing angle, and matte, shape (rows, columns).
        modelled: share of their points on a real surface.
        seen: share of their points that a panorama sees.
    """

    comparable: NDArray[np.bool_]
    modelled: float
    seen: float


def _panoramas(view: Viewpoint, place: Place, size: int, tuned: BalanceParameters) -> tuple[NDArray[np.float64], _Seen]:
    """Mean of what the panoramas show in each block of ``size`` pixels along each side, shape (rows, columns, 3)."""
    width, height = view.resolution
    columns, rows = width // size, height // size
    column, row = (grid.astype(np.float32) for grid in np.meshgrid(np.arange(columns), np.arange(rows)))
    total = np.zeros((rows * columns, 3))
    comparable = np.ones(rows * columns, bool)
    normal: NDArray | None = None
    modelled = seen = 0.0
    points = tuned.plate_points
    for i, j in np.ndindex(points, points):
        # As data: numbers in the program would compile the same large kernel for each of the points.
        x, y = (column + (i + 0.5) / points) * (size / width), (row + (j + 0.5) / points) * (size / height)
        rays = view.rays(mi.Point2f(mi.Float(aligned(x)), mi.Float(aligned(y))), mi.Point2f(0.5))
        hit = place.surfaces.first_real(rays.ray, rays.inside)
        shared = mi.Bool(False)
        for share in place.photograph.shares(hit, rays.ray):
            shared |= share > 0.0
        shared &= hit.valid
        good = shared & (hit.gloss == 0) & (dr.abs(dr.dot(hit.normal, rays.ray.d)) > tuned.steep)
        colour = place.photograph.sharp(hit, rays.ray)
        dr.eval(hit.valid, hit.normal, shared, good, colour)
        total += colour.numpy().T
        modelled += float(hit.valid.numpy().mean())
        seen += float(shared.numpy().mean())
        here = hit.normal.numpy().T
        normal = here if normal is None else normal
        comparable &= good.numpy() & (np.einsum("ij,ij->i", here, normal) > tuned.plate_flat)
    known = _Seen(comparable.reshape(rows, columns), modelled / points**2, seen / points**2)
    return (total / points**2).reshape(rows, columns, 3), known


def _ratios(
    radiance: NDArray[np.float32],
    shown: NDArray[np.float64],
    comparable: NDArray[np.bool_],
    size: int,
    tuned: BalanceParameters,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Logarithms of the ratios of plate and panoramas, and of the panoramas themselves, in usable blocks, shapes (n, 3)."""
    rows, columns = comparable.shape
    blocks = radiance[: rows * size, : columns * size].reshape(rows, size, columns, size, 3)
    plate = blocks.mean(axis=(1, 3), dtype=np.float64)
    usable = comparable & (blocks.max(axis=(1, 3)) < tuned.plate_clipped * radiance.max(axis=(0, 1))).all(axis=2)
    for image in (plate, shown):
        middle = np.median(image[usable], axis=0) if usable.any() else np.ones(3)
        usable &= (image > tuned.dark * middle).all(axis=2) & (image < tuned.bright * middle).all(axis=2)
    panoramas = np.log(shown[usable])
    return np.log(plate[usable]) - panoramas, panoramas


def _contrast(ratio: NDArray[np.float64], panoramas: NDArray[np.float64], correlation: float) -> float | None:
    """Contrast of the plate over that of the panoramas, as an exponent; ``None`` where they do not go together.

    By the ratio of their deviations (the reduced major axis), which noise in either changes little where both have some.
    """
    one, other = panoramas.mean(axis=1), (panoramas + ratio).mean(axis=1)
    spreads = np.std(one), np.std(other)
    if min(spreads) <= 0.0 or np.corrcoef(one, other)[0, 1] < correlation:
        return None
    return float(spreads[1] / spreads[0])
