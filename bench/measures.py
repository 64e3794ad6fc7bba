"""What is measured of images against truth, region by region, with the truth's own noise taken out."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from bench.truth import Estimate

INFLUENCE = 0.01
"""Relative change, averaged over 5 by 5 pixels, from which on a real surface counts as changed by the objects."""
SIGNIFICANT = 3.0
"""Standard deviations of the truth's noise by which the same must exceed it."""
REGIONS = ("objects", "changed", "untouched", "influenced")
BLOCK = 8
"""Side of the blocks of pixels whose means are compared."""
FEWEST_BLOCKS = 4
"""Fewer of them tell nothing about how uncertain their mean is."""
RESAMPLES = 200
"""Of the blocks of a region, to see how uncertain the error at convergence is."""


@dataclass(frozen=True)
class Measures:
    """The error of an image in one region. Relative figures refer to the region's mean radiance in the truth.

    Attributes:
        pixels: how many.
        signed: mean signed error, relative.
        rmse: root mean square error, relative, without the part that the truth's own noise explains.
        relative_mse: mean of squared error over squared truth, without that part.
        block_rmse: as ``rmse``, of the means of 8 by 8 pixels that lie in the region: mostly bias.
        psnr: decibel, of the display image.
        ssim: mean structural similarity of the display image.
        flip: mean FLIP error of the display image; ``None`` where the evaluator is not installed.
    """

    pixels: int
    signed: float
    rmse: float
    relative_mse: float
    block_rmse: float
    psnr: float
    ssim: float
    flip: float | None


@dataclass(frozen=True)
class Converged:
    """What two images that differ in their random numbers alone tell of the error that stays, in one region.

    All figures are relative to the region's mean radiance in the truth.

    Attributes:
        signed: mean signed error of the mean of both images.
        error: root of the mean squared error of the means of 8 by 8 pixels, without the noise of the images and of the
            truth; 0 where the estimate of the square is not positive.
        low: lower end of the interval that holds the error with a probability of about 68 %.
        high: upper end of it.
        truth_noise: what the truth's noise alone would be in ``error``, had it not been taken out.
    """

    signed: float
    error: float
    low: float
    high: float
    truth_noise: float


def find_regions(truth: Estimate, empty: NDArray[np.float64]) -> dict[str, NDArray[np.bool_]]:
    """Masks of shape (height, width).

    Args:
        truth: the place with the objects, with the variance of its difference to ``empty``.
        empty: radiance without them, shape (height, width, 3).

    Returns:
        ``objects`` (covered, wholly or in part), ``changed`` (real surfaces in shadow or bounce light), ``untouched``,
        and ``influenced``, which is the first two together.
    """
    objects = truth.coverage > 0.0
    change = np.where(objects, 0.0, (truth.mean - empty).mean(axis=-1))
    noise = np.sqrt(np.maximum(cv2.blur(np.where(objects, 0.0, truth.variance.mean(axis=-1)), (5, 5)), 0.0) / 25.0)
    limit = np.maximum(INFLUENCE * cv2.blur(empty.mean(axis=-1), (5, 5)), SIGNIFICANT * noise)
    changed = ~objects & (np.abs(cv2.blur(change, (5, 5))) > limit)
    return {"objects": objects, "changed": changed, "untouched": ~objects & ~changed, "influenced": objects | changed}


def measure(image: NDArray[np.float64], truth: Estimate, regions: dict[str, NDArray[np.bool_]]) -> dict[str, Any]:
    """:class:`Measures` of every region that has pixels, as plain data.

    Args:
        image: linear RGB, shape (height, width, 3).
        truth: what it should be.
        regions: from :func:`find_regions`.
    """
    exposure = 0.4 / float(np.median(truth.mean.mean(axis=-1)))
    shown, wanted = (display(exposure * each) for each in (image, truth.mean))
    similarity, flip = structural_similarity(shown, wanted), flip_error(shown, wanted)
    difference = image - truth.mean
    result = {}
    for name, mask in regions.items():
        if not mask.any():
            continue
        error, variance, reference = difference[mask], truth.variance[mask], truth.mean[mask]
        mean = float(reference.mean())
        squared = float(np.mean(error**2) - variance.mean())
        floor = (0.01 * mean) ** 2
        relative = float(np.mean((error**2 - variance) / (reference**2 + floor)))
        difference_shown = float(np.mean((shown[mask] - wanted[mask]) ** 2))
        result[name] = asdict(
            Measures(
                int(mask.sum()),
                float(error.sum() / reference.sum()),
                _root(squared) / mean,
                max(relative, 0.0),
                _root(_mean(block_products(difference, difference, truth.variance, mask))) / mean,
                float(-10.0 * np.log10(max(difference_shown, 1e-12))),
                float(similarity[mask].mean()),
                None if flip is None else float(flip[mask].mean()),
            )
        )
    return result


