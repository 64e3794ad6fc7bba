"""The panorama's radiance M(w) as a function and as a probability density on the sphere, in Dr.Jit.

The radiance between pixel centres is their bilinear interpolation, which wraps around at the seam and goes on over the
poles at the opposite longitude. The density is sampled from *the same* interpolation: a pixel is drawn with
probability proportional to its luminance times its solid angle, then moved by a tent of one pixel's half-width. A
sum of such tents is the bilinear interpolation of the pixels' probabilities, so that a lamp of a few pixels at
radiance 30,000 gives no outliers where its edge is interpolated.

BSDF sampling covers radiance below the mean well enough. Where it is
used too, light sampling is limited to what exceeds the mean: a pixel's luminance counts less the map's mean (Karlik et
al. 2019, "MIS compensation").
"""

from __future__ import annotations

from collections.abc import Callable

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import pixel_solid_angles
from lightdepth.kernel.arrays import aligned, aligned_empty
from lightdepth.parameters.place import DEFAULT, PlaceParameters

LUMINANCE_WEIGHTS = np.array([0.2126, 0.7152, 0.0722])
PIXELS_AT_ONCE = 1 << 18


def hilbert_curve(levels: int) -> NDArray[np.uint16]:
    """Numbers of the cells of two squares side by side along one Hilbert curve.

    Args:
        levels: the squares have 2 to this power cells a side; at most 7.

    Returns:
        Shape (2 ** levels, 2 ** (levels + 1)); cells with consecutive indices are neighbours.
    """
    square = np.zeros((1, 1), np.uint16)
    for _ in range(levels):
        n = square.size
        square = np.block([[square.T, square[::-1, ::-1].T + 3 * n], [square + n, square + 2 * n]]).astype(np.uint16)
    return np.hstack([square, square + square.size]).astype(np.uint16)


CURVE = hilbert_curve(7)


