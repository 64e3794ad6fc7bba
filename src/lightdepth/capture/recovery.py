"""The camera's response from a bracket of the same view, after Debevec and Malik (SIGGRAPH 1997), made robust.

Their equation is kept: ``g(reading) = ln(radiance) + ln(exposure)``, linear in the unknown curve ``g`` and in the
unknown radiances. What differs from the textbook (and from OpenCV's ``CalibrateDebevec``, which the tests compare):
thousands of evenly lit patches instead of some dozens of single pixels; smoothness is asked of the curve's difference
from sRGB, not of the curve, which bends most where it is known least; readings count by what they determine (the noise of
``g`` is its slope times the noise of the reading); and patches that changed during the bracket lose their say.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix

from lightdepth.capture.photograph import Codes
from lightdepth.capture.response import LEVELS, Response, normalised, srgb_to_linear
from lightdepth.parameters.capture import DEFAULT, CaptureParameters

FloatArray = NDArray[np.float64]


def sample_patches(
    photograph: Codes, tuned: CaptureParameters = DEFAULT
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Mean readings of small patches, and how uneven the patches are.

    Args:
        photograph: camera readings, shape (height, width, 3).
        tuned: which patches, and what is clipped.

    Returns:
        ``(means, spreads)``: readings in [0, 1] of shape (rows, columns, 3), and their standard deviation. The mean of
        a patch that holds a clipped pixel would be wrong: it is 1, or 0 where a pixel is black.
    """
    patch = tuned.response_patch
    rows, columns = (side // patch for side in photograph.shape[:2])
    codes = photograph[: rows * patch, : columns * patch].reshape(rows, patch, columns, patch, 3)
    step = max(1, int(np.sqrt(rows * columns / tuned.response_most_patches)))
    white = np.float32(np.iinfo(photograph.dtype).max)
    patches = codes[::step, :, ::step].astype(np.float32) / white
    pixels = [patches[:, row, :, column] for row in range(patch) for column in range(patch)]
    means = np.mean(pixels, axis=0)
    spreads = np.std(pixels, axis=0)
    means[np.max(pixels, axis=0) > tuned.white] = 1.0
    means[np.min(pixels, axis=0) < tuned.black] = 0.0
    return means, spreads


def choose_samples(
    patches: Sequence[tuple[NDArray[np.float32], NDArray[np.float32]]], count: int = 2000, seed: int = 0
) -> NDArray[np.float32]:
    """The most even patches, spread over all brightnesses.

    Args:
        patches: :func:`sample_patches` of every photograph of a bracket, from one exposure to the next.
        count: how many to choose at most.
        seed: of the choice among equals.

    Returns:
        Readings in [0, 1], shape (count, number of photographs, 3).
    """
    means = np.stack([mean.reshape(-1, 3) for mean, _ in patches], axis=1)
    # Unevenness in the exposure that shows it best; clipped patches look even and determine nothing.
    spread = np.max([deviation.reshape(-1, 3).max(axis=1) for _, deviation in patches], axis=0)
    brightness = means.mean(axis=(1, 2))
    usable = np.flatnonzero((brightness > 0.01) & (brightness < 0.99))
    if usable.size == 0:
        return means[:0]
    rng = np.random.default_rng(seed)
    order = usable[np.lexsort((rng.random(usable.size), brightness[usable]))]
    bins = np.array_split(order, max(1, min(count // 8, order.size)))
    return means[np.concatenate([group[np.argsort(spread[group])[:8]] for group in bins])]


def trust(readings: NDArray[np.floating], tuned: CaptureParameters = DEFAULT) -> NDArray[np.floating]:
    """Weight of readings in [0, 1]: none for black and clipped ones, full between."""
    above, below = (readings - tuned.black) / tuned.reading_fade, (tuned.white - readings) / tuned.reading_fade
    return np.clip(above, 0.0, 1.0) * np.clip(below, 0.0, 1.0)


def recover_response(
    samples: NDArray[np.float32], exposures: Sequence[float], tuned: CaptureParameters = DEFAULT
) -> Response | None:
    """Recover the response of a camera.

    Args:
        samples: readings in [0, 1] of the same points in every photograph, shape (points, photographs, 3).
        exposures: amounts of light of the photographs.
        tuned: how it is solved, and from what.

    Returns:
        The response, or None where the samples do not determine it (too few readings that are neither black nor
        white, or exposures that are alike).
    """
    log_exposures = np.log(np.asarray(exposures, dtype=np.float64))
    if np.ptp(log_exposures) < np.log(tuned.response_least_range):
        return None
    curves = [_recover_channel(samples[:, :, channel].astype(np.float64), log_exposures, tuned) for channel in range(3)]
    known = [curve for curve in curves if curve is not None]
    return normalised(np.array(known)) if len(known) == 3 else None


def _recover_channel(readings: FloatArray, log_exposures: FloatArray, tuned: CaptureParameters) -> FloatArray | None:
    weights = trust(readings, tuned)
    weights[np.count_nonzero(weights, axis=1) < 2] = 0.0
    point, photograph = np.nonzero(weights)
    if point.size < tuned.response_fewest_readings:
        return None
    reading, weight = readings[point, photograph], weights[point, photograph]
    levels = np.linspace(0.0, 1.0, LEVELS)
    base = np.log(np.maximum(srgb_to_linear(levels), 1e-9))
    base[0] = base[1] - 1.0
    interpolate = _interpolation(reading)
    target = log_exposures[photograph]
    by_point = csr_matrix((np.ones(point.size), (point, np.arange(point.size))), shape=(readings.shape[0], point.size))
    second = np.diff(np.eye(LEVELS), n=2, axis=0)
    curve, robust = base, np.ones_like(weight)
    for _ in range(tuned.response_rounds):
        # Readings have about equal noise everywhere; g has it times its slope.
        slope = np.maximum(interpolate @ np.gradient(curve, levels), tuned.response_least_slope)
        confidence = weight * robust / slope**2
        total = np.maximum(by_point @ confidence, 1e-30)
        # Debevec and Malik's equation 3 with the radiances eliminated, for the curve's difference from the base.
        weighted = interpolate.multiply(confidence[:, None]).tocsr()
        sums = (by_point @ weighted).toarray()
        error = target - interpolate @ base
        normal = (interpolate.T @ weighted).toarray() - sums.T @ (sums / total[:, None])
        right = weighted.T @ error - sums.T @ ((by_point @ (confidence * error)) / total)
        size = normal.trace() / LEVELS
        normal += tuned.response_smoothness * size * second.T @ second
        normal[LEVELS // 2, LEVELS // 2] += size  # The curve's level is free; this holds it.
        curve = base + np.linalg.solve(normal, right)
        value = interpolate @ curve - target
        residual = (value - ((by_point @ (confidence * value)) / total)[point]) / slope
        scale = 1.4826 * np.median(np.abs(residual)) + 1e-4
        robust = 1.0 / (1.0 + (residual / (tuned.response_scale * scale)) ** 2)
    exposure = np.exp(curve)
    exposure[0] = 0.0
    return np.maximum.accumulate(exposure)


def _interpolation(readings: FloatArray) -> csr_matrix:
    """Matrix that interpolates a curve of 256 levels at readings, shape (readings, 256)."""
    lower = np.minimum((readings * (LEVELS - 1)).astype(int), LEVELS - 2)
    share = readings * (LEVELS - 1) - lower
    rows = np.tile(np.arange(readings.size), 2)
    return csr_matrix(
        (np.concatenate([1.0 - share, share]), (rows, np.concatenate([lower, lower + 1]))),
        shape=(readings.size, LEVELS),
    )