def converged(
    first: NDArray[np.float64], second: NDArray[np.float64], truth: Estimate, regions: dict[str, NDArray[np.bool_]]
) -> dict[str, Any]:
    """:class:`Converged` of every region that has enough blocks, as plain data.

    The noise of the images is independent, so that it does not contribute to the mean product of their errors. The
    truth's is the same in both, and its square is in every product; its variance is known and subtracted.

    Args:
        first: linear RGB, shape (height, width, 3).
        second: the same rendered with another seed.
        truth: what they should be.
        regions: from :func:`find_regions`.
    """
    errors = first - truth.mean, second - truth.mean
    result = {}
    for name, mask in regions.items():
        products = block_products(*errors, truth.variance, mask)
        if len(products) < FEWEST_BLOCKS:
            continue
        squared, (low, high) = float(products.mean()), interval(products)
        variances, count = _block_sums(truth.variance, mask)
        reference = truth.mean[mask]
        mean = float(reference.mean())
        result[name] = asdict(
            Converged(
                float((errors[0] + errors[1])[mask].sum() / 2.0 / reference.sum()),
                _root(squared) / mean,
                _root(low) / mean,
                # An estimate below 0 is one of an error of 0, and no more certain for that.
                _root(max(squared, 0.0) + high - squared) / mean,
                _root(_mean(variances / count**2)) / mean,
            )
        )
    return result


def interval(values: NDArray[np.float64]) -> tuple[float, float]:
    """Ends of the interval in which the mean of independent values, shape (n,), lies with a probability of about 68 %.

    From means of the values drawn with replacement (bootstrap), as many as there are values; always the same draws.
    """
    drawn = np.random.default_rng(0).integers(len(values), size=(RESAMPLES, len(values)))
    low, high = np.percentile(values[drawn].mean(axis=1), (16.0, 84.0))
    return float(low), float(high)


def display(radiance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Linear radiance as sRGB values in [0, 1], clipped, without a tone curve."""
    linear = np.clip(radiance, 0.0, 1.0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1.0 / 2.4) - 0.055)


def _root(squared: float) -> float:
    return float(np.sqrt(max(squared, 0.0)))


def _mean(values: NDArray[np.float64]) -> float:
    return float(values.mean()) if values.size else 0.0


def block_products(
    first: NDArray[np.float64], second: NDArray[np.float64], variance: NDArray[np.float64], mask: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Product of two images' errors in the mean of each block of 8 by 8 pixels, without the variance that they share.

    Args:
        first: errors, shape (height, width, 3).
        second: the same of the other image; ``first`` again gives squared errors.
        variance: of the noise that both have in common, the truth's, the same shape.
        mask: the region, shape (height, width); blocks of which less than half is in it do not count.

    Returns:
        Mean of the channels, shape (blocks,).
    """
    (one, count), (other, _), (shared, _) = (_block_sums(values, mask) for values in (first, second, variance))
    return ((one * other - shared) / count**2).mean(axis=-1)


def _block_sums(
    values: NDArray[np.float64], mask: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Sums over the pixels of each block that are in the region, shape (blocks, 3), and their number, (blocks, 1)."""
    height, width = (length // BLOCK * BLOCK for length in mask.shape)

    def summed(image: NDArray[np.float64]) -> NDArray[np.float64]:
        masked = np.where(mask[..., None], image, 0.0)[:height, :width]
        return masked.reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK, -1).sum(axis=(1, 3))

    count = summed(np.ones((*mask.shape, 1)))
    inside = count[..., 0] >= BLOCK * BLOCK / 2
    return summed(values)[inside], count[inside]


def structural_similarity(first: NDArray[np.float64], second: NDArray[np.float64]) -> NDArray[np.float64]:
    """SSIM of Wang et al. 2004 (Gaussian window of 1.5 pixels, 11 wide) of images in [0, 1], mean of the channels."""

    def smooth(image: NDArray[np.float64]) -> NDArray[np.float64]:
        return cv2.GaussianBlur(image, (11, 11), 1.5, borderType=cv2.BORDER_REFLECT)

    c1, c2 = 0.01**2, 0.03**2
    mean_a, mean_b = smooth(first), smooth(second)
    variance_a, variance_b = smooth(first * first) - mean_a**2, smooth(second * second) - mean_b**2
    covariance = smooth(first * second) - mean_a * mean_b
    value = ((2 * mean_a * mean_b + c1) * (2 * covariance + c2)) / (
        (mean_a**2 + mean_b**2 + c1) * (variance_a + variance_b + c2)
    )
    return value.mean(axis=-1)


def flip_error(shown: NDArray[np.float64], wanted: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """FLIP error map of display images in [0, 1], shape (height, width), by its authors' evaluator."""
    try:
        import flip_evaluator
    except ImportError:
        return None
    images = (np.ascontiguousarray(each, dtype=np.float32) for each in (wanted, shown))
    error, _, _ = flip_evaluator.evaluate(*images, "LDR", applyMagma=False, computeMeanError=False)
    return np.asarray(error, dtype=np.float64).reshape(wanted.shape[:2])
