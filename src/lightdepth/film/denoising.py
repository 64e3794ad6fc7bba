"""Removing the remaining noise: Open Image Denoise on the new layers, never on the photograph."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import distance_transform_edt

from lightdepth.cameras.topology import Rectangle, Topology, Window
from lightdepth.film.frame import Frame
from lightdepth.film.outliers import settle
from lightdepth.images.tonemapping import MIDDLE_GREY
from lightdepth.packages import optional_package
from lightdepth.parameters.denoising import DEFAULT, DenoisingParameters


def denoise(frame: Frame, tuned: DenoisingParameters = DEFAULT) -> Frame:
    """Denoise a frame's change and synthetic radiance; its photograph and every other layer stay as they are.

    The change is denoised as a share of the photograph, in which the photograph's texture cancels: on a diffuse surface
    it is the relative change of irradiance. The network knows images of light, which is not negative, but the change
    has both signs: what was added and what was taken away are denoised separately. Where the change is faint, or
    smoother than its noise, a blur is as good and costs next to nothing. A pixel without any change or new surface stays
    0. At the objects' edges both layers fill only a share of the pixel and end: they are denoised as if they filled it
    and continued, since the network would otherwise see an edge there and overshoot.

    Args:
        frame: as rendered; albedo and normals, which have no noise, guide the filter where the frame has them.
        tuned: the denoiser's parameters.

    Returns:
        A new frame, which shares the other layers; its metadata says that it was denoised.

    Raises:
        SetupError: the package ``mitsuba-oidn`` is not installed.
    """
    oidn = optional_package("mitsuba_oidn", "denoise")
    change, synthetic = np.zeros_like(frame.change), np.zeros_like(frame.synthetic)
    floor = np.float32(tuned.dark * np.median(frame.plate[::4, ::4]) + 1e-12)
    scale = _input_scale(_some(frame.synthetic))
    change_scale = _input_scale(_some(frame.change) / (_some(frame.plate) + floor))
    for chart in frame.topology.charts:
        there = _tiles(_touched(frame.synthetic[chart.slices])[:, :, 0], np.any, tuned.tile)
        for window in _windows(frame.topology, chart, there, tuned):
            here = window.rectangle.slices
            synthetic[here] = _denoised_synthetic(_Network.around(window, frame, oidn), frame, window, scale, tuned)
        there, strong = _changed_tiles(frame, chart, floor, tuned)
        for window in _windows(frame.topology, chart, there & ~strong, tuned):
            change[window.rectangle.slices] = _blurred_change(frame, window, floor, tuned)
        for window in _windows(frame.topology, chart, strong, tuned, tuned.ramp):
            clean = _denoised_change(_Network.around(window, frame, oidn), frame, window, change_scale, floor, tuned)
            share = _ramp(strong, window.rectangle.moved(-chart.top, -chart.left), tuned)[:, :, None]
            change[window.rectangle.slices] += share * (clean - change[window.rectangle.slices])
    facts = {**frame.metadata, "denoised": "change, synthetic"}
    return replace(frame, change=change, synthetic=synthetic, metadata=facts)


def _tiles(pixels: NDArray[Any], reduce: Callable[..., NDArray[Any]], tile: int) -> NDArray[Any]:
    """Each tile's pixels reduced to one value; beyond the edges of an image, shape (height, width), lie zeros."""
    height, width = pixels.shape
    padded = np.pad(pixels, ((0, -height % tile), (0, -width % tile)))
    return reduce(padded.reshape(len(padded) // tile, tile, -1, tile), axis=(1, 3))


def _changed_tiles(
    frame: Frame, chart: Rectangle, floor: np.float32, tuned: DenoisingParameters
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Tiles of a chart that hold any change, and those of them where a blur would not do: neither faint nor smooth."""
    means, squares, theres = [], [], []
    tile = tuned.tile
    rows = max(1, tuned.largest_box // (2 * tile * chart.width)) * tile
    for top in range(chart.top, chart.bottom, rows):  # In bands, so that a large image needs little memory.
        bottom, columns = min(top + rows, chart.bottom), chart.slices[1]
        here = slice(top, bottom), columns
        above, below = max(top - tuned.hole, chart.top), min(bottom + tuned.hole, chart.bottom)
        changeable = _changeable(frame.change[above:below, columns], tuned)[top - above :][: bottom - top]
        # Of the pixels that can change only, or every edge of what changes would be a step.
        share = np.maximum(_tiles(changeable * (np.float32(1.0) - frame.coverage[here]), np.sum, tile), np.float32(1.0))
        relative = frame.change[here] / (frame.plate[here] + floor)
        sums = [_tiles(channel, np.sum, tile) / share for channel in np.moveaxis(relative, 2, 0)]
        means.append(np.stack(sums, axis=2))
        squares.append(_tiles(_largest(np.square(relative)), np.sum, tile) / share)
        theres.append(_tiles(_touched(relative)[:, :, 0], np.any, tile))
    mean, square, there = (np.concatenate(parts) for parts in (means, squares, theres))
    largest = _largest(np.abs(mean))
    step, bend = _variation(mean, there)
    noise = np.sqrt(np.maximum(square - largest**2, 0.0))
    faint = (largest <= tuned.faint) & (square <= tuned.faint_noise**2) & (step <= tuned.faint_step)
    objects = _tiles(frame.coverage[chart.slices] > 0.0, np.any, tile)
    smooth = (bend <= np.minimum(tuned.smooth_bend, noise)) & (noise <= tuned.smooth_noise) & ~objects
    return there, there & ~faint & ~(smooth & (step <= tuned.smooth_step))


def _variation(mean: NDArray[np.float32], there: NDArray[np.bool_]) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """How a layer's means of tiles vary around each tile.

    Args:
        mean: of the tiles, shape (rows, columns, 3).
        there: tiles that hold something; the others do not count.

    Returns:
        The largest difference among a tile and its neighbours, and the largest deviation of its neighbours on opposite
        sides from a straight line (of a single neighbour where the other side holds nothing, from the tile itself).
    """
    square = np.ones((3, 3), np.uint8)
    most, least = (np.where(there[:, :, None], mean, far).astype(np.float32) for far in (-1e3, 1e3))
    step = _largest(cv2.dilate(most, square) - cv2.erode(least, square))
    rows, columns = there.shape
    # A neighbour that holds nothing is worth what the tile is, and so adds no difference.
    around, known = np.pad(mean, ((1, 1), (1, 1), (0, 0))), np.pad(there, 1)
    bend = np.zeros(there.shape, np.float32)
    for down, right in ((0, 1), (1, 0), (1, 1), (1, -1)):
        differences = [
            (around[1 + y : 1 + y + rows, 1 + x : 1 + x + columns] - mean)
            * known[1 + y : 1 + y + rows, 1 + x : 1 + x + columns, None]
            for y, x in ((down, right), (-down, -right))
        ]
        bend = np.maximum(bend, _largest(np.abs(differences[0] + differences[1])))
    return step, bend


def _ramp(strong: NDArray[np.bool_], rectangle: Rectangle, tuned: DenoisingParameters) -> NDArray[np.float32]:
    """How much the network counts at the pixels of a rectangle: all in strong tiles, nothing farther than ``tuned.ramp``.

    Args:
        strong: which tiles of a chart are.
        rectangle: of the chart, counted from its corner.
        tuned: the denoiser's parameters.
    """
    side = tuned.tile
    top, left = rectangle.top // side, rectangle.left // side
    bottom, right = -(-rectangle.bottom // side), -(-rectangle.right // side)
    tiles = np.pad(strong.astype(np.float32), 1, mode="edge")[top : bottom + 2, left : right + 2]
    pixels = np.repeat(np.repeat(tiles, side, axis=0), side, axis=1)
    share = cv2.blur(
        cv2.dilate(pixels, np.ones((tuned.ramp + 1, tuned.ramp + 1), np.uint8)), (tuned.ramp + 1, tuned.ramp + 1)
    )
    first, begin = rectangle.top - (top - 1) * side, rectangle.left - (left - 1) * side
    return np.asarray(share[first : first + rectangle.height, begin : begin + rectangle.width])


def _windows(
    topology: Topology, chart: Rectangle, tiles: NDArray[np.bool_], tuned: DenoisingParameters, around: int = 0
) -> Iterator[Window]:
    """Windows that together show some tiles of a chart and ``around`` pixels more, and little else."""
    side = tuned.tile
    for box in _boxes(tiles, topology.endless, tuned):
        top, bottom = max(box.top * side - around, 0), min(box.bottom * side + around, chart.height)
        left, right = max(box.left * side - around, 0), min(box.right * side + around, chart.width)
        above, below, before, after = _margins(box, tiles, topology.endless, tuned)
        rows = max(tuned.wide_margin, tuned.largest_box // (right - left))
        for first in range(top, bottom, rows):
            end = min(first + rows, bottom)
            part = Rectangle(first, end, left, right).moved(chart.top, chart.left)
            over, under = above if first == top else tuned.wide_margin, below if end == bottom else tuned.wide_margin
            yield topology.window(chart, part, (over, under, before, after))


def _margins(
    box: Rectangle, tiles: NDArray[np.bool_], endless: bool, tuned: DenoisingParameters
) -> tuple[int, int, int, int]:
    """Pixels that a box of tiles is shown with above, below, to the left and to the right.

    Args:
        box: counted in tiles.
        tiles: those of a chart that matter.
        endless: whether the picture goes on beyond the chart.
        tuned: the denoiser's parameters.
    """
    above, below = slice(max(box.top - 1, 0), box.top), slice(box.bottom, box.bottom + 1)
    before, after = slice(max(box.left - 1, 0), box.left), slice(box.right, box.right + 1)
    rows, columns = slice(above.start, below.stop), slice(before.start, after.stop)
    height, width = tiles.shape
    on = (
        tiles[above, columns].any() or (endless and box.top == 0),
        tiles[below, columns].any() or (endless and box.bottom == height),
        tiles[rows, before].any() or (endless and box.left == 0),
        tiles[rows, after].any() or (endless and box.right == width),
    )
    above_box, below_box, before_box, after_box = (tuned.wide_margin if each else tuned.margin for each in on)
    return above_box, below_box, before_box, after_box


def _boxes(tiles: NDArray[np.bool_], endless: bool, tuned: DenoisingParameters) -> list[Rectangle]:
    """Rectangles that hold all marked tiles of a chart, cut where that leaves less to filter; counted in tiles."""
    side = tuned.tile

    def cost(boxes: Sequence[Rectangle]) -> float:
        total = 0.0
        for box in boxes:
            above, below, before, after = _margins(box, tiles, endless, tuned)
            total += tuned.box_cost + (box.height * side + above + below) * (box.width * side + before + after)
        return total

    def tight(box: Rectangle) -> list[Rectangle]:
        rows, columns = (np.flatnonzero(tiles[box.slices].any(axis=axis)) for axis in (1, 0))
        if not len(rows):
            return []
        top, left = box.top + int(rows[0]), box.left + int(columns[0])
        return [Rectangle(top, top + int(np.ptp(rows)) + 1, left, left + int(np.ptp(columns)) + 1)]

    def cut(box: Rectangle) -> list[Rectangle]:
        best, least = [box], cost([box])
        halves = [(replace(box, bottom=row), replace(box, top=row)) for row in range(box.top + 1, box.bottom)]
        halves += [(replace(box, right=at), replace(box, left=at)) for at in range(box.left + 1, box.right)]
        for one, other in halves:
            both = tight(one) + tight(other)
            if (now := cost(both)) < least:
                best, least = both, now
        return best if best[0] is box else [each for part in best for each in cut(part)]

    return [each for box in tight(Rectangle(0, tiles.shape[0], 0, tiles.shape[1])) for each in cut(box)]


def _denoised_synthetic(
    network: _Network, frame: Frame, window: Window, scale: float, tuned: DenoisingParameters
) -> NDArray[np.float32]:
    """The synthetic radiance in a window's rectangle, denoised."""
    covered = window.cut(frame.coverage)[:, :, None]
    rim = _Rim.of(covered, tuned)
    network.extend(rim)
    error = _error(frame, window, tuned) / np.maximum(covered, np.float32(1e-6))
    settled = settle(rim.extended(window.cut(frame.synthetic)), error.mean(axis=2), covered[:, :, 0], scale, tuned)
    clean = _consistent(network(settled.plain, scale), settled.plain, error, tuned) + settled.glints
    clean = (clean * covered)[window.inner]
    return np.where(_touched(frame.synthetic[window.rectangle.slices]), clean, np.float32(0.0))


def _denoised_change(
    network: _Network, frame: Frame, window: Window, scale: float, floor: np.float32, tuned: DenoisingParameters
) -> NDArray[np.float32]:
    """The change in a window's rectangle, denoised; ``floor`` is radiance that is added to the photograph."""
    coverage, plate = window.cut(frame.coverage), frame.plate[window.rectangle.slices]
    uncovered = np.float32(1.0) - coverage[:, :, None]
    rim = _Rim.of(uncovered, tuned)
    network.extend(rim)
    if "albedo" in network.guides:  # Without the photograph's texture there is none for it to explain.
        network.guides["albedo"][:] = 1.0
    relative = rim.extended(window.cut(frame.change)) / (window.cut(frame.plate) + floor)
    error = _error(frame, window, tuned) / (np.maximum(uncovered, np.float32(1e-6)) * (window.cut(frame.plate) + floor))
    most = np.abs(relative).sum(dtype=np.float64)
    # Fireflies stand out of what is left of the photograph's light: in a shadow of little, be the change negative there.
    left = np.maximum(relative + np.float32(1.0), np.float32(0.0))
    settled = settle(left, error.mean(axis=2, dtype=np.float32), uncovered[:, :, 0], min(scale, 1.0), tuned)
    relative = relative + (settled.plain - left)
    added, taken = (
        network(part, scale, bool(part.sum(dtype=np.float64) < tuned.minor * most))
        for part in (np.maximum(relative, np.float32(0.0)), np.maximum(-relative, np.float32(0.0)))
    )
    clean = _consistent(added - taken, relative, error, tuned) + settled.glints
    clean = clean[window.inner] * (plate + floor)
    # At narrow contact shadows the network overshoots; no more can be taken away than was there.
    clean = np.maximum(clean, np.minimum(-plate, 0.0)) * uncovered[window.inner]
    return np.where(_touched(frame.change[window.rectangle.slices]), clean, np.float32(0.0))


def _blurred_change(frame: Frame, window: Window, floor: np.float32, tuned: DenoisingParameters) -> NDArray[np.float32]:
    """The change in a window's rectangle, where a blur will do; ``floor`` is radiance added to the photograph."""
    layer = window.cut(frame.change)
    uncovered = np.float32(1.0) - window.cut(frame.coverage)
    weights = uncovered * _changeable(layer, tuned)
    relative = cv2.GaussianBlur(layer / (window.cut(frame.plate) + floor), (0, 0), tuned.faint_blur)
    weight = np.maximum(cv2.GaussianBlur(weights, (0, 0), tuned.faint_blur), np.float32(1e-6))
    inner = window.inner
    clean = relative[inner] * (uncovered / weight)[inner][:, :, None]
    clean *= frame.plate[window.rectangle.slices] + floor
    return np.where(_touched(frame.change[window.rectangle.slices]), clean, np.float32(0.0))


def _changeable(layer: NDArray[np.float32], tuned: DenoisingParameters) -> NDArray[np.uint8]:
    """1 where the change's surfaces are seen and 0 beyond their edges; few samples leave holes in what changes."""
    square = np.ones((tuned.hole, tuned.hole), np.uint8)
    return np.asarray(cv2.morphologyEx(_touched(layer)[:, :, 0].astype(np.uint8), cv2.MORPH_CLOSE, square))


def _error(frame: Frame, window: Window, tuned: DenoisingParameters) -> NDArray[np.float32]:
    """Standard error of the finished pixels in a window, shape (height, width, 3); infinite where it is not known."""
    if frame.variance is None:
        return np.full((*window.cut(frame.coverage).shape, 3), np.inf, np.float32)
    # That of a single pixel from few samples is unreliable, and may be nothing at all.
    variance = np.maximum(window.cut(frame.variance), np.float32(0.0))
    error = np.sqrt(np.maximum(variance, cv2.blur(variance, (3, 3))))
    if frame.samples is not None:  # A draft's single sample does not tell it.
        samples = window.cut(frame.samples)
        error[(samples > 0) & (samples < tuned.fewest_samples)] = np.inf
    return error


def _consistent(
    clean: NDArray[np.float32], noisy: NDArray[np.floating], error: NDArray[np.floating], tuned: DenoisingParameters
) -> NDArray[np.float32]:
    """What the filter gave, held to what the samples allow: the more there are, the less may be changed."""
    return noisy + np.clip(clean - noisy, -tuned.most_errors * error, tuned.most_errors * error)


@dataclass(frozen=True)
class _Rim:
    """How a layer that fills only a share of the pixels goes on where that is small.

    Attributes:
        share: of each pixel that the layer fills, shape (height, width, 1).
        reliable: where the layer itself is known well, shape (height, width).
        nearest: row and column of the nearest such pixel, each shape (height, width).
        tuned: the denoiser's parameters.
    """

    share: NDArray[np.float32]
    reliable: NDArray[np.bool_]
    nearest: NDArray[np.int32]
    tuned: DenoisingParameters

    @classmethod
    def of(cls, share: NDArray[np.float32], tuned: DenoisingParameters) -> _Rim:
        """The rim of a layer with this share."""
        around = cv2.dilate(share[:, :, 0], np.ones((tuned.rim_around, tuned.rim_around), np.uint8))
        reliable = (share[:, :, 0] > 0.0) & (share[:, :, 0] >= tuned.rim_share * around)
        nearest = distance_transform_edt(~reliable, return_distances=False, return_indices=True)
        return cls(share, reliable, nearest, tuned)

    def extended(self, layer: NDArray[np.float32]) -> NDArray[np.float32]:
        """A layer, shape (height, width, 3), as if it filled every pixel: divided by its share, and gone on."""
        # Beyond the rim goes the mean around the rim's pixels: a single one's noise would be drawn out into a streak.
        size = (self.tuned.rim_blur, self.tuned.rim_blur)
        mean = cv2.blur(layer, size) / np.maximum(cv2.blur(self.share[:, :, 0], size), np.float32(1e-6))[:, :, None]
        own = layer / np.maximum(self.share, np.float32(1e-6))
        row, column = self.nearest
        return np.where(self.reliable[:, :, None], own, mean[row, column])

    def guide(self, guide: NDArray[np.float32]) -> NDArray[np.float32]:
        """A guide, shape (height, width, 3), gone on from pixels that show this layer alone."""
        alone = self.share[:, :, 0] >= min(self.tuned.rim_alone, float(self.share.max()))
        row, column = distance_transform_edt(~alone, return_distances=False, return_indices=True)
        return np.ascontiguousarray(guide[row, column])


def _touched(layer: NDArray[np.float32]) -> NDArray[np.bool_]:
    """Pixels with anything in them, shape (height, width, 1)."""
    return ((layer[:, :, 0] != 0.0) | (layer[:, :, 1] != 0.0) | (layer[:, :, 2] != 0.0))[:, :, None]


def _largest(layer: NDArray[np.float32]) -> NDArray[np.float32]:
    """Largest of three channels; many times as fast as NumPy's reduction of so short an axis."""
    return np.maximum(np.maximum(layer[:, :, 0], layer[:, :, 1]), layer[:, :, 2])


def _input_scale(layer: NDArray[np.float32]) -> float:
    """Factor that brings a layer to the brightness of an ordinary exposure, as the network wants it.

    One for the whole layer: left to itself, the network would choose another for each box and each sign.
    """
    sizes = _largest(np.abs(layer))
    sizes = sizes[sizes > 0.0]
    return float(MIDDLE_GREY / np.median(sizes)) if sizes.size else 1.0


def _some(layer: NDArray[np.float32]) -> NDArray[np.float32]:
    """About a million of a layer's pixels, which are enough for its statistics."""
    step = max(1, int(np.sqrt(layer.shape[0] * layer.shape[1] / 2**20)))
    return layer[::step, ::step]


@dataclass(frozen=True)
class _Network:
    """Open Image Denoise with its guides: arrays of shape (height, width, 3) by name."""

    oidn: ModuleType
    guides: dict[str, NDArray[np.float32]]

    @classmethod
    def around(cls, window: Window, frame: Frame, oidn: ModuleType) -> _Network:
        """The network for a window of a frame."""
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
        return np.asarray(oidn.denoise(noisy, **self.guides, hdr=True, input_scale=scale, **settings))
