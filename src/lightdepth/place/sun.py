"""A declared sun: a distant disc that shines through the openings of the place, which the capture point does not see.

Theory, section 2, "A sun that the photograph lacks". What the sun does to the surfaces that the photograph shows, its
patches on the floor, is in the photograph; what it would do to new objects is not.
"""

from __future__ import annotations

import math
from copy import copy

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter

from lightdepth.kernel.arrays import aligned
from lightdepth.kernel.tracing import first_hit, meets
from lightdepth.kernel.variables import as_point, as_vectors
from lightdepth.parameters.place import DEFAULT, PlaceParameters
from lightdepth.place.light_list import LightSample
from lightdepth.place.real_light import DeclaredLight
from lightdepth.place.real_surfaces import FaceKind
from lightdepth.place.traced_surfaces import RealHit, TracedSurfaces
from lightdepth.scene.lights.frame import sun_axes
from lightdepth.scene.model import SunLight


class Sun(DeclaredLight):
    """A sun that shines into the place.

    Args:
        settings: its direction, size and strength.
        surfaces: the real surfaces; those that are not openings block it.
        parameters: how finely its shadow map steers sampling.
    """

    passes_openings = True

    def __init__(self, settings: SunLight, surfaces: TracedSurfaces, parameters: PlaceParameters = DEFAULT) -> None:
        self.surfaces = surfaces
        right, up = sun_axes(settings.direction)
        self._axes = [as_point(axis) for axis in (right, up, settings.direction)]
        angle = math.radians(0.5 * settings.diameter)
        # 1 - cos without cancellation.
        self._versine = dr.opaque(mi.Float, 2.0 * math.sin(0.5 * angle) ** 2)
        self._density = dr.opaque(mi.Float, 1.0 / (4.0 * math.pi * math.sin(0.5 * angle) ** 2))
        self._radiance = mi.Color3f(*(settings.irradiance / (math.pi * math.sin(angle) ** 2)).tolist())
        dr.make_opaque(self._radiance)
        self._mask: mi.Texture2f | None = None
        if settings.mask is not None and settings.mask_extent is not None:
            image = settings.mask[..., None] if settings.mask.ndim == 2 else settings.mask
            self._mask = mi.Texture2f(mi.TensorXf(np.ascontiguousarray(image, np.float32)), wrap_mode=dr.WrapMode.Clamp)
            self._mask_extent = dr.opaque(mi.Vector4f, settings.mask_extent)
        self._shadow_map = _ShadowMap(settings.direction, surfaces, parameters) if surfaces.has_real else None

    def with_surfaces(self, surfaces: TracedSurfaces) -> Sun:
        """The same sun, blocked by other meshes of the same surfaces."""
        sun = copy(self)
        sun.surfaces = surfaces
        return sun

    def sample(self, u: mi.Float, v: mi.Float) -> LightSample:
        """Directions toward the disc, uniform over its solid angle, by uniform random numbers in [0, 1)."""
        return LightSample(
            self._direction(u, v),
            mi.Vector3f(0.0, 0.0, 1.0),
            mi.Float(self._density),
            mi.Color3f(self._radiance),
            mi.Bool(False),
            mi.Bool(False),
            mi.UInt32(0),
        )

    def arriving(
        self, ray: mi.Ray3f, hit: RealHit, distance: mi.Float, active: mi.Bool, kept: mi.Bool | bool = False
    ) -> tuple[mi.Color3f, mi.Float, mi.Bool]:
        """The disc's radiance where rays run into it, through an opening or past all real surfaces."""
        within = active & (1.0 - dr.dot(ray.d, mi.Vector3f(self._axes[2])) <= self._versine)
        within &= ~hit.valid | (hit.kind == int(FaceKind.OPENING))
        # What lies behind an opening may keep the sun out; where nothing real is met, nothing does.
        if FaceKind.OPENING in self.surfaces.kinds:
            behind = within & hit.valid
            blocked = self.blocked(ray, behind)
            if self.surfaces.has_removed:
                blocked = dr.select(kept, self.blocked(ray, behind, kept=True), blocked)
            within &= ~(behind & blocked)
        radiance = self._radiance * self.transmittance(ray.o)
        return dr.select(within, radiance, 0.0), dr.select(within, self._density, 0.0), mi.Bool(False)

    @property
    def has_mask(self) -> bool:
        """Whether a mask attenuates it."""
        return self._mask is not None

    def blocked(self, ray: mi.Ray3f, active: mi.Bool, kept: bool = False) -> mi.Bool:
        """Whether real surfaces that are not openings stand in the way of rays that run toward the sun.

        Args:
            ray: from a surface, unit directions, world.
            active: lanes to evaluate.
            kept: only those count that are not removed.
        """
        if not self.surfaces.has_real:
            return mi.Bool(False)
        beyond = mi.Ray3f(ray.o, ray.d)
        return meets(self.surfaces.kept_blockers if kept else self.surfaces.blockers, beyond, active)

    def transmittance(self, point: mi.Point3f) -> mi.Color3f:
        """Share of the sun that the mask lets through to points, world: curtains and bars that are not modelled."""
        if self._mask is None:
            return mi.Color3f(1.0)
        right, up = (dr.dot(mi.Vector3f(point), mi.Vector3f(axis)) for axis in self._axes[:2])
        extent = self._mask_extent
        low, high = mi.Point2f(extent.x, extent.y), mi.Point2f(extent.z, extent.w)
        at = (mi.Point2f(right, up) - low) / (high - low)
        value = self._mask.eval(mi.Point2f(at.x, 1.0 - at.y))
        inside = (at.x >= 0.0) & (at.x <= 1.0) & (at.y >= 0.0) & (at.y <= 1.0)
        channels = [value[i] for i in range(len(value))]
        return mi.Color3f(*(channels * (3 // len(channels)))) & inside

    def may_light(self, point: mi.Point3f) -> mi.Bool:
        """Whether real surfaces seem to let the sun through to points, by the shadow map: wrong now and then."""
        return mi.Bool(True) if self._shadow_map is None else self._shadow_map.may_be_lit(point)

    def _direction(self, u: mi.Float, v: mi.Float) -> mi.Vector3f:
        fall = u * self._versine
        sine = dr.safe_sqrt(fall * (2.0 - fall))
        sin_phi, cos_phi = dr.sincos(dr.two_pi * v)
        right, up, axis = (mi.Vector3f(each) for each in self._axes)
        return right * (sine * cos_phi) + up * (sine * sin_phi) + axis * (1.0 - fall)


class _ShadowMap:
    """Where the sun's parallel rays first meet a surface that blocks them, on a grid across its direction.

    Args:
        direction: toward the sun, unit, world, shape (3,).
        surfaces: the real surfaces.
        parameters: its fineness and its tolerances.
    """

    def __init__(self, direction: NDArray[np.float64], surfaces: TracedSurfaces, parameters: PlaceParameters) -> None:
        right, up = sun_axes(direction)
        box = surfaces.real.bbox()
        corners = np.array([np.asarray(box.corner(i)).reshape(3) for i in range(8)], np.float64)
        across = np.stack([corners @ right, corners @ up], axis=1)
        low, high = across.min(axis=0), across.max(axis=0)
        cell = max(float((high - low).max()) / parameters.sun_map_texels, 1e-6)
        columns, rows = (int(n) for n in np.maximum(np.ceil((high - low) / cell), 1))
        s, t = np.meshgrid(low[0] + (np.arange(columns) + 0.5) * cell, low[1] + (np.arange(rows) + 0.5) * cell)
        top = float((corners @ direction).max()) + 1.0
        starts = s[..., None] * right + t[..., None] * up + top * direction
        origin = mi.Point3f(as_vectors(starts.reshape(-1, 3)))
        ray = mi.Ray3f(origin, mi.Vector3f(*(-direction).tolist()))
        found = first_hit(surfaces.kept_blockers, ray, coherent=True)
        reached = np.where(found.is_valid().numpy(), top - found.t.numpy(), -np.inf).reshape(rows, columns)
        lowest = minimum_filter(reached, size=parameters.sun_map_lit, mode="nearest")
        self._tolerance = parameters.sun_map_tolerance
        self._heights = mi.Float(aligned(lowest.astype(np.float32)))
        self._axes = [as_point(axis) for axis in (right, up, direction)]
        self._low = dr.opaque(mi.Vector2f, low.tolist())
        self._scale = dr.opaque(mi.Float, 1.0 / cell)
        self._columns, self._rows = dr.opaque(mi.UInt32, columns), dr.opaque(mi.UInt32, rows)

    def may_be_lit(self, point: mi.Point3f) -> mi.Bool:
        """Whether points (world, metres) may see the sun; true as well where they lie outside the map."""
        s, t, height = (dr.dot(mi.Vector3f(point), mi.Vector3f(axis)) for axis in self._axes)
        column, row = (mi.Int32(dr.floor((at - low) * self._scale)) for at, low in ((s, self._low.x), (t, self._low.y)))
        inside = (column >= 0) & (row >= 0) & (column < mi.Int32(self._columns)) & (row < mi.Int32(self._rows))
        index = mi.UInt32(dr.maximum(row, 0)) * self._columns + mi.UInt32(dr.maximum(column, 0))
        return ~inside | (height >= dr.gather(mi.Float, self._heights, index, inside) - self._tolerance)
