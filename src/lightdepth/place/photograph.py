"""A photograph: the radiance of the place that it gives, seen from anywhere, and the sampling of its light.

Equations: docs/theory.md, sections 2 and 3. The paper's ``M(w, z)`` of section 4, its eq. 4 (a real point's radiance is
read from the map in the direction from the capture point), and section 5.6 (lights at their real positions), with
the change of measure that the paper leaves out.
"""

from __future__ import annotations

import math
from copy import copy

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import latlong_to_direction as direction_of_latlong
from lightdepth.kernel.arrays import aligned_empty
from lightdepth.kernel.row_bands import bands
from lightdepth.kernel.tracing import first_hit
from lightdepth.kernel.variables import as_matrix, as_point
from lightdepth.place.light_list import LightSample
from lightdepth.place.map_distribution import MapDistribution, direction_to_latlong, latlong_to_direction
from lightdepth.place.real_light import RealLight
from lightdepth.place.real_surfaces import FaceKind
from lightdepth.place.traced_surfaces import RealHit, TracedSurfaces
from lightdepth.place.unseen_sky import sky_map
from lightdepth.scene.model import Panorama

DEPTH_TOLERANCE = 0.01
"""Relative difference of distances up to which the capture point is taken to see a real point."""
SKY_ROWS = 256
"""Rows of pixels, at most, from which the sky's mean radiance is taken."""
CLEARLY_BEFORE = 2.0
"""Pixels of the map; a surface no farther than this from a real point's plane does not certainly occlude it."""


