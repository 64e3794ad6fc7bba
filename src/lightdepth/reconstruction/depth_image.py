"""Measured or estimated depth images: reading, and closing what was not measured."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.linalg import spsolve

from lightdepth.directions import pixel_solid_angles
from lightdepth.errors import InputError, warn
from lightdepth.images.distances import Kind, along_rays, check_kind, read_distances, warn_of_sky, warn_of_unit
from lightdepth.parameters.reconstruction import DEFAULT, DepthParameters
from lightdepth.regions import connected_regions

FloatArray = NDArray[np.float64]


@dataclass(frozen=True)
class DepthImage:
    """Distances from the capture point, as they were measured.

    Attributes:
        depth: metres along the ray, shape (height, 2 height), float64; NaN where nothing was measured, inf for sky.
    """

    depth: FloatArray

    @property
    def missing(self) -> NDArray[np.bool_]:
        """Where nothing was measured, shape (height, 2 height)."""
        return np.isnan(self.depth)


def read_depth_image(
    path: Path,
    scale: float | None = None,
    sky: bool = False,
    kind: Kind | None = None,
    sky_beyond: float | None = None,
    channel: str | None = None,
    tuned: DepthParameters = DEFAULT.depth,
) -> DepthImage:
    """Read an equirectangular depth image.

    Args:
        path: OpenEXR, 16-bit PNG, or a NumPy array in a .npy file; see :func:`lightdepth.images.distances.read_distances`.
        scale: metres per unit of the file; whole numbers must have it, for others ``None`` is 1. Of disparity, the
            distance in metres of a disparity of 1.
        sky: what was not measured (NaN, 0, negative, or 65535 in a PNG) is sky. Infinite distances always are, as are the
            numbers by which renderers mark them.
        kind: what the file holds; ``None`` is distances along the rays, if they look like such.
        sky_beyond: metres from which on a distance is sky.
        channel: of an OpenEXR file, where it is not found by itself.
        tuned: how much may be missing without a warning.

    Raises:
        InputError: the file is missing, unreadable, of another format or shape, holds whole numbers and is given without
            a scale, holds distances along the viewing axis though no kind is given, or nothing is measured in it.
    """
    values, whole = read_distances(path, channel)
    if values.shape[0] < 8:
        raise InputError(f"{path}: depth has {values.shape[0]} rows; at least 8 are needed")
    if whole and scale is None:
        raise InputError(
            f"{path}: holds whole numbers; give --scale, the metres of one (0.001 for millimetres), or --estimated, if a "
            "network made it"
        )
    if kind is None:
        check_kind(path, values)
    depth = along_rays(values, kind or "ray", 1.0 if scale is None else scale)
    depth[~(depth > 0.0)] = np.inf if sky else np.nan
    known = depth[np.isfinite(depth)]
    if known.size > 1 and known.min() == known.max():
        raise InputError(
            f"{path}: all its distances are {known[0]:g} m; that cannot be the depth of a place. Was the picture "
            "exported with the wrong range or channel?"
        )
    if sky_beyond is not None:
        depth[depth >= sky_beyond] = np.inf
    if not np.isfinite(depth).any():
        raise InputError(f"{path}: no pixel holds a positive, finite distance")
    warn_of_sky(path, depth)
    if scale is None:
        warn_of_unit(path, depth)
    unmeasured = np.isnan(depth)
    share = float((unmeasured.mean(axis=1) * pixel_solid_angles(*depth.shape)).sum() * depth.shape[1] / (4.0 * np.pi))
    if share > tuned.much_missing:
        warn(
            f"{path}: {100.0 * share:.0f} % of all directions were not measured (0, negative, or no number) and are "
            "closed by going on with the surfaces around them; if that is the sky, give --sky"
        )
    return DepthImage(depth)


def reduced(image: DepthImage, max_width: int) -> DepthImage:
    """The image with at most ``max_width`` columns where its size can be divided so: the median of square blocks."""
    height, width = image.depth.shape
    factor = next((k for k in range(-(-width // max_width), height // 8 + 1) if height % k == 0), 1)
    if width <= max_width or factor == 1:
        return image
    blocks = image.depth.reshape(height // factor, factor, width // factor, factor).swapaxes(1, 2)
    blocks = np.sort(blocks.reshape(height // factor, width // factor, -1), axis=-1)  # NaN comes last.
    measured = np.count_nonzero(~np.isnan(blocks), axis=-1, keepdims=True)
    return DepthImage(np.take_along_axis(blocks, np.maximum(measured - 1, 0) // 2, axis=-1)[:, :, 0])


def fill_missing(image: DepthImage, tuned: DepthParameters = DEFAULT.depth) -> FloatArray:
    """Close what was not measured by going on with the surfaces around it.

    Args:
        image: the measured distances.
        tuned: how they are continued.

    Returns:
        Distances, shape (height, 2 height), float64: finite and positive, or inf for sky.
    """
    missing = image.missing
    reciprocal = np.divide(1.0, image.depth, out=np.zeros_like(image.depth), where=~missing)
    filled = continued(reciprocal, missing, ~missing, tuned)
    return np.divide(1.0, filled, out=np.full_like(filled, np.inf), where=filled > 0.0)


def denoised(image: DepthImage, tuned: DepthParameters = DEFAULT.depth) -> DepthImage:
    """The image without the measurement's noise, as far as neighbouring pixels separate it from shape.

    A bilateral filter (Tomasi and Manduchi, 1998) on the reciprocal distance, which leaves planes and jumps as they
    are. Its range follows the noise at each distance; an exact image is not changed.

    Args:
        image: the measured distances.
        tuned: how wide the filter is.
    """
    reciprocal = 1.0 / fill_missing(image, tuned)
    seen = reciprocal > 0.0
    levels, noise = _noise(reciprocal, seen & ~image.missing, tuned)
    if len(levels) < 2 or np.median(noise / levels) < tuned.negligible_noise:
        return image
    # On the scale s with ds = dq / noise(q) the noise is 1 everywhere.
    scale = np.concatenate([[0.0], np.cumsum(np.diff(levels) * 0.5 * (1.0 / noise[1:] + 1.0 / noise[:-1]))])
    levels = np.concatenate([[levels[0] - 1e3 * noise[0]], levels, [levels[-1] + 1e3 * noise[-1]]])
    scale = np.concatenate([[scale[0] - 1e3], scale, [scale[-1] + 1e3]])
    smooth = np.interp(_bilateral(np.interp(reciprocal, levels, scale), tuned), scale, levels)
    kept = ~seen | (reciprocal < levels[0]) | (reciprocal > levels[-1])
    return DepthImage(np.where(kept | image.missing, image.depth, 1.0 / smooth))


def _bilateral(image: FloatArray, tuned: DepthParameters) -> FloatArray:
    """Bilateral filter of a panorama whose noise has a standard deviation of 1.

    Toward the poles, where columns are narrower than rows are high, it works on means of 2, 4, 8 ... columns, so that
    it is about as wide as high everywhere.
    """
    height, width = image.shape
    across = tuned.filter_width
    half = across // 2
    narrowness = np.sin(np.pi * (np.arange(height) + 0.5) / height)
    result = np.empty_like(image)
    step = 1
    while True:
        means = image.reshape(height, width // step, step).mean(axis=2)
        # Over a pole the panorama goes on at the opposite longitude.
        opposite = np.roll(means, means.shape[1] // 2, axis=1)
        around = np.vstack([opposite[:half][::-1], means, opposite[-half:][::-1]])
        around = np.pad(around, ((0, 0), (half, half)), mode="wrap").astype(np.float32)
        smooth = cv2.bilateralFilter(around, across, tuned.filter_range, across / 3.0)[half:-half, half:-half]
        position = (np.arange(width) + 0.5) / step - 0.5
        left = np.floor(position).astype(int)
        share = position - left
        fine = smooth[:, left % smooth.shape[1]] * (1.0 - share) + smooth[:, (left + 1) % smooth.shape[1]] * share
        rows = narrowness <= 1.0 / step
        result[rows] = fine[rows]
        step *= 2
        if not rows.any() or width % (2 * step) or width // step < 4 * across:
            return result


def _noise(
    reciprocal: FloatArray, measured: NDArray[np.bool_], tuned: DepthParameters
) -> tuple[FloatArray, FloatArray]:
    """Standard deviation of the noise at some levels of the reciprocal distance q, each of shape (n,).

    Along a meridian a plane has ``q(t + d) + q(t - d) = 2 cos(d) q(t)``; what deviates is noise, but for edges, which
    the median ignores.
    """
    q = reciprocal[1:-1]
    whole = measured[1:-1] & measured[:-2] & measured[2:]
    deviation = np.abs(q - (reciprocal[:-2] + reciprocal[2:]) / (2.0 * np.cos(np.pi / len(reciprocal))))[whole]
    order = np.argsort(q[whole])
    groups = [group for group in np.array_split(order, tuned.noise_levels) if len(group) >= tuned.noise_pixels]
    levels = np.array([np.median(q[whole][group]) for group in groups])
    noise = np.array([1.4826 / np.sqrt(1.5) * np.median(deviation[group]) for group in groups])
    distinct = np.concatenate([[True], np.diff(levels) > 0.0]) if groups else np.zeros(0, dtype=bool)
    return levels[distinct], np.maximum(noise[distinct], 1e-9)


def continued(
    reciprocal: FloatArray,
    unknown: NDArray[np.bool_],
    known: NDArray[np.bool_],
    tuned: DepthParameters = DEFAULT.depth,
) -> FloatArray:
    """Go on with surfaces into pixels where they are not known.

    The reciprocal distance q of a plane is linear in the direction, ``q(w) = n . w / d``, and so solves
    ``(Laplace-Beltrami + 2) q = 0`` on the sphere. Solving that with the known pixels as boundary values continues a
    plane exactly, and anything else smoothly.

    Args:
        reciprocal: 1 / distance, 0 for sky, shape (height, 2 height); read where it is known.
        unknown: the pixels to find, shape (height, 2 height).
        known: the pixels to go on from; sky is none of them, nor are pixels in neither mask.
        tuned: how large holes are, and what values they may get.

    Returns:
        A copy with the unknown pixels set, to values between ``least_continued`` times the least and ``most_continued``
        times the greatest of the known ones that their region touches; 0 (sky) in a region that touches none.
    """
    result = reciprocal.copy()
    known = known & (reciprocal > 0.0)
    regions, count = connected_regions(unknown)
    low, high = np.full(count + 1, np.inf), np.zeros(count + 1)
    for beside, value in zip(_neighbours(known), _neighbours(reciprocal), strict=True):
        border = unknown & beside
        np.minimum.at(low, regions[border], value[border])
        np.maximum.at(high, regions[border], value[border])
    height, width = reciprocal.shape
    pixel_areas = np.repeat(pixel_solid_angles(height, width), width)
    areas = np.bincount(regions.ravel(), weights=pixel_areas, minlength=count + 1)
    small = areas <= 2.0 * np.pi * (1.0 - np.cos(np.radians(tuned.largest_hole)))
    result[unknown] = 0.0
    for constant, chosen in ((2.0, small & (high > 0.0)), (0.0, ~small & (high > 0.0))):
        region = unknown & chosen[regions]
        if region.any():
            here = regions[region]
            found = _solve(reciprocal, region, known, constant)
            result[region] = np.clip(found, tuned.least_continued * low[here], tuned.most_continued * high[here])
    return result


def _neighbours(values: NDArray) -> list[NDArray]:
    """The four images of every pixel's neighbour: above, below, left and right; rows end, columns go round."""
    above, below = np.zeros_like(values), np.zeros_like(values)
    above[1:], below[:-1] = values[:-1], values[1:]
    return [above, below, np.roll(values, 1, axis=1), np.roll(values, -1, axis=1)]


