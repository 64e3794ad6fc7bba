"""A spatially hashed radiance cache of what the objects change on support surfaces.

Theory, eq. (4b). A support point ``q`` that a path meets after a scattering sends ``D(q)``, for which the path would
have to continue. It is nearly the same for all paths that arrive near ``q``: so training paths, used for nothing else,
record it, and all other paths end there with the mean of the cache cell. (Path space filtering: Keller et al. 2014,
Binder et al. 2018.)
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from copy import copy

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.kernel.arrays import aligned, aligned_empty
from lightdepth.parameters.transport import DEFAULT, TransportParameters
from lightdepth.place.object_bounds import ObjectBounds

FEWEST_ENTRIES = 2
"""Entries of the cache, padded with an empty one if necessary: a lookup in a single entry needs a kernel of its own,
which takes a second to compile."""
COORDINATE_BITS, FACING_BITS = 18, 3
LEVEL_OFFSET = 16
NO_CELL = 0
CORNERS = np.array(
    [sum(((corner >> axis) & 1) << (FACING_BITS + axis * COORDINATE_BITS) for axis in range(3)) for corner in range(8)],
    np.uint64,
)
"""The bits of a cell's key that distinguish the eight cells of a block."""


class RadianceCache:
    """Mean change of a white surface's radiance, ``1/pi`` times that of its irradiance, by cell.

    Args:
        bounds: of the objects: cells are small where these are near.
        parameters: how large, and how much they take from their neighbours.

    Attributes:
        training: whether the paths that are followed are training paths, which estimate nothing for their pixels.
    """

    def __init__(self, bounds: ObjectBounds, parameters: TransportParameters = DEFAULT) -> None:
        self._bounds, self._parameters = bounds, parameters
        self._cells = np.zeros(0, np.uint64)
        self._sums = np.zeros((0, 3))
        self._records = np.zeros(0, np.int64)
        self._squares = np.zeros(0)
        self._upload()
        self._expect(0)

    @contextmanager
    def train(self, paths: int) -> Iterator[None]:
        """While this is open, the paths that are followed are training paths; their records count when it closes.

        Args:
            paths: how many will be followed.
        """
        self._expect(paths)
        yield
        self._add(self._record_cells.numpy(), self._record_values.numpy().reshape(-1, 4)[:, :3])
        self._expect(0)

    @property
    def records(self) -> int:
        """How many records training paths have left."""
        return int(self._records.sum())

    def contents(self) -> dict[str, NDArray]:
        """The whole state of the cache, by name."""
        return {"cells": self._cells, "sums": self._sums, "records": self._records, "squares": self._squares}

    def restore(self, contents: Mapping[str, NDArray]) -> None:
        """Replace the state by one from :meth:`contents`."""
        self._cells, self._sums, self._records, self._squares = (
            contents[name] for name in ("cells", "sums", "records", "squares")
        )
        self._upload()

    def perturbed(self, generator: np.random.Generator) -> RadianceCache:
        """A cache of the same cells whose means are off by as much as the means here are expected to be.

        Every cell's sum is changed by random numbers of its standard error. Each channel has its own, so that one picture
        shows three such caches. Cells with few records have the variance that the others have on average.
        """
        grey, count = self._sums.mean(axis=1), np.maximum(self._records, 1)
        within = np.maximum(self._squares - np.square(grey) / count, 0.0)
        pooled = float(within.sum() / max(float((self._records - 1).sum()), 1.0))
        # Shrunk toward the pooled variance by as many records as the block counts for.
        variance = (within + self._parameters.neighbours_count * pooled) / (
            np.maximum(count - 1, 0) + self._parameters.neighbours_count
        )
        other = copy(self)
        other._sums = self._sums + generator.standard_normal((len(count), 3)) * np.sqrt(variance * count)[:, None]
        other._upload()
        return other

    def cell(self, point: mi.Point3f, normal: mi.Vector3f) -> tuple[mi.UInt64, mi.Float]:
        """The keys of the cells of points, and the cells' edges in metres.

        Args:
            point: world, metres.
            normal: unit, world; surfaces that face apart have cells of their own.
        """
        parameters = self._parameters
        longest = dr.clip(
            parameters.cell_edge * self._bounds.detail(point), parameters.smallest_cell, parameters.largest_cell
        )
        level = dr.floor(dr.log2(longest))
        edge = dr.exp2(level)
        key = mi.UInt64(mi.UInt32(mi.Int32(level) + LEVEL_OFFSET))
        for coordinate in (point.x, point.y, point.z):
            position = mi.UInt32(mi.Int32(dr.floor(coordinate / edge))) & ((1 << COORDINATE_BITS) - 1)
            key = (key << COORDINATE_BITS) | mi.UInt64(position)
        return (key << FACING_BITS) | mi.UInt64(_facing(normal)), edge

    @dr.syntax
    def look_up(self, cell: mi.UInt64, active: mi.Bool) -> tuple[mi.Bool, mi.Color3f]:
        """Whether cells have valid entries, and the mean of each.

        Args:
            cell: from :meth:`cell`.
            active: lanes to evaluate.
        """
        below, step = mi.UInt32(0), mi.UInt32(self._widest_step)
        while step > 0:
            tried = below + step
            inside = active & (tried <= self._count)
            before = dr.gather(mi.UInt64, self._keys, tried - 1, inside) < cell
            below = dr.select(inside & before, tried, below)
            step >>= 1
        found = active & (below < self._count)
        found &= dr.gather(mi.UInt64, self._keys, below, found) == cell
        value = dr.gather(mi.Vector4f, self._means, below, found)
        return found, mi.Color3f(value.x, value.y, value.z)

    def record(self, path: mi.UInt32, cell: mi.UInt64, change: mi.Color3f, active: mi.Bool) -> None:
        """Keep the records of training paths; of other paths, nothing.

        Args:
            path: indices of the paths, below the count given to :meth:`train`.
            cell: the cell that each has a record for, or ``NO_CELL``.
            change: estimated change of a white surface's radiance.
            active: which have ended.
        """
        active = active & self.training & (cell != NO_CELL)
        dr.scatter(self._record_cells, cell, path, active)
        dr.scatter(self._record_values, mi.Vector4f(change.x, change.y, change.z, 0.0), path, active)

    def _expect(self, paths: int) -> None:
        self.training = dr.opaque(mi.Bool, paths > 0)
        self._record_cells = dr.zeros(mi.UInt64, max(paths, 1))
        self._record_values = dr.zeros(mi.Float, 4 * max(paths, 1))
        dr.make_opaque(self._record_cells, self._record_values)

    def _add(self, cells: NDArray[np.uint64], records: NDArray[np.float32]) -> None:
        useful = (cells != NO_CELL) & np.isfinite(records).all(axis=1)
        cells, records = cells[useful], records[useful]
        self._cells, slot = np.unique(np.concatenate([self._cells, cells]), return_inverse=True)
        # One after the other in the order of the paths, so that the same paths always give the same means.
        old, size = len(self._records), len(self._cells)
        counts, sums, squares = np.zeros(size, np.int64), np.zeros((size, 3)), np.zeros(size)
        counts[slot[:old]], sums[slot[:old]] = self._records, self._sums
        squares[slot[:old]] = self._squares
        squares += np.bincount(slot[old:], np.square(records.mean(axis=1)), size)
        counts += np.bincount(slot[old:], minlength=size)
        for channel in range(3):
            sums[:, channel] += np.bincount(slot[old:], records[:, channel], size)
        self._records, self._sums, self._squares = counts, sums, squares
        self._upload()

    def _upload(self) -> None:
        blocks, of_record = np.unique(self._cells & ~CORNERS[-1], return_inverse=True)
        cells = (blocks[:, None] | CORNERS).reshape(-1)
        block = np.repeat(np.arange(len(blocks)), len(CORNERS))
        order = np.argsort(cells)
        cells, block = cells[order], block[order]
        records, sums = np.zeros(len(cells)), np.zeros((len(cells), 3))
        slot = np.searchsorted(cells, self._cells)
        records[slot], sums[slot] = self._records, self._sums
        in_block = np.bincount(of_record, self._records, len(blocks))
        around = np.stack([np.bincount(of_record, channel, len(blocks)) / in_block for channel in self._sums.T], axis=1)
        size = max(len(cells), FEWEST_ENTRIES)
        means, keys = aligned_empty((size, 4)), np.zeros(size, np.uint64)
        means[:] = 0.0
        means[: len(cells), :3] = sums + self._parameters.neighbours_count * around[block]
        means[: len(cells), :3] /= (records + self._parameters.neighbours_count)[:, None]
        keys[: len(cells)] = cells
        self._means = mi.Float(means.reshape(-1))
        self._keys = mi.UInt64(aligned(keys, np.uint64))
        self._count = dr.opaque(mi.UInt32, len(cells))
        self._widest_step = dr.opaque(mi.UInt32, 1 << (size.bit_length() - 1))


def _facing(normal: mi.Vector3f) -> mi.UInt32:
    """Which side of a cube a normal points to, 1 to 6."""
    size = dr.abs(normal)
    axis = dr.select(size.x > dr.maximum(size.y, size.z), 0, dr.select(size.y > size.z, 1, 2))
    along = dr.select(axis == 0, normal.x, dr.select(axis == 1, normal.y, normal.z))
    return mi.UInt32(1) + mi.UInt32(axis) + dr.select(along > 0.0, mi.UInt32(3), mi.UInt32(0))
