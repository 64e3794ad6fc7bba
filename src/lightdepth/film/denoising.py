"""Removing what is left of the noise: Open Image Denoise on the new layers, never on the photograph."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import ModuleType

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from lightdepth.cameras.topology import Rectangle, Window
from lightdepth.film.frame import Frame
from lightdepth.images.tonemapping import MIDDLE_GREY
from lightdepth.packages import optional_package

MARGIN = 128
"""Pixels that the filter is shown around a band, so that bands meet without a seam."""
PIXELS_AT_ONCE = 2**21
DARK = 0.02
"""Share of the photograph's median that is added where the change is divided by the photograph."""


def denoise(frame: Frame) -> Frame:
    """Denoise a frame's change and synthetic radiance; its photograph and every other layer stay as they are.

    The change is denoised as a share of the photograph, in which the photograph's texture cancels: on a diffuse surface
    it is the relative change of irradiance. The filter knows images of light, which is not negative, but the change
    has both signs: what was added and what was taken away are denoised apart. A pixel without any change or new surface
    keeps exactly nothing. At the objects' rims both layers hold only a share of the pixel, and end beyond: they are
    denoised as if they filled it and went on, or the filter would see an edge in every rim and overshoot there.

    Args:
        frame: as rendered; albedo and normals, which have no noise, guide the filter where the frame has them.

    Returns:
        A new frame, which shares the other layers; its metadata says that it was denoised.

    Raises:
        SetupError: the package ``mitsuba-oidn`` is not installed.
    """
    oidn = optional_package("mitsuba_oidn", "denoise")
    change, synthetic = np.zeros_like(frame.change), np.zeros_like(frame.synthetic)
    floor = np.float32(DARK * np.median(frame.plate[::4, ::4]) + 1e-12)
    change_scale = _input_scale(frame.change, frame.plate, floor)
    synthetic_scale = _input_scale(frame.synthetic, None, floor)
    for chart in frame.topology.charts:
        rows = max(MARGIN, PIXELS_AT_ONCE // chart.width)
        for top in range(
            chart.top, chart.bottom, rows
        ):  # Band by band, which bounds the memory and skips what is untouched.
            band = Rectangle(top, min(top + rows, chart.bottom), chart.left, chart.right)
            window = frame.topology.window(chart, band, MARGIN)
            _denoise_window(oidn, frame, window, floor, (change_scale, synthetic_scale), change, synthetic)
    facts = {**frame.metadata, "denoised": "change, synthetic"}
    return replace(frame, change=change, synthetic=synthetic, metadata=facts)


def _denoise_window(
    oidn: ModuleType,
    frame: Frame,
    window: Window,
    floor: np.float32,
    scales: tuple[float, float],
    change: NDArray[np.float32],
    synthetic: NDArray[np.float32],
) -> None:
    """Denoise the change and the synthetic radiance of a window's rectangle.

    Args:
        oidn: the denoiser.
        frame: as rendered.
        window: its rectangle is denoised, with what is around it.
        floor: radiance that is added to the photograph.
        scales: input scales of the change and the synthetic radiance.
        change: where the result goes, shape (height, width, 3).
        synthetic: likewise.
    """
    here, inner = window.rectangle.slices, window.inner
    change_scale, synthetic_scale = scales
    guides = {"albedo": frame.albedo, "normal": frame.normal}
    cut = {name: window.cut(guide).astype(np.float32, order="C") for name, guide in guides.items() if guide is not None}
    filtered = _Filter(oidn, cut)
    if frame.synthetic[here].any():
        covered = window.cut(frame.coverage)[:, :, None]
        noisy = _extended(window.cut(frame.synthetic), covered)
        clean = (filtered(noisy, synthetic_scale) * covered)[inner]
        synthetic[here] = np.where(_touched(frame.synthetic[here]), clean, 0.0)
    if frame.change[here].any():
        if "albedo" in filtered.guides:  # Without the photograph's texture there is none for it to explain.
            filtered.guides["albedo"][window.cut(frame.coverage) == 0.0] = 1.0
        uncovered = np.float32(1.0) - window.cut(frame.coverage)[:, :, None]
        relative = _extended(window.cut(frame.change), uncovered) / (window.cut(frame.plate) + floor)
        added = filtered(np.maximum(relative, 0.0), change_scale)[inner]
        taken = filtered(np.maximum(-relative, 0.0), change_scale)[inner]
        clean = (added - taken) * (frame.plate[here] + floor)
        # At narrow contact shadows the filter overshoots; no more can be taken away than was there.
        clean = np.maximum(clean, np.minimum(-frame.plate[here], 0.0)) * uncovered[inner]
        change[here] = np.where(_touched(frame.change[here]), clean, 0.0)


def _extended(layer: NDArray[np.float32], share: NDArray[np.float32]) -> NDArray[np.float32]:
    """A layer as if it filled every pixel: divided by its share, and gone on where that is small.

    Args:
        layer: shape (height, width, 3).
        share: of each pixel that the layer fills, shape (height, width, 1).
    """
    around = cv2.dilate(share[:, :, 0], np.ones((5, 5), np.uint8))
    reliable = (share[:, :, 0] > 0.0) & (share[:, :, 0] >= 0.5 * around)
    row, column = distance_transform_edt(~reliable, return_distances=False, return_indices=True)
    # Beyond the rim goes the mean around the rim's pixels: a single one's noise would be drawn out into a streak.
    mean = cv2.blur(layer, (9, 9)) / np.maximum(cv2.blur(share[:, :, 0], (9, 9)), np.float32(1e-6))[:, :, None]
    own = layer / np.maximum(share, np.float32(1e-6))
    return np.where(reliable[:, :, None], own, mean[row, column])


def _touched(layer: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Pixels with anything in them, shape (height, width, 1)."""
    return (layer != 0.0).any(axis=2)[:, :, None]


def _input_scale(layer: NDArray[np.float32], plate: NDArray[np.float32] | None, floor: np.float32) -> float:
    """Factor that brings a layer to the brightness of an ordinary exposure, as the filter wants it.

    One for the whole layer: left to itself, the filter would choose another for each band, each sign and each edge.
    """
    step = max(1, int(np.sqrt(layer.shape[0] * layer.shape[1] / 2**20)))  # A million pixels are enough.
    sizes = np.abs(layer[::step, ::step])
    if plate is not None:
        sizes = sizes / (plate[::step, ::step] + floor)
    sizes = sizes.max(axis=2)
    sizes = sizes[sizes > 0.0]
    return float(MIDDLE_GREY / np.median(sizes)) if sizes.size else 1.0


@dataclass(frozen=True)
class _Filter:
    """Open Image Denoise with its guides: arrays of shape (height, width, 3) by name."""

    oidn: ModuleType
    guides: dict[str, NDArray[np.float32]]

    def __call__(self, noisy: NDArray[np.float32], scale: float) -> NDArray[np.float32]:
        if not noisy.any():
            return noisy
        oidn = self.oidn
        result = oidn.denoise(noisy, **self.guides, hdr=True, clean_aux=bool(self.guides), input_scale=scale)
        return np.asarray(result)