def _solve(reciprocal: FloatArray, region: NDArray[np.bool_], known: NDArray[np.bool_], constant: float) -> FloatArray:
    """Solve (Laplace-Beltrami + constant) q = 0 in a region by five-point differences on the latitude-longitude grid.

    Known pixels are boundary values; toward all others nothing flows.
    """
    height, width = reciprocal.shape
    step_theta, step_phi = np.pi / height, 2.0 * np.pi / width
    own = np.arange(np.count_nonzero(region))
    index = np.zeros(region.shape, dtype=np.intp)
    index[region] = own
    theta = np.broadcast_to((np.arange(height)[:, None] + 0.5) * step_theta, region.shape)[region]
    upward, downward = (np.sin(theta + 0.5 * side * step_theta) / (np.sin(theta) * step_theta**2) for side in (-1, 1))
    sideways = 1.0 / (np.sin(theta) * step_phi) ** 2
    diagonal = np.full(len(own), -constant)
    right_side = np.zeros(len(own))
    triplets = []
    for weight, inner, border, value, other in zip(
        (upward, downward, sideways, sideways),
        _neighbours(region),
        _neighbours(known),
        _neighbours(reciprocal),
        _neighbours(index),
        strict=True,
    ):
        inside, beside = inner[region], border[region]
        diagonal += np.where(inside | beside, weight, 0.0)
        right_side += np.where(beside, weight * value[region], 0.0)
        triplets.append((own[inside], other[region][inside], -weight[inside]))
    triplets.append((own, own, diagonal))
    rows, columns, entries = (np.concatenate(part) for part in zip(*triplets, strict=True))
    return np.asarray(spsolve(coo_array((entries, (rows, columns)), shape=(len(own), len(own))).tocsc(), right_side))
