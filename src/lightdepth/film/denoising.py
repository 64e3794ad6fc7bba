"""Removing what is left of the noise: Open Image Denoise on the new layers, never on the photograph."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import ModuleType

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from lightdepth.film.frame import Frame
from lightdepth.images.tonemapping import MIDDLE_GREY
from lightdepth.packages import optional_package

MARGIN = 128
"""Pixels that the filter is shown around a band, so that bands meet without a seam."""
PIXELS_AT_ONCE = 2**21
DARK = 0.02
"""Share of the photograph's median that is added where the change is divided by the photograph."""


def denoise(frame: Frame, panoramic: bool) -> Frame:
    """Denoise a frame's change and synthetic radiance; its photograph and every other layer stay as they are.

    The change is denoised as a share of the photograph, in which the photograph's texture cancels: on a diffuse surface
    it is the relative change of irradiance. The filter knows images of light, which is not negative, but the change
    has both signs: what was added and what was taken away are denoised apart. A pixel without any change or new surface
    keeps exactly nothing. At the objects' rims both layers hold only a share of the pixel, and end beyond: they are
    denoised as if they filled it and went on, or the filter would see an edge in every rim and overshoot there.

    Args:
        frame: as rendered; albedo and normals, which have no noise, guide the filter where the frame has them.
        panoramic: the image is a full panorama: it goes on around its left and right edge, and over the poles on the
            other side.

    Returns:
        A new frame, which shares the other layers; its metadata says that it was denoised.

    Raises:
        SetupError: the package ``mitsuba-oidn`` is not installed.
    """
    oidn = optional_package("mitsuba_oidn", "denoise")
    height, width = frame.coverage.shape
    change, synthetic = np.zeros_like(frame.change), np.zeros_like(frame.synthetic)
    floor = np.float32(DARK * np.median(frame.plate[::4, ::4]) + 1e-12)
    change_scale = _input_scale(frame.change, frame.plate, floor)
    synthetic_scale = _input_scale(frame.synthetic, None, floor)
    rows = max(MARGIN, PIXELS_AT_ONCE // width)
    for top in range(0, height, rows):  # Band by band, which bounds the memory and skips what is untouched.
        band = slice(top, min(top + rows, height))
        window = _Window(band.start, band.stop, height, width, panoramic)
        guides = {"albedo": frame.albedo, "normal": frame.normal}
        cut = {
            name: window.cut(guide).astype(np.float32, order="C") for name, guide in guides.items() if guide is not None
        }
        filtered = _Filter(oidn, cut)
        if frame.synthetic[band].any():
            covered = window.cut(frame.coverage)[:, :, None]
            noisy = _extended(window.cut(frame.synthetic), covered)
            clean = window.inner(filtered(noisy, synthetic_scale) * covered)
            synthetic[band] = np.where(_touched(frame.synthetic[band]), clean, 0.0)
        if frame.change[band].any():
            if "albedo" in filtered.guides:  # Without the photograph's texture there is none for it to explain.
                filtered.guides["albedo"][window.cut(frame.coverage) == 0.0] = 1.0
            uncovered = np.float32(1.0) - window.cut(frame.coverage)[:, :, None]
            relative = _extended(window.cut(frame.change), uncovered) / (window.cut(frame.plate) + floor)
            added = window.inner(filtered(np.maximum(relative, 0.0), change_scale))
            taken = window.inner(filtered(np.maximum(-relative, 0.0), change_scale))
            clean = (added - taken) * (frame.plate[band] + floor)
            # At narrow contact shadows the filter overshoots; no more can be taken away than was there.
            clean = np.maximum(clean, np.minimum(-frame.plate[band], 0.0)) * window.inner(uncovered)
            change[band] = np.where(_touched(frame.change[band]), clean, 0.0)
    facts = {**frame.metadata, "denoised": "change, synthetic"}
    return replace(frame, change=change, synthetic=synthetic, metadata=facts)


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


@dataclass(frozen=True)
class _Window:
    """A band of an image's rows, with what lies around it."""

    top: int
    bottom: int
    height: int
    width: int
    panoramic: bool

    def cut(self, image: NDArray) -> NDArray:
        """The band with its margin; of a panorama it goes on around the edge and over the poles."""
        if not self.panoramic:
            return np.ascontiguousarray(image[self._first : self.bottom + MARGIN])
        rows = np.arange(self.top - MARGIN, self.bottom + MARGIN)
        columns = np.arange(-MARGIN, self.width + MARGIN)
        over_pole = (rows < 0) | (rows >= self.height)
        rows = np.where(rows < 0, -1 - rows, np.where(rows >= self.height, 2 * self.height - 1 - rows, rows))
        across = np.where(over_pole, self.width // 2, 0)
        return image[rows[:, None] % self.height, (columns + across[:, None]) % self.width]

    def inner(self, cut: NDArray[np.float32]) -> NDArray[np.float32]:
        """The band alone, of what :meth:`cut` gave."""
        if not self.panoramic:
            return cut[self.top - self._first :][: self.bottom - self.top]
        return cut[MARGIN:-MARGIN, MARGIN:-MARGIN]

    @property
    def _first(self) -> int:
        """First row of an ordinary image's band with its margin."""
        return max(self.top - MARGIN, 0)
