"""The synthetic objects' bounds as seen from a point: where a ray must go to meet something new.

A support point changes only by what synthetic surfaces do to its light (theory, eq. 4), so part of its rays is
sampled toward spheres around the objects (object-directed sampling), and Russian roulette ends paths that can hardly meet
one.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from lightdepth.kernel.variables import as_point
from lightdepth.parameters.transport import DEFAULT, TransportParameters

Sphere = tuple[np.ndarray, float]
"""Centre, shape (3,), world, and radius, both in metres."""
ROUNDING = 1.0 + 1e-3
"""Factor on the squared chord of a cone's angle up to which directions count as inside: its rim is rounded."""
NEAR = 0.5
"""Share of a sphere's radius up to which its surface counts as near."""


class ObjectBounds:
    """Spheres that enclose the synthetic objects.

    Args:
        spheres: around each of them.
        parameters: how many spheres at most, and how often they are sampled.
    """

    def __init__(self, spheres: Sequence[Sphere], parameters: TransportParameters = DEFAULT) -> None:
        self.spheres = _merge_nearest(list(spheres), parameters.most_spheres, parameters.compared_spheres)
        self._directed_share = parameters.directed_share
        self._centres = [as_point(centre) for centre, _ in self.spheres]
        self._radii = [dr.opaque(mi.Float, radius) for _, radius in self.spheres]
        self._around = (
            dr.opaque(mi.Float, 1.0 / parameters.far_from_objects**2),
            dr.opaque(mi.Float, parameters.surroundings**2),
        )

    def cones(self, point: mi.Point3f) -> Cones:
        """The cones of directions from points (world, metres) that the spheres fill, with their surroundings if far away.

        From far away, what the objects change around them, such as their shadows, is as small as they are, and would be
        met by chance alone, by few samples that are bright or dark spots then.
        """
        return Cones(point, self._centres, self._radii, self._directed_share, self._around)

    def beams(self, position: mi.Vector3f, finite: mi.Bool) -> Beams:
        """Light that runs from positions to the spheres.

        Args:
            position: world, metres, where ``finite``, else unit directions toward the sky.
            finite: false for sky.
        """
        return Beams(position, finite, self._centres, self._radii)

    def extent(self, direction: mi.Vector3f) -> mi.Float:
        """How far the spheres reach along unit directions from the origin of the world, metres."""
        result = mi.Float(-dr.inf)
        for centre, radius in zip(self._centres, self._radii, strict=True):
            result = dr.maximum(result, dr.dot(mi.Vector3f(centre), direction) + radius)
        return result

    def detail(self, point: mi.Point3f) -> mi.Float:
        """Metres over which the objects' influence varies at points (world, metres).

        It is the distance to the nearest sphere, or a share of its radius close by.
        """
        result = mi.Float(dr.inf)
        for centre, radius in zip(self._centres, self._radii, strict=True):
            result = dr.minimum(result, dr.maximum(dr.norm(point - centre) - radius, NEAR * radius))
        return result


class Cones:
    """Directions from a point toward the spheres, sampled uniformly over the sum of their solid angles.

    Args:
        point: world, metres.
        centres: of the spheres, world, metres.
        radii: of the spheres, metres.
        directed_share: of the samples, where the spheres fill little of the view.
        around: squared sine of the angle that small spheres are enlarged to, and by how much they are at most, squared.
    """

    def __init__(
        self,
        point: mi.Point3f,
        centres: list[mi.Point3f],
        radii: list[mi.Float],
        directed_share: float = 0.0,
        around: tuple[mi.Float, mi.Float] | None = None,
    ) -> None:
        self._directed_share = directed_share
        self._axes, self._squared_chords, self._solid_angles = [], [], []
        self.solid_angle = mi.Float(0.0)
        for centre, radius in zip(centres, radii, strict=True):
            offset = mi.Vector3f(centre - point)
            squared = dr.squared_norm(offset)
            sine_squared = dr.square(radius) / dr.maximum(squared, 1e-20)
            if around is not None:
                sine_squared = dr.maximum(sine_squared, dr.minimum(around[0], around[1] * sine_squared))
            cosine = dr.select(sine_squared < 1.0, dr.safe_sqrt(1.0 - sine_squared), -1.0)
            # 1 - cos without cancellation, for objects that are far away.
            versine = dr.select(sine_squared < 1.0, sine_squared / (1.0 + cosine), 2.0)
            self._axes.append(offset * dr.rsqrt(dr.maximum(squared, 1e-20)))
            self._squared_chords.append(versine * (2.0 * ROUNDING))
            self._solid_angles.append(dr.two_pi * versine)
            self.solid_angle += self._solid_angles[-1]
        self._density = dr.select(self.solid_angle > 0.0, dr.rcp(self.solid_angle), 0.0)

    @property
    def directed_share(self) -> mi.Float:
        """Share of object-directed samples: less and less where the spheres fill the view, where they gain nothing."""
        return self._directed_share * dr.maximum(1.0 - self.solid_angle * dr.inv_two_pi, 0.0)

    def sample(self, choice: mi.Float, position: mi.Point2f) -> mi.Vector3f:
        """A unit direction, uniform over the cones; ``choice`` and ``position`` are uniform in [0, 1)."""
        axis, versine = _picked(choice, self.solid_angle, self._solid_angles, self._axes, self._solid_angles)
        fall = position.x * versine * dr.inv_two_pi
        sine = dr.safe_sqrt(fall * (2.0 - fall))
        sin_phi, cos_phi = dr.sincos(dr.two_pi * position.y)
        return mi.Frame3f(axis).to_world(mi.Vector3f(sine * cos_phi, sine * sin_phi, 1.0 - fall))

    def pdf(self, direction: mi.Vector3f) -> mi.Float:
        """Density of :meth:`sample` per steradian."""
        covering = mi.Float(0.0)
        for axis, squared_chord in zip(self._axes, self._squared_chords, strict=True):
            # By the chord: the cosine of a small angle is 1 in single precision, and a direction that was drawn but is
            # not recognised would get the weight of one that was drawn by chance.
            covering += dr.select(dr.squared_norm(direction - axis) <= squared_chord, 1.0, 0.0)
        return covering * self._density