class MapDistribution:
    """Radiance of a panorama and importance sampling of it. All directions are in light space.

    Args:
        radiance: linear RGB, shape (height, 2 height, 3), float32, finite and not negative.
        alone: whether nothing but light sampling finds the light, so that all of it must be sampled.
        importance: factor on the density of each pixel, shape (height, 2 height), not negative; ``None`` is 1.
        parameters: when it is even, and what is looked up beside edges.

    Attributes:
        power: luminance times solid angle that is sampled, with its importance.
        light: luminance times solid angle of the whole map.
        standing_out: its part above the mean.
    """

    def __init__(
        self,
        radiance: NDArray[np.float32],
        alone: bool = False,
        importance: NDArray[np.float32] | None = None,
        parameters: PlaceParameters = DEFAULT,
    ) -> None:
        self._edge_weight = parameters.edge_weight
        self.height, self.width = radiance.shape[:2]
        texels = aligned_empty((self.height, self.width, 4))
        texels[..., :3] = radiance
        weights = radiance @ LUMINANCE_WEIGHTS.astype(np.float32)
        solid_angles = pixel_solid_angles(self.height, self.width)
        total = float(weights.sum(axis=1, dtype=np.float64) @ solid_angles)
        mean = np.float32(total / (4.0 * np.pi))
        # Row by row: a large panorama is not held twice.
        standing_out = sum(
            float(np.maximum(row - mean, 0.0).sum()) * angle for row, angle in zip(weights, solid_angles, strict=True)
        )
        self.light, self.standing_out = total, standing_out
        if standing_out > parameters.even * total and not alone:
            weights -= mean
            np.maximum(weights, 0.0, out=weights)
            total = standing_out
        if importance is not None:
            weights *= importance
            total = float(weights.sum(axis=1, dtype=np.float64) @ solid_angles)
        self.power = total
        weights *= solid_angles.astype(np.float32)[:, None]
        if total > 0.0:
            weights /= np.float32(total / (self.width * self.height))
        # The fourth component is the density with respect to (u, v) at the pixel's centre.
        texels[..., 3] = weights
        self._texels = mi.Float(texels.reshape(-1))
        # On the CPU this is where the texels lie: of a large panorama, a copy of them counts.
        self._weights = self._texels.numpy().reshape(texels.shape)[..., 3]
        self._rows_at_once = max(1, PIXELS_AT_ONCE // self.width)
        blocks = np.array(
            [block.sum(dtype=np.float64) for block in map(self._block, range(-(-self.height // self._rows_at_once)))]
        )
        self._block_ends = np.cumsum(blocks) / max(blocks.sum(), 1e-300)

    def radiance_and_pdf(self, direction: mi.Vector3f) -> tuple[mi.Color3f, mi.Float]:
        """M(w) and the density ``p_map(w)`` per unit solid angle at the capture point.

        Args:
            direction: unit vectors, light space.
        """
        u, v = direction_to_latlong(direction)
        value = self._interpolate(u, v)
        sin_theta = dr.safe_sqrt(1.0 - dr.square(direction.z))
        return mi.Color3f(value.x, value.y, value.z), value.w / (2.0 * dr.pi * dr.pi * dr.maximum(sin_theta, 1e-6))

    def radiance(self, direction: mi.Vector3f) -> mi.Color3f:
        """M(w) for unit vectors in light space."""
        value = self._interpolate(*direction_to_latlong(direction))
        return mi.Color3f(value.x, value.y, value.z)

    def sharp_radiance(self, direction: mi.Vector3f) -> mi.Color3f:
        """M(w) by Catmull-Rom interpolation held between its neighbours: what a camera sees, unlike what lights."""
        u, v = direction_to_latlong(direction)
        x, y = u * self.width - 0.5, v * self.height - 0.5
        column, row = dr.floor(x), dr.floor(y)
        weights_x, weights_y = _catmull_rom(x - column), _catmull_rom(y - row)
        column, row = mi.Int32(column), mi.Int32(row)
        total, low, high = mi.Color3f(0.0), mi.Color3f(dr.inf), mi.Color3f(0.0)
        for j in range(4):
            line = mi.Color3f(0.0)
            for i in range(4):
                texel = self._texel(column + (i - 1), row + (j - 1))
                value = mi.Color3f(texel.x, texel.y, texel.z)
                line += weights_x[i] * value
                if i in (1, 2) and j in (1, 2):
                    low, high = dr.minimum(low, value), dr.maximum(high, value)
            total += weights_y[j] * line
        return dr.clip(total, low, high)

    def sharp_radiance_of(
        self, direction: mi.Vector3f, belongs: Callable[[mi.Vector3f, mi.UInt32], mi.Bool]
    ) -> mi.Color3f:
        """:meth:`sharp_radiance` from the pixels alone that show the surface that is meant.

        Where all 16 do, it is the same; else the nearest four are interpolated linearly as far as they do, and where none
        of these does, it is the mean of those that do.

        Args:
            direction: unit vectors, light space.
            belongs: whether pixels belong to it, by the unit directions of their centres, light space, and their indices.
        """
        u, v = direction_to_latlong(direction)
        x, y = u * self.width - 0.5, v * self.height - 0.5
        column, row = dr.floor(x), dr.floor(y)
        across, down = x - column, y - row
        sines_v = [dr.sincos(dr.pi * (row + (j - 0.5)) / self.height) for j in range(4)]
        sines_u = [dr.sincos(dr.two_pi * ((column + (i - 0.5)) / self.width - 0.5)) for i in range(4)]
        column, row = mi.Int32(column), mi.Int32(row)
        everywhere = mi.Bool(True)
        near, near_weight, far, far_weight = mi.Color3f(0.0), mi.Float(0.0), mi.Color3f(0.0), mi.Float(0.0)
        for j, (sin_theta, cos_theta) in enumerate(sines_v):
            for i, (sin_phi, cos_phi) in enumerate(sines_u):
                index = self._index(column + (i - 1), row + (j - 1))
                there = belongs(mi.Vector3f(sin_theta * sin_phi, sin_theta * cos_phi, cos_theta), index)
                texel = dr.gather(mi.Vector4f, self._texels, index)
                value = mi.Color3f(texel.x, texel.y, texel.z)
                everywhere &= there
                far += dr.select(there, value, 0.0)
                far_weight += dr.select(there, 1.0, 0.0)
                if i in (1, 2) and j in (1, 2):
                    share = (across if i == 2 else 1.0 - across) * (down if j == 2 else 1.0 - down)
                    share = dr.select(there, share, 0.0)
                    near += share * value
                    near_weight += share
        partly = dr.select(near_weight > self._edge_weight, near / near_weight, far / far_weight)
        return dr.select(everywhere | (far_weight == 0.0), self.sharp_radiance(direction), partly)

    def pixel(self, direction: mi.Vector3f) -> mi.UInt32:
        """Index (row-major) of the pixel that a unit vector in light space falls into."""
        u, v = direction_to_latlong(direction)
        column = dr.clip(mi.Int32(u * self.width), 0, self.width - 1)
        row = dr.clip(mi.Int32(v * self.height), 0, self.height - 1)
        return mi.UInt32(row * self.width + column)

    def pixels_around(self, direction: mi.Vector3f) -> list[mi.UInt32]:
        """Indices of the four pixels between whose centres a unit vector in light space falls."""
        u, v = direction_to_latlong(direction)
        column, row = (mi.Int32(dr.floor(at - 0.5)) for at in (u * self.width, v * self.height))
        return [self._index(column + i, row + j) for j in (0, 1) for i in (0, 1)]

    def sample(self, count: int, generator: np.random.Generator) -> tuple[NDArray[np.int64], mi.Vector3f]:
        """Draw directions by their density, stratified along the pixels' order, and put them in order.

        They follow a curve that stays in one part of the map until it is done with it, so that those of one lamp come
        one after the other: evenly spaced ones of the list are stratified over the lamps.

        Args:
            count: how many.
            generator: source of randomness.

        Returns:
            ``(pixel centres' indices, unit directions in light space)`` of length ``count``.
        """
        positions = (np.arange(count) + generator.random()) / count
        index = np.empty(count, np.int64)
        stops = np.searchsorted(positions, self._block_ends)
        stops[-1] = count
        begin, block_begin = 0, 0.0
        for block, (stop, block_end) in enumerate(zip(stops, self._block_ends, strict=True)):
            if stop > begin:
                within = (positions[begin:stop] - block_begin) / max(block_end - block_begin, 1e-300)
                ends = np.cumsum(self._block(block), dtype=np.float64)
                found = np.minimum(np.searchsorted(ends, within * ends[-1], "right"), ends.size - 1)
                index[begin:stop] = block * self._rows_at_once * self.width + found
            begin, block_begin = stop, block_end
        row, column = np.divmod(index, self.width)
        cells = CURVE[row * CURVE.shape[0] // self.height, column * CURVE.shape[1] // self.width]
        order = np.argsort(cells, kind="stable")
        index, row, column = index[order], row[order], column[order]
        tent = generator.random((4, count), dtype=np.float32)
        u = (column + 0.5 + (tent[0] + tent[1] - 1.0)) / self.width
        v = (row + 0.5 + (tent[2] + tent[3] - 1.0)) / self.height
        over_pole = (v < 0.0) | (v > 1.0)
        v = np.where(v < 0.0, -v, np.where(v > 1.0, 2.0 - v, v))
        u = np.mod(np.where(over_pole, u + 0.5, u), 1.0)
        return index, latlong_to_direction(mi.Float(aligned(u)), mi.Float(aligned(v)))

    def _block(self, index: int) -> NDArray[np.float32]:
        """Weights of some rows: the sums over a whole large panorama would take as much memory as the panorama."""
        first = index * self._rows_at_once
        return self._weights[first : first + self._rows_at_once]

    def _interpolate(self, u: mi.Float, v: mi.Float) -> mi.Vector4f:
        x, y = u * self.width - 0.5, v * self.height - 0.5
        column, row = dr.floor(x), dr.floor(y)
        fraction_x, fraction_y = x - column, y - row
        column, row = mi.Int32(column), mi.Int32(row)
        upper = dr.lerp(self._texel(column, row), self._texel(column + 1, row), fraction_x)
        lower = dr.lerp(self._texel(column, row + 1), self._texel(column + 1, row + 1), fraction_x)
        return dr.lerp(upper, lower, fraction_y)

    def _texel(self, column: mi.Int32, row: mi.Int32) -> mi.Vector4f:
        """A pixel by column and row, which may lie up to half a width and height outside the image."""
        return dr.gather(mi.Vector4f, self._texels, self._index(column, row))

    def _index(self, column: mi.Int32, row: mi.Int32) -> mi.UInt32:
        """Index of such a pixel."""
        over_pole = (row < 0) | (row >= self.height)
        row = dr.select(row < 0, -1 - row, dr.select(row >= self.height, 2 * self.height - 1 - row, row))
        column = dr.select(over_pole, column + self.width // 2, column)
        column = dr.select(column < 0, column + self.width, column)
        column = dr.select(column >= self.width, column - self.width, column)
        return mi.UInt32(row * self.width + column)


def direction_to_latlong(direction: mi.Vector3f) -> tuple[mi.Float, mi.Float]:
    """Panorama coordinates (u, v) of unit vectors in light space; see ``lightdepth.directions``."""
    u = dr.atan2(direction.x, direction.y) * dr.inv_two_pi + 0.5
    horizontal = dr.sqrt(dr.square(direction.x) + dr.square(direction.y))
    return u, dr.atan2(horizontal, direction.z) * dr.inv_pi


def latlong_to_direction(u: mi.Float, v: mi.Float) -> mi.Vector3f:
    """Unit vectors in light space of panorama coordinates (u, v); see ``lightdepth.directions``."""
    sin_theta, cos_theta = dr.sincos(dr.pi * v)
    sin_phi, cos_phi = dr.sincos(dr.two_pi * (u - 0.5))
    return mi.Vector3f(sin_theta * sin_phi, sin_theta * cos_phi, cos_theta)


def _catmull_rom(t: mi.Float) -> list[mi.Float]:
    """Weights of four neighbours at the fraction ``t`` between the middle two."""
    return [
        t * (-0.5 + t * (1.0 - 0.5 * t)),
        1.0 + dr.square(t) * (-2.5 + 1.5 * t),
        t * (0.5 + t * (2.0 - 1.5 * t)),
        dr.square(t) * (-0.5 + 0.5 * t),
    ]
