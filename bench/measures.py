"""What is measured of an image against truth, region by region, with the truth's own noise taken out."""

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
                _block_rmse(difference, truth.variance, mask) / mean,
                float(-10.0 * np.log10(max(difference_shown, 1e-12))),
                float(similarity[mask].mean()),
                None if flip is None else float(flip[mask].mean()),
            )
        )
    return result


def display(radiance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Linear radiance as sRGB values in [0, 1], clipped, without a tone curve."""
    linear = np.clip(radiance, 0.0, 1.0)
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1.0 / 2.4) - 0.055)


def _root(squared: float) -> float:
    return float(np.sqrt(max(squared, 0.0)))


def _block_rmse(
    difference: NDArray[np.float64], variance: NDArray[np.float64], mask: NDArray[np.bool_], size: int = 8
) -> float:
    """Root mean square of the errors of blocks' means; blocks of which less than half is in the region do not count."""
    height, width = (length // size * size for length in mask.shape)

    def summed(values: NDArray[np.float64]) -> NDArray[np.float64]:
        masked = np.where(mask[..., None], values, 0.0)[:height, :width]
        return masked.reshape(height // size, size, width // size, size, -1).sum(axis=(1, 3))

    count = summed(np.ones((*mask.shape, 1)))
    inside = count[..., 0] >= size * size / 2
    if not inside.any():
        return 0.0
    squared = (summed(difference)[inside] ** 2 - summed(variance)[inside]) / count[inside] ** 2
    return _root(float(squared.mean()))


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