class Beams:
    """Rays from positions toward the spheres, or from directions of the sky.

    The former are uniform over the sum of the spheres' solid angles, the latter over that of their cross-sections.

    Args:
        position: as for :meth:`ObjectBounds.beams`.
        finite: likewise.
        centres: of the spheres, world, metres.
        radii: of the spheres, metres.
    """

    def __init__(
        self, position: mi.Vector3f, finite: mi.Bool, centres: list[mi.Point3f], radii: list[mi.Float]
    ) -> None:
        self._position, self._finite, self._centres, self._radii = position, finite, centres, radii
        self._cones = Cones(mi.Point3f(position), centres, radii)
        self._areas = [dr.pi * dr.square(radius) for radius in radii]
        self._total_area = mi.Float(0.0)
        for area in self._areas:
            self._total_area += area

    def sample(self, choice: mi.Float, position: mi.Point2f) -> tuple[mi.Point3f, mi.Vector3f]:
        """Draw rays: origins (for sky, in the target sphere, across its middle), and unit directions.

        ``choice`` and ``position`` are uniform in [0, 1).
        """
        toward = self._cones.sample(choice, position)
        centre, radius = _picked(choice, self._total_area, self._areas, self._centres, self._radii)
        disk = mi.warp.square_to_uniform_disk_concentric(position)
        across = centre + radius * mi.Frame3f(self._position).to_world(mi.Vector3f(disk.x, disk.y, 0.0))
        return (
            dr.select(self._finite, mi.Point3f(self._position), across),
            dr.select(self._finite, toward, -self._position),
        )

    def pdf(self, point: mi.Point3f, direction: mi.Vector3f) -> mi.Float:
        """Density of the rays through points: per steradian, or for sky per square metre across them.

        Args:
            point: on the rays, world, metres.
            direction: of the rays, unit.
        """
        covering = mi.Float(0.0)
        for centre, radius in zip(self._centres, self._radii, strict=True):
            offset = mi.Vector3f(centre - point)
            across = dr.squared_norm(offset) - dr.square(dr.dot(offset, direction))
            covering += dr.select(across <= dr.square(radius), 1.0, 0.0)
        return dr.select(self._finite, self._cones.pdf(direction), covering / self._total_area)


def _picked(choice: mi.Float, total: mi.Float, sizes: list[mi.Float], *columns: list[Any]) -> list[Any]:
    """What columns hold in one row, picked in proportion to the rows' sizes.

    Args:
        choice: uniform in [0, 1).
        total: of the sizes.
        sizes: of the rows, not negative.
        columns: scalars, points or vectors, one for each row.
    """
    remaining = choice * total
    picked = [column[0] for column in columns]
    chosen = mi.Bool(False)
    for size, *row in zip(sizes, *columns, strict=True):
        here = ~chosen & (remaining < size)
        picked = [dr.select(here, value, before) for value, before in zip(row, picked, strict=True)]
        chosen |= here
        remaining = dr.select(chosen, remaining, remaining - size)
    return picked


def _merge_nearest(spheres: list[Sphere], most: int, compared: int) -> list[Sphere]:
    """Merge spheres two by two, those first whose common sphere is the smallest, until no more than ``most`` are left."""
    while len(spheres) > max(
        compared, most
    ):  # Many objects: a coarse first round along the longest axis keeps this quick.
        axis = int(np.argmax(np.ptp([centre for centre, _ in spheres], axis=0)))
        spheres = sorted(spheres, key=lambda sphere: float(sphere[0][axis]))
        spheres = [_enclose(*spheres[i : i + 2]) for i in range(0, len(spheres), 2)]
    while len(spheres) > most:
        pairs = [(i, j) for i in range(len(spheres)) for j in range(i)]
        i, j = min(pairs, key=lambda pair: _enclose(spheres[pair[0]], spheres[pair[1]])[1])
        merged = _enclose(spheres[i], spheres[j])
        spheres = [sphere for index, sphere in enumerate(spheres) if index not in (i, j)] + [merged]
    return spheres


def _enclose(first: Sphere, second: Sphere | None = None) -> Sphere:
    """The smallest sphere around one or two."""
    if second is None:
        return first
    (a, ra), (b, rb) = first, second
    distance = float(np.linalg.norm(b - a))
    if distance + rb <= ra:
        return first
    if distance + ra <= rb:
        return second
    radius = 0.5 * (distance + ra + rb)
    return a + (b - a) * ((radius - ra) / distance), radius