class Photograph(RealLight):
    """A panorama, both as the appearance of the place and as a light: all that concerns one capture point.

    Args:
        panorama: the photograph and its pose.
        surfaces: the real surfaces to trace.
        infinite: take every depth as infinite: the directional method.
        alone: light sampling is the only technique, so that it must cover all of the map (no MIS compensation).
    """

    def __init__(
        self, panorama: Panorama, surfaces: TracedSurfaces, infinite: bool = False, alone: bool = False
    ) -> None:
        self.map = MapDistribution(panorama.light_radiance, alone)
        self._shown = self.map if panorama.unclipped is None else MapDistribution(panorama.radiance, alone)
        self.surfaces = surfaces
        self.infinite = infinite
        self._to_world = as_matrix(panorama.rotation)
        self._to_light = as_matrix(panorama.rotation.T)
        self.capture = np.asarray(panorama.position, dtype=np.float64)
        self._capture = as_point(panorama.position)
        self._pixel_angle = math.pi / self.map.height
        self._depth = self._depth_map()
        self._unseen_sky = self._sky_map(panorama)
        self._mirrored: mi.Texture2f | None = None

    def with_surfaces(self, surfaces: TracedSurfaces) -> Photograph:
        """The same photograph, with other meshes of the same surfaces, refined ones for instance."""
        photograph = copy(self)
        photograph.surfaces = surfaces
        return photograph

    def with_mirrored(self, image: NDArray[np.float32]) -> Photograph:
        """The same photograph with the radiance that specular lobes mirror in it.

        Args:
            image: ``S``, radiance that the lobes of real surfaces send to the capture point, shape (h, 2 h, 3), in the
                layout of the panorama.
        """
        photograph = copy(self)
        wrapped = np.concatenate([image[:, -1:], image, image[:, :1]], axis=1)
        photograph._mirrored = mi.Texture2f(mi.TensorXf(np.ascontiguousarray(wrapped)), wrap_mode=dr.WrapMode.Clamp)
        return photograph

    # -- What is seen -------------------------------------------------------------------------------------------

    def from_capture(self, hit: RealHit, direction: mi.Vector3f) -> tuple[mi.Vector3f, mi.Float]:
        """``WTL q / |WTL q|`` and ``|WTL q|``; for sky the direction itself and infinity.

        Args:
            hit: the first real surfaces ``q``.
            direction: of the rays that found them, unit, world.
        """
        offset = hit.point - self._capture
        distance = dr.norm(offset)
        seen = dr.select(hit.valid, mi.Vector3f(offset) * dr.rcp(dr.maximum(distance, 1e-20)), direction)
        return self._to_light @ seen, dr.select(hit.valid, distance, dr.inf)

    def arriving(
        self, ray: mi.Ray3f, hit: RealHit, distance: mi.Float, active: mi.Bool
    ) -> tuple[mi.Color3f, mi.Float, mi.Bool]:
        """``M(q)`` and its density ``p_x(w)``: the theory's eq. (8), 0 where the capture point does not see ``q``."""
        radiance, pdf = self._seen(hit, ray.d, distance, active)
        return radiance, pdf, mi.Bool(False) if self.infinite else hit.valid

    def _seen(
        self, hit: RealHit, direction: mi.Vector3f, distance: mi.Float, active: mi.Bool
    ) -> tuple[mi.Color3f, mi.Float]:
        if self.infinite:
            return self.map.radiance_and_pdf(self._to_light @ direction)
        w0, depth = self.from_capture(hit, direction)
        radiance, pdf = self.map.radiance_and_pdf(w0)
        cosine_capture = dr.abs(dr.dot(hit.normal, self._to_world @ w0))
        cosine_here = dr.abs(dr.dot(hit.normal, direction))
        jacobian = dr.square(distance / depth) * cosine_capture / dr.maximum(cosine_here, 1e-6)
        pdf = dr.select(hit.valid, pdf * jacobian, pdf)
        mapped = self._mapped_depth(w0)
        pdf = dr.select(self._capture_sees(mapped, depth, cosine_capture), pdf, 0.0)
        front = active & hit.valid & (dr.dot(hit.normal, direction) < 0.0)
        radiance = self._with_unseen(radiance, hit, front & self._surely_unseen(mapped, depth, cosine_capture))
        if self._unseen_sky is not None:
            behind = ~hit.valid & dr.isfinite(mapped)
            radiance = dr.select(behind, self._sky_at(direction, active & behind), radiance)
        if self.surfaces.deformed:
            rest = self.surfaces.rest_point(hit, active & hit.valid)
            at_rest = self.map.radiance(self._to_light @ dr.normalize(mi.Vector3f(rest - self._capture)))
            radiance = dr.select(hit.valid, at_rest, radiance)
        return radiance, pdf

    def sharp(self, hit: RealHit, direction: mi.Vector3f) -> mi.Color3f:
        """``M(q)`` as a camera sees it: sharply interpolated, at the rest position of what is deformed."""
        point = dr.select(hit.valid, self.surfaces.rest_point(hit, hit.valid), hit.point)
        seen = dr.select(hit.valid, dr.normalize(mi.Vector3f(point - self._capture)), direction)
        return self._shown.sharp_radiance(self._to_light @ seen)

    def surface_radiance(self, hit: RealHit, active: mi.Bool) -> mi.Color3f:
        """M at points of real surfaces seen from their front, at their rest positions (paper, section 5.8)."""
        _, unseen, radiance = self.sight(mi.Vector3f(self.surfaces.rest_point(hit, active)), hit.normal)
        return self._with_unseen(radiance, hit, active & unseen)

    def mirrored(self, hit: RealHit, active: mi.Bool) -> mi.Color3f:
        """``S`` at points of real surfaces: what of their radiance specular lobes mirror, 0 where it was not estimated."""
        if self._mirrored is None:
            return mi.Color3f(0.0)
        offset = mi.Vector3f(self.surfaces.rest_point(hit, active) - self._capture)
        u, v = direction_to_latlong(self._to_light @ (offset * dr.rcp(dr.maximum(dr.norm(offset), 1e-20))))
        width = self._mirrored.shape[1]
        red, green, blue = self._mirrored.eval(mi.Point2f((u * (width - 2) + 1.0) / width, v), active)
        return mi.Color3f(red, green, blue)

    def look(self, u: mi.Float, v: mi.Float) -> RealHit:
        """The real surfaces that the capture point sees at panorama coordinates in [0, 1]."""
        direction = self._to_world @ latlong_to_direction(u, v)
        return self.surfaces.first_real(mi.Ray3f(mi.Point3f(self._capture), direction), mi.Bool(True))

    def sight(self, point: mi.Vector3f, normal: mi.Vector3f) -> tuple[mi.Bool, mi.Bool, mi.Color3f]:
        """Which real points the capture point sees, which are certainly unseen, and what the photograph shows there.

        Args:
            point: world, metres.
            normal: of the surface there, unit, world.
        """
        offset = point - mi.Vector3f(self._capture)
        depth = dr.norm(offset)
        direction = offset * dr.rcp(dr.maximum(depth, 1e-20))
        w0 = self._to_light @ direction
        cosine, mapped = dr.abs(dr.dot(normal, direction)), self._mapped_depth(w0)
        return (
            self._capture_sees(mapped, depth, cosine),
            self._surely_unseen(mapped, depth, cosine),
            self.map.radiance(w0),
        )

    def _with_unseen(self, photographed: mi.Color3f, hit: RealHit, unseen: mi.Bool) -> mi.Color3f:
        """``photographed``, but where ``unseen`` the recovered radiance of the surface, if there is one."""
        if not self.surfaces.has_unseen_albedo:
            return photographed
        recovered, valid = self.surfaces.unseen_radiance(hit, unseen)
        return dr.select(valid, recovered, photographed)

    # -- Sampling its light -------------------------------------------------------------------------------------

    def presample(self, generator: np.random.Generator, count: int) -> LightSample:
        """Draw directions from the capture point by the map's density, each followed to the first real surface."""
        _, w0 = self.map.sample(count, generator)
        direction = self._to_world @ w0
        radiance, pdf = self.map.radiance_and_pdf(w0)
        if self.infinite or not self.surfaces.has_real:
            position, normal, density = direction, mi.Vector3f(0.0, 0.0, 1.0), pdf
            finite, relit = mi.Bool(False), mi.Bool(False)
        else:
            hit = self.surfaces.first_real(mi.Ray3f(mi.Point3f(self._capture), direction), mi.Bool(True))
            cosine = dr.abs(dr.dot(hit.normal, direction))
            depth = dr.select(hit.valid, hit.distance, dr.inf)
            seen = self._capture_sees(self._mapped_depth(w0), depth, cosine)
            finite, relit = hit.valid, hit.kind == int(FaceKind.RELIT)
            position = dr.select(finite, mi.Vector3f(hit.point), direction)
            normal = hit.normal
            density = dr.select(finite, pdf * cosine / dr.square(hit.distance), pdf) & seen
            if self.surfaces.deformed:
                radiance = dr.select(finite, self.surface_radiance(hit, finite), radiance)
        return LightSample(position, normal, density, radiance, finite, relit, mi.Bool(False))

    # -- Sky behind what the capture point sees -----------------------------------------------------------------

    def _sky_map(self, panorama: Panorama) -> mi.Texture2f | None:
        """The sky in all world directions where some of it may be unseen; else ``None``."""
        if self.infinite or not self.surfaces.has_real:
            return None
        sky = np.isinf(self._depth.numpy()).reshape(self.map.height, self.map.width)
        if sky.all() or not sky.any():
            return None
        step = max(1, self.map.height // SKY_ROWS)  # Of a large panorama, directions of all pixels would not fit.
        row, column = (np.arange(step // 2, size, step) for size in (self.map.height, self.map.width))
        u, v = np.meshgrid((column + 0.5) / self.map.width, (row + 0.5) / self.map.height)
        directions = direction_of_latlong(u, v) @ panorama.rotation.T
        some = np.ix_(row, column)
        found = sky_map(panorama.light_radiance[some], sky[some], directions)
        if found is None:
            return None
        wrapped = np.concatenate([found[:, -1:], found, found[:, :1]], axis=1)
        return mi.Texture2f(mi.TensorXf(np.ascontiguousarray(wrapped)), wrap_mode=dr.WrapMode.Clamp)

    def _sky_at(self, direction: mi.Vector3f, active: mi.Bool) -> mi.Color3f:
        """The sky's radiance in unit directions, world, as far as it can be guessed."""
        assert self._unseen_sky is not None
        u, v = direction_to_latlong(direction)
        columns = self._unseen_sky.shape[1] - 2
        return mi.Color3f(*self._unseen_sky.eval(mi.Point2f((u * columns + 1.0) / (columns + 2.0), v), active))

    # -- The depth of the map -----------------------------------------------------------------------------------

    def _depth_map(self) -> mi.Float:
        """``z(w)`` at the pixels' centres, metres, inf for sky."""
        if self.infinite or not self.surfaces.has_real:
            return mi.Float(dr.inf)
        depth = aligned_empty((self.map.height, self.map.width))
        for band in bands(self.map.width, self.map.height):
            u, v = (band.column + 0.5) / self.map.width, (band.row + 0.5) / self.map.height
            ray = mi.Ray3f(mi.Point3f(self._capture), self._to_world @ latlong_to_direction(u, v))
            found = first_hit(self.surfaces.real, ray, coherent=True)
            depth[band.rows] = dr.select(found.is_valid(), found.t, dr.inf).numpy().reshape(band.shape)
        return mi.Float(depth.reshape(-1))

    def _mapped_depth(self, w0: mi.Vector3f) -> mi.Float:
        """``z(w0)`` of unit directions in light space, metres, inf for sky."""
        if self.infinite or not self.surfaces.has_real:
            return mi.Float(dr.inf)
        return dr.gather(mi.Float, self._depth, self.map.pixel(w0))

    def _capture_sees(self, mapped: mi.Float, depth: mi.Float, cosine: mi.Float) -> mi.Bool:
        """Whether the capture point sees a point, as shadow maps decide it: by the depth of the map in its direction.

        Args:
            mapped: that depth, metres, inf for sky.
            depth: the point's distance from the capture point, metres, inf for sky.
            cosine: between the direction and the surface's normal; slanted surfaces change depth within a pixel.
        """
        if self.infinite or not self.surfaces.has_real:
            return mi.Bool(True)
        tolerance = DEPTH_TOLERANCE + self._pixel_angle / dr.maximum(cosine, 0.05)
        both_sky = dr.isinf(mapped) & dr.isinf(depth)
        return both_sky | (dr.abs(depth - mapped) <= tolerance * mapped)

    def _surely_unseen(self, mapped: mi.Float, depth: mi.Float, cosine: mi.Float) -> mi.Bool:
        """Whether a point is certainly unseen: the surface that the map shows there is well off the plane of the point.

        By the distance from the plane, since on slanted surfaces, and between the bumps of a scan, depth alone varies
        within a pixel by any amount. Never true where :meth:`_capture_sees` is; the arguments are the same.
        """
        return (depth - mapped) * cosine > (DEPTH_TOLERANCE + CLEARLY_BEFORE * self._pixel_angle) * depth
