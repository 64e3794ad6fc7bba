"""Fireflies and glints: what a denoiser cannot judge is taken out of its input, and no light is lost.

A single path that finds a small bright light by chance makes a pixel far too bright: a firefly. Its own variance gives it
away: an excess that ``k`` of the samples carry has a relative standard error of ``1 / sqrt(k)``. The light is right on
average, only its place is not known that well, so it is spread over the pixels around (the idea of Zirr et al. 2018, who
reweight such samples, with the light kept). An excess of the same size that many samples carry is a glint, such as the
sun in a metal ball: a denoiser blurs it and loses most of its light, and it needs no denoising.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from lightdepth.parameters.denoising import DEFAULT, DenoisingParameters


@dataclass(frozen=True)
class Settled:
    """A layer in two parts.

    Attributes:
        plain: to be denoised, shape (height, width, 3), float32.
        glints: what many samples agree on and a denoiser would lose, the same shape; to be added afterwards.
    """

    plain: NDArray[np.float32]
    glints: NDArray[np.float32]


def settle(
    layer: NDArray[np.float32],
    error: NDArray[np.float32],
    share: NDArray[np.float32],
    scale: float,
    tuned: DenoisingParameters = DEFAULT,
) -> Settled:
    """Spread the fireflies of a layer and set its glints aside; the sum weighted by ``share`` stays the same.

    Args:
        layer: not negative, shape (height, width, 3), float32.
        error: standard error of the mean of its channels, shape (height, width), float32; where it is not known, infinite,
            the layer stays as it is.
        share: of each pixel that the layer fills, shape (height, width); light is spread only where it is above 0.
        scale: factor that brings the layer to the brightness of an ordinary exposure.
        tuned: the denoiser's parameters.
    """
    if not np.isfinite(error).all():
        return Settled(layer, np.zeros_like(layer))
    here = share > 0.0
    grey = layer.mean(axis=2)
    around = cv2.medianBlur(grey, 5)
    limit = tuned.outlier_contrast * around + tuned.outlier_errors * cv2.medianBlur(
        np.ascontiguousarray(error, np.float32), 5
    )
    lone = here & (grey > limit) & (error * np.sqrt(np.float32(tuned.few)) > grey - around)
    # The rim of a lamp in a metal ball is found by few samples as well, but beside others that many agree on.
    solid = cv2.dilate(np.where(here & ~lone, grey, np.float32(0.0)), np.ones((5, 5), np.uint8))
    lone &= solid < tuned.beside * grey + tuned.outlier_contrast * around
    crowded = cv2.boxFilter(lone.astype(np.float32), -1, (3, 3), normalize=False) > tuned.crowd + 0.5
    lone &= ~cv2.dilate(crowded.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)
    too_bright = here & ~lone & (grey * scale > tuned.glint)
    kept = np.where(lone, np.minimum(around, grey), np.where(too_bright, np.float32(tuned.glint / scale), grey))
    factor = (kept / np.maximum(grey, np.float32(1e-30)))[:, :, None]
    plain = np.where((lone | too_bright)[:, :, None], layer * factor, layer)
    rest = layer - plain
    if lone.any():
        plain = plain + _spread(np.where(lone[:, :, None], rest, np.float32(0.0)), around, share, tuned)
    return Settled(plain, np.where(too_bright[:, :, None], rest, np.float32(0.0)))


def _spread(
    loose: NDArray[np.float32], around: NDArray[np.float32], share: NDArray[np.float32], tuned: DenoisingParameters
) -> NDArray[np.float32]:
    """The light of fireflies, spread over the pixels around each that hold the layer."""
    size, spread, here = loose.mean(axis=2) * share, np.zeros_like(loose), share > 0.0
    allowed = tuned.visible * np.maximum(around, np.float32(tuned.visible_dark) * float(around[here].mean()))
    left = size > 0.0
    deviations = [tuned.spread * 2.0**step for step in range(tuned.spreads)]
    for deviation in deviations:
        most = np.float32(2.0 * np.pi * deviation**2) * allowed
        last = deviation == deviations[-1]
        these = left if last else left & (size <= most)
        left = left & ~these
        if not these.any():
            continue
        weight = cv2.GaussianBlur(share, (0, 0), deviation, borderType=cv2.BORDER_CONSTANT)
        amount = these * share * np.minimum(most / np.maximum(size, np.float32(1e-30)), 1.0)
        amount = amount / np.maximum(weight, tuned.spread_filled)
        part = cv2.GaussianBlur(
            loose * amount[:, :, None].astype(np.float32), (0, 0), deviation, borderType=cv2.BORDER_CONSTANT
        )
        spread += part * here[:, :, None]
    return spread
