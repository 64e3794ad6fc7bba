"""Removing what is left of the noise: Open Image Denoise on the new layers, never on the photograph."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from types import ModuleType

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt, find_objects, label

from lightdepth.cameras.topology import Rectangle, Topology, Window
from lightdepth.film.frame import Frame
from lightdepth.film.outliers import settle
from lightdepth.images.tonemapping import MIDDLE_GREY
from lightdepth.packages import optional_package

MARGIN = 64
"""Pixels that the filter is shown around a box; what is farther away changes a pixel by less than half a percent."""
PIXELS_AT_ONCE = 2**21
"""Largest area of a box: bounds the memory."""
TILE = 16
"""Side of the tiles that boxes are made of, pixels."""
MINOR = 0.25
"""Largest share of a change that is so small a part of it that the fast network denoises it as well."""
MOST_ERRORS = 3.0
"""Standard errors by which the filter may change a pixel: it blurs edges that the samples show sharply."""
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
        for window in _windows(frame.topology, chart, frame.synthetic):
            here = window.rectangle.slices
            synthetic[here] = _denoised_synthetic(_Filter.around(window, frame, oidn), frame, window, synthetic_scale)
        for window in _windows(frame.topology, chart, frame.change):
            here = window.rectangle.slices
            change[here] = _denoised_change(_Filter.around(window, frame, oidn), frame, window, change_scale, floor)
    facts = {**frame.metadata, "denoised": "change, synthetic"}
    return replace(frame, change=change, synthetic=synthetic, metadata=facts)


def _windows(topology: Topology, chart: Rectangle, layer: NDArray[np.float32]) -> Iterator[Window]:
    """Windows that together show all of a chart where a layer is not zero, and little else."""
    for box in _boxes((layer[chart.slices] != 0.0).any(axis=2)):
        box = Rectangle(chart.top + box.top, chart.top + box.bottom, chart.left + box.left, chart.left + box.right)
        rows = max(MARGIN, PIXELS_AT_ONCE // box.width)
        for top in range(box.top, box.bottom, rows):
            part = Rectangle(top, min(top + rows, box.bottom), box.left, box.right)
            yield topology.window(chart, part, MARGIN)


def _boxes(there: NDArray[np.bool_]) -> list[Rectangle]:
    """Rectangles that hold all pixels that are ``there``, far enough apart to be filtered one by one.

    Those of pieces that hang together; two become one where that leaves less to filter, their margins included.
    """
    height, width = there.shape
    tiles = np.pad(there, ((0, -height % TILE), (0, -width % TILE)))
    pieces, _ = label(tiles.reshape(len(tiles) // TILE, TILE, -1, TILE).any(axis=(1, 3)), np.ones((3, 3), bool))
    boxes = [
        Rectangle(
            rows.start * TILE, min(rows.stop * TILE, height), columns.start * TILE, min(columns.stop * TILE, width)
        )
        for rows, columns in find_objects(pieces)
    ]
    merged = True
    while merged:
        merged = False
        for i, box in enumerate(boxes):
            for j, other in enumerate(boxes[:i]):
                both = _around(box, other)
                if _cost(both) <= _cost(box) + _cost(other):
                    boxes[j] = both
                    del boxes[i]
                    merged = True
                    break
            if merged:
                break
    return boxes


def _around(one: Rectangle, other: Rectangle) -> Rectangle:
    """The smallest rectangle that holds two."""
    return Rectangle(
        min(one.top, other.top),
        max(one.bottom, other.bottom),
        min(one.left, other.left),
        max(one.right, other.right),
    )


def _cost(box: Rectangle) -> int:
    """Pixels that are filtered for a box."""
    return (box.height + 2 * MARGIN) * (box.width + 2 * MARGIN)


def _denoised_synthetic(filtered: _Filter, frame: Frame, window: Window, scale: float) -> NDArray[np.float32]:
    """The synthetic radiance in a window's rectangle, denoised."""
    covered = window.cut(frame.coverage)[:, :, None]
    rim = _Rim.of(covered)
    filtered.extend(rim)
    error = _error(frame, window) / np.maximum(covered, np.float32(1e-6))
    settled = settle(rim.extended(window.cut(frame.synthetic)), error.mean(axis=2), covered[:, :, 0], scale)
    clean = _consistent(filtered(settled.plain, scale), settled.plain, error) + settled.glints
    clean = (clean * covered)[window.inner]
    return np.where(_touched(frame.synthetic[window.rectangle.slices]), clean, np.float32(0.0))


