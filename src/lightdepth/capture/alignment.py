"""Hand-held brackets: how each photograph must be moved to lie on the one in the middle."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.capture.recovery import trust
from lightdepth.parameters.capture import DEFAULT, CaptureParameters


def comparison_image(photograph: NDArray, tuned: CaptureParameters = DEFAULT) -> NDArray[np.float32]:
    """What alignment needs of a photograph: grey readings in [0, 1], made small.

    Args:
        photograph: RGB, 8 or 16 bits, shape (height, width, 3).
        tuned: how small.
    """
    scale = min(1.0, tuned.align_side / max(photograph.shape[:2]))
    small = cv2.resize(photograph, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return small[:, :, 1].astype(np.float32) / np.iinfo(photograph.dtype).max


def align(
    images: Sequence[NDArray[np.float32]], amounts: Sequence[float], tuned: CaptureParameters = DEFAULT
) -> list[NDArray[np.float64]]:
    """Shift and rotation of each photograph against the middle exposure, found from one exposure to the next.

    Median threshold bitmaps (Ward 2003) find the shift coarsely; the enhanced correlation coefficient (Evangelidis and
    Psarakis 2008) of the readings that both photographs show then refines shift and rotation.

    Args:
        images: :func:`comparison_image` of each photograph.
        amounts: exposures, in any order.
        tuned: how exactly, and what is believed.

    Returns:
        For each photograph a matrix of shape (2, 3) that takes pixels of the middle exposure's comparison image to
        pixels of this one's.
    """
    order = np.argsort(amounts)
    middle = len(order) // 2
    found = {int(order[middle]): np.eye(3)}
    for chain in (order[middle::-1], order[middle:]):
        for known, unknown in pairwise(chain):
            found[int(unknown)] = _between(images[known], images[unknown], tuned) @ found[int(known)]
    return [found[index][:2] for index in range(len(images))]


def move(photograph: NDArray, matrix: NDArray[np.float64], scale: float) -> NDArray:
    """A photograph as it would be without its movement.

    Args:
        photograph: shape (height, width, 3).
        matrix: from :func:`align`.
        scale: size of the comparison image over that of the photograph.

    Returns:
        The same shape and dtype; black where the photograph did not reach.
    """
    full = matrix.copy()
    # Pixel centres: x_small + 0.5 = scale (x + 0.5).
    full[:, 2] = (matrix[:, :2] @ np.full(2, 0.5 * scale - 0.5) + matrix[:, 2] - (0.5 * scale - 0.5)) / scale
    height, width = photograph.shape[:2]
    return cv2.warpAffine(photograph, full, (width, height), flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP)


def _between(first: NDArray[np.float32], second: NDArray[np.float32], tuned: CaptureParameters) -> NDArray[np.float64]:
    """Matrix (3, 3) from pixels of ``first`` to pixels of ``second``; the identity where nothing can be compared."""
    visible = (trust(first, tuned) > tuned.align_trust) & (second > tuned.align_reading)
    if visible.mean() < tuned.align_least_share:
        return np.eye(3)
    dx, dy = cv2.createAlignMTB(6).calculateShift(_bytes(second), _bytes(first))
    mask = cv2.dilate(visible.astype(np.uint8), np.ones((9, 9), np.uint8))
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, tuned.align_iterations, tuned.align_change)
    best, best_correlation = np.eye(3), tuned.align_least_correlation
    for start in (np.eye(2, 3), np.array([[1.0, 0.0, -dx], [0.0, 1.0, -dy]])):
        try:
            correlation, matrix = cv2.findTransformECC(
                first, second, start.astype(np.float32), cv2.MOTION_EUCLIDEAN, stop, mask, 5
            )
        except cv2.error:  # It did not converge from here.
            continue
        if correlation > best_correlation:
            best, best_correlation = np.vstack([matrix.astype(np.float64), [0.0, 0.0, 1.0]]), correlation
    return best


def _bytes(image: NDArray[np.float32]) -> NDArray[np.uint8]:
    return (255.0 * image).astype(np.uint8)