def _denoised_change(
    filtered: _Filter, frame: Frame, window: Window, scale: float, floor: np.float32
) -> NDArray[np.float32]:
    """The change in a window's rectangle, denoised; ``floor`` is radiance that is added to the photograph."""
    coverage, plate = window.cut(frame.coverage), frame.plate[window.rectangle.slices]
    uncovered = np.float32(1.0) - coverage[:, :, None]
    rim = _Rim.of(uncovered)
    filtered.extend(rim)
    if "albedo" in filtered.guides:  # Without the photograph's texture there is none for it to explain.
        filtered.guides["albedo"][:] = 1.0
    relative = rim.extended(window.cut(frame.change)) / (window.cut(frame.plate) + floor)
    error = _error(frame, window) / (np.maximum(uncovered, np.float32(1e-6)) * (window.cut(frame.plate) + floor))
    most = np.abs(relative).sum(dtype=np.float64)
    # Fireflies stand out of what is left of the photograph's light: in a shadow of little, be the change negative there.
    left = np.maximum(relative + np.float32(1.0), np.float32(0.0))
    settled = settle(left, error.mean(axis=2), uncovered[:, :, 0], min(scale, 1.0))
    relative = relative + (settled.plain - left)
    added, taken = (
        filtered(part, scale, part.sum(dtype=np.float64) < MINOR * most)
        for part in (np.maximum(relative, np.float32(0.0)), np.maximum(-relative, np.float32(0.0)))
    )
    clean = _consistent(added - taken, relative, error) + settled.glints
    clean = clean[window.inner] * (plate + floor)
    # At narrow contact shadows the filter overshoots; no more can be taken away than was there.
    clean = np.maximum(clean, np.minimum(-plate, 0.0)) * uncovered[window.inner]
    return np.where(_touched(frame.change[window.rectangle.slices]), clean, np.float32(0.0))


def _error(frame: Frame, window: Window) -> NDArray[np.float32]:
    """Standard error of the finished pixels in a window, shape (height, width, 3); infinite where it is not known."""
    if frame.variance is None:
        return np.full((*window.cut(frame.coverage).shape, 3), np.inf, np.float32)
    # That of a single pixel from few samples is unreliable, and may be nothing at all.
    variance = np.maximum(window.cut(frame.variance), np.float32(0.0))
    return np.sqrt(np.maximum(variance, cv2.blur(variance, (3, 3))))


def _consistent(
    clean: NDArray[np.float32], noisy: NDArray[np.floating], error: NDArray[np.floating]
) -> NDArray[np.float32]:
    """What the filter gave, held to what the samples allow: the more there are, the less may be changed."""
    return noisy + np.clip(clean - noisy, -MOST_ERRORS * error, MOST_ERRORS * error)


@dataclass(frozen=True)
class _Rim:
    """How a layer that fills only a share of the pixels goes on where that is small.

    Attributes:
        share: of each pixel that the layer fills, shape (height, width, 1).
        reliable: where the layer itself is known well, shape (height, width).
        nearest: row and column of the nearest such pixel, each shape (height, width).
    """

    share: NDArray[np.float32]
    reliable: NDArray[np.bool_]
    nearest: NDArray[np.int32]

    @classmethod
    def of(cls, share: NDArray[np.float32]) -> _Rim:
        """The rim of a layer with this share."""
        around = cv2.dilate(share[:, :, 0], np.ones((5, 5), np.uint8))
        reliable = (share[:, :, 0] > 0.0) & (share[:, :, 0] >= 0.5 * around)
        return cls(share, reliable, distance_transform_edt(~reliable, return_distances=False, return_indices=True))

    def extended(self, layer: NDArray[np.float32]) -> NDArray[np.float32]:
        """A layer, shape (height, width, 3), as if it filled every pixel: divided by its share, and gone on."""
        # Beyond the rim goes the mean around the rim's pixels: a single one's noise would be drawn out into a streak.
        mean = cv2.blur(layer, (9, 9)) / np.maximum(cv2.blur(self.share[:, :, 0], (9, 9)), np.float32(1e-6))[:, :, None]
        own = layer / np.maximum(self.share, np.float32(1e-6))
        row, column = self.nearest
        return np.where(self.reliable[:, :, None], own, mean[row, column])

    def guide(self, guide: NDArray[np.float32]) -> NDArray[np.float32]:
        """A guide, shape (height, width, 3), gone on from pixels that show this layer alone."""
        alone = self.share[:, :, 0] >= min(0.99, float(self.share.max()))
        row, column = distance_transform_edt(~alone, return_distances=False, return_indices=True)
        return np.ascontiguousarray(guide[row, column])


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

    @classmethod
    def around(cls, window: Window, frame: Frame, oidn: ModuleType) -> _Filter:
        """The filter for a window of a frame."""
        guides = {"albedo": frame.albedo, "normal": frame.normal}
        cut = {name: window.cut(guide) for name, guide in guides.items() if guide is not None}
        return cls(oidn, {name: guide.astype(np.float32, order="C") for name, guide in cut.items()})

    def extend(self, rim: _Rim) -> None:
        """Let the guides go on beyond a layer's rim as the layer does: an edge in them would be one in the result."""
        for name, guide in self.guides.items():
            self.guides[name] = rim.guide(guide)

    def __call__(self, noisy: NDArray[np.float32], scale: float, fast: bool = False) -> NDArray[np.float32]:
        if not noisy.any():
            return noisy
        oidn = self.oidn
        settings = {"clean_aux": bool(self.guides), "quality": oidn.Quality.Fast if fast else oidn.Quality.High}
        result = oidn.denoise(noisy, **self.guides, hdr=True, input_scale=scale, **settings)
        return np.asarray(result)
