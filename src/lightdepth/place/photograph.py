"""A photograph: the radiance of the place that it gives, seen from anywhere, and the sampling of its light.

Equations: docs/theory.md, sections 2 and 3. The paper's ``M(w, z)`` of section 4, its eq. 4 (a real point's radiance is
read from the map in the direction from the capture point), and section 5.6 (lights at their real positions), with
the change of measure that the paper leaves out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from copy import copy

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import minimum_filter

from lightdepth.directions import latlong_to_direction as direction_of_latlong
from lightdepth.kernel.arrays import aligned_empty
from lightdepth.kernel.row_bands import bands
from lightdepth.kernel.tracing import first_hit
from lightdepth.kernel.variables import as_matrix, as_point
from lightdepth.parameters.place import DEFAULT, PlaceParameters
from lightdepth.place.feather import edge_feather, mask_feather
from lightdepth.place.light_list import LightSample
from lightdepth.place.map_distribution import MapDistribution, direction_to_latlong, latlong_to_direction
from lightdepth.place.photograph_weights import Sighting
from lightdepth.place.photographed import Photographed
from lightdepth.place.real_surfaces import FaceKind
from lightdepth.place.traced_surfaces import RealHit, TracedSurfaces
from lightdepth.place.unseen_sky import sky_map
from lightdepth.scene.model import Panorama


class Photograph(Photographed):
    """A panorama, both as the appearance of the place and as a light: everything that depends on one capture point.

    Args:
        panorama: the photograph and its pose.
        surfaces: the real surfaces to trace.
        infinite: take every depth as infinite: the directional method.
        alone: light sampling is the only technique, so that it must cover all of the map (no MIS compensation).
        gain: of each channel; ``None`` is 1.
        parameters: what it is taken to see, how it is feathered, and how unseen sky is guessed.

    Attributes:
        map: its radiance as light.
        capture: its capture point, shape (3,), world, metres.
    """

    def __init__(
        self,
        panorama: Panorama,
        surfaces: TracedSurfaces,
        infinite: bool = False,
        alone: bool = False,
        gain: NDArray[np.float32] | None = None,
        parameters: PlaceParameters = DEFAULT,
    ) -> None:
        self._gain, self._parameters = gain, parameters
        self.map = MapDistribution(self._scaled(panorama.light_radiance), alone, parameters=parameters)
        self._shown = self.map
        if panorama.unclipped is not None or panorama.plate is not None:
            self._shown = MapDistribution(self._scaled(panorama.shown_radiance), alone, parameters=parameters)
        # The picture gives the albedo, but for what it clipped.
        self._reflecting = self.map if panorama.plate is None else self._shown
        self.surfaces = surfaces
        self.infinite = infinite
        self._to_world = as_matrix(panorama.rotation)
        self._to_light = as_matrix(panorama.rotation.T)
        self._position = np.asarray(panorama.position, dtype=np.float64)
        self._capture = as_point(panorama.position)
        self._pixel_angle = math.pi / self.map.height
        self._off_plane = parameters.seen_depth + parameters.off_plane * self._pixel_angle
        self._depth, self._stays = self._depth_maps()
        self._unseen_sky = self._sky_map(panorama)
        self._mirrored: mi.Texture2f | None = None
        self._clarity: mi.Texture2f | None = None

    @property
    def each(self) -> tuple[Photograph, ...]:  # type: ignore[override]
        """This one."""
        return (self,)

    @property
    def capture(self) -> NDArray[np.float64]:
        """See the base class."""
        return self._position

    def _scaled(self, radiance: NDArray[np.float32]) -> NDArray[np.float32]:
        return radiance if self._gain is None else radiance * self._gain

    def with_surfaces(self, surfaces: TracedSurfaces) -> Photograph:
        """See the base class."""
        photograph = copy(self)
        photograph.surfaces = surfaces
        return photograph

    def with_mirrored(self, images: Sequence[NDArray[np.float32]]) -> Photograph:
        """See the base class."""
        photograph = copy(self)
        photograph._mirrored = _texture(images[0])
        return photograph

    def beside_others(self, panorama: Panorama) -> Photograph:
        """The same photograph, prepared for weighting against others of the place.

        Args:
            panorama: that it was made from.
        """
        photograph = copy(self)
        shape = self.map.height, self.map.width
        clarity = np.ones((*shape, 2), np.float32)
        if self.surfaces.has_real:
            clarity[..., 0] = edge_feather(self._depth.numpy().reshape(shape), self._parameters)
        counts = np.ones(shape, np.float32) if panorama.mask is None else panorama.mask
        if panorama.depth is not None and self.surfaces.has_real:
            counts = counts * self._modelled(panorama.depth)
        if not (counts == 1.0).all():
            clarity[..., 1] = mask_feather(counts, self._parameters)
        photograph._clarity = _texture(clarity)
        return photograph

    def _modelled(self, measured: NDArray[np.float32]) -> NDArray[np.bool_]:
        """Pixels in which the distance that the user gave says that nothing else stood before the model's surface."""
        rows = (np.arange(self.map.height) * len(measured)) // self.map.height
        columns = (np.arange(self.map.width) * measured.shape[1]) // self.map.width
        modelled = self._depth.numpy().reshape(self.map.height, self.map.width)
        before = self._parameters.measured_before * modelled
        return np.asarray(measured[np.ix_(rows, columns)] > before) | np.isinf(modelled)

    def declared(self, panorama: Panorama) -> mi.Texture2f | None:
        """1 where the scene declares the radiance of sources that this panorama clipped; ``None`` where it does not."""
        if panorama.unclipped is None:
            return None
        return _texture(np.any(panorama.unclipped != panorama.radiance, axis=2, keepdims=True).astype(np.float32))

    def with_importance(self, panorama: Panorama, importance: NDArray[np.float32], alone: bool) -> Photograph:
        """The same photograph, whose light is sampled in proportion to an importance of its pixels as well.

        Args:
            panorama: that it was made from.
            importance: shape (height, 2 height), not negative.
            alone: as for the class.
        """
        photograph = copy(self)
        photograph.map = MapDistribution(self._scaled(panorama.light_radiance), alone, importance, self._parameters)
        photograph._shown = photograph.map if self._shown is self.map else self._shown
        photograph._reflecting = photograph.map if self._reflecting is self.map else self._reflecting
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
        self, ray: mi.Ray3f, hit: RealHit, distance: mi.Float, active: mi.Bool, kept: mi.Bool | bool = False
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
        mapped = self._mapped_depth(w0, depth)
        pdf = dr.select(self._capture_sees(mapped, depth, cosine_capture), pdf, 0.0)
        front = active & hit.valid & (dr.dot(hit.normal, direction) < 0.0)
        radiance = self._with_unseen(radiance, hit, front & self._surely_unseen(mapped, depth, cosine_capture))
        if self._unseen_sky is not None:
            behind = ~hit.valid & dr.isfinite(mapped)
            radiance = dr.select(behind, self.sky_at(direction, active & behind), radiance)
        if self.surfaces.deformed:
            rest = self.surfaces.rest_point(hit, active & hit.valid)
            at_rest = self.map.radiance(self._to_light @ dr.normalize(mi.Vector3f(rest - self._capture)))
            radiance = dr.select(hit.valid, at_rest, radiance)
        return radiance, pdf

    def sharp(self, hit: RealHit, ray: mi.Ray3f) -> mi.Color3f:
        """See the base class."""
        point = dr.select(hit.valid, self.surfaces.rest_point(hit, hit.valid), hit.point)
        seen = dr.select(hit.valid, dr.normalize(mi.Vector3f(point - self._capture)), ray.d)
        return self.sharp_at(self._to_light @ seen)

    def shares(self, hit: RealHit, ray: mi.Ray3f) -> list[mi.Float]:
        """See the base class."""
        _, unseen, _ = self.sight(mi.Vector3f(hit.point), hit.normal)
        return [mi.Float(dr.select(hit.valid & unseen, 0.0, 1.0))]

    def sharp_at(self, direction: mi.Vector3f) -> mi.Color3f:
        """The picture in unit directions, light space, sharply interpolated."""
        return self._shown.sharp_radiance(direction)

    def sharp_of(self, sighting: Sighting, point: mi.Vector3f, normal: mi.Vector3f, finite: mi.Bool) -> mi.Color3f:
        """The picture of points, sharply interpolated from pixels that show their surface and not its neighbours.

        Args:
            sighting: of the points.
            point: world, metres.
            normal: of the surface there, either side, unit, world.
            finite: false for sky.
        """
        offset = point - mi.Vector3f(self._capture)
        height = dr.dot(normal, offset)
        allowed = self._off_plane * dr.norm(offset)

        def belongs(direction: mi.Vector3f, index: mi.UInt32) -> mi.Bool:
            depth = dr.gather(mi.Float, self._depth, index)
            is_finite = dr.isfinite(depth)
            beside = dr.abs(dr.select(is_finite, depth, 0.0) * dr.dot(normal, self._to_world @ direction) - height)
            return dr.select(finite, is_finite & (beside <= allowed), ~is_finite)

        if not self.surfaces.has_real:
            return self.sharp_at(sighting.direction)
        return self._shown.sharp_radiance_of(sighting.direction, belongs)

    def picture_at(self, direction: mi.Vector3f) -> mi.Color3f:
        """The picture in unit directions, light space, as the albedo is recovered from it."""
        return self._reflecting.radiance(direction)

    def surface_radiance(self, hit: RealHit, direction: mi.Vector3f, active: mi.Bool) -> mi.Color3f:
        """See the base class; the direction is not used."""
        _, unseen, radiance = self.sight(mi.Vector3f(self.surfaces.rest_point(hit, active)), hit.normal)
        return self._with_unseen(radiance, hit, active & unseen)

    def mirrored(self, hit: RealHit, direction: mi.Vector3f, active: mi.Bool) -> mi.Color3f:
        """See the base class; the direction is not used."""
        if self._mirrored is None:
            return mi.Color3f(0.0)
        offset = mi.Vector3f(self.surfaces.rest_point(hit, active) - self._capture)
        return self.mirrored_at(self._to_light @ (offset * dr.rcp(dr.maximum(dr.norm(offset), 1e-20))), active)

    def mirrored_at(self, direction: mi.Vector3f, active: mi.Bool) -> mi.Color3f:
        """``S`` in unit directions, light space."""
        if self._mirrored is None:
            return mi.Color3f(0.0)
        red, green, blue = looked_up(self._mirrored, direction, active)
        return mi.Color3f(red, green, blue)

    def look(self, u: mi.Float, v: mi.Float) -> RealHit:
        """The real surfaces that the capture point sees at panorama coordinates in [0, 1]."""
        return self.look_along(u, v)[0]

    def look_along(self, u: mi.Float, v: mi.Float) -> tuple[RealHit, mi.Vector3f]:
        """The same, and the unit directions, world."""
        direction = self._to_world @ latlong_to_direction(u, v)
        return self.surfaces.first_real(mi.Ray3f(mi.Point3f(self._capture), direction), mi.Bool(True)), direction

    def sight(self, point: mi.Vector3f, normal: mi.Vector3f) -> tuple[mi.Bool, mi.Bool, mi.Color3f]:
        """See the base class."""
        offset = point - mi.Vector3f(self._capture)
        depth = dr.norm(offset)
        direction = offset * dr.rcp(dr.maximum(depth, 1e-20))
        w0 = self._to_light @ direction
        cosine, mapped = dr.abs(dr.dot(normal, direction)), self._mapped_depth(w0, depth)
        return (
            self._capture_sees(mapped, depth, cosine),
            self._surely_unseen(mapped, depth, cosine),
            self._reflecting.radiance(w0),
        )

    def shares_at(self, point: mi.Vector3f, normal: mi.Vector3f) -> list[NDArray[np.float32]]:
        """See the base class."""
        return [np.ones(dr.width(point), np.float32)]

    def surface_shares(self, hit: RealHit, direction: mi.Vector3f, active: mi.Bool) -> list[NDArray[np.float32]]:
        """See the base class."""
        return [np.ones(dr.width(hit.point), np.float32)]

    def faced(self, points: NDArray[np.float32], normals: NDArray[np.float32]) -> NDArray[np.bool_]:
        """See the base class."""
        return np.asarray(np.einsum("ij,ij->i", normals, points - self.capture) < 0.0)

    def sighting(
        self, point: mi.Vector3f, normal: mi.Vector3f, finite: mi.Bool, direction: mi.Vector3f, active: mi.Bool
    ) -> Sighting:
        """How this photograph sees points.

        Args:
            point: world, metres.
            normal: of the surface there, either side, unit, world.
            finite: false for sky.
            direction: of the sky, unit, world.
            active: lanes to evaluate.
        """
        offset = point - mi.Vector3f(self._capture)
        distance = dr.norm(offset)
        toward = dr.select(finite, offset * dr.rcp(dr.maximum(distance, 1e-20)), direction)
        cosine = dr.abs(dr.dot(normal, toward))
        w0, depth = self._to_light @ toward, dr.select(finite, distance, dr.inf)
        mapped = self._mapped_depth(w0, depth)
        solid_angle = dr.select(finite, cosine * dr.rcp(dr.maximum(dr.square(distance), 1e-12)), 1.0)
        clarity, counts = mi.Float(1.0), mi.Float(1.0)
        if self._clarity is not None:
            clarity, counts = looked_up(self._clarity, w0, active)
        clarity *= self._around_on_surface(w0, finite, depth, cosine)
        return Sighting(
            toward,
            w0,
            solid_angle,
            solid_angle * (1.0 / self._pixel_angle**2),
            self._capture_sees(mapped, depth, cosine),
            dr.select(finite, self._surely_unseen(mapped, depth, cosine), dr.isfinite(mapped)),
            clarity,
            counts,
        )

    def _with_unseen(self, photographed: mi.Color3f, hit: RealHit, unseen: mi.Bool) -> mi.Color3f:
        """``photographed``, but where ``unseen`` the recovered radiance of the surface, if there is one."""
        if not self.surfaces.has_unseen_albedo:
            return photographed
        recovered, valid = self.surfaces.unseen_radiance(hit, unseen)
        return dr.select(valid, recovered, photographed)

    # -- Sampling its light -------------------------------------------------------------------------------------

    def drawn(self, generator: np.random.Generator, count: int) -> tuple[mi.Vector3f, mi.Vector3f]:
        """Unit directions from the capture point by the map's density: in world and in light space."""
        _, w0 = self.map.sample(count, generator)
        return self._to_world @ w0, w0

    def presample(self, generator: np.random.Generator, count: int) -> LightSample:
        """Directions from the capture point by the map's density, each followed to the first real surface."""
        direction, w0 = self.drawn(generator, count)
        radiance, pdf = self.map.radiance_and_pdf(w0)
        if self.infinite or not self.surfaces.has_real:
            position, normal, density = direction, mi.Vector3f(0.0, 0.0, 1.0), pdf
            finite, relit = mi.Bool(False), mi.Bool(False)
        else:
            hit = self.surfaces.first_real(mi.Ray3f(mi.Point3f(self._capture), direction), mi.Bool(True))
            cosine = dr.abs(dr.dot(hit.normal, direction))
            depth = dr.select(hit.valid, hit.distance, dr.inf)
            seen = self._capture_sees(self._mapped_depth(w0, depth), depth, cosine)
            finite, relit = hit.valid, self.surfaces.leaves_with_objects(hit)
            position = dr.select(finite, mi.Vector3f(hit.point), direction)
            normal = hit.normal
            density = dr.select(finite, pdf * cosine / dr.square(hit.distance), pdf) & seen
            if self.surfaces.deformed:
                radiance = dr.select(finite, self.surface_radiance(hit, direction, finite), radiance)
        return LightSample(position, normal, density, radiance, finite, relit, mi.UInt32(0))

    # -- Sky behind what the capture point sees -----------------------------------------------------------------

    def _sky_map(self, panorama: Panorama) -> mi.Texture2f | None:
        """The sky in all world directions where some of it may be unseen; else ``None``."""
        if self.infinite or not self.surfaces.has_real:
            return None
        sky = np.isinf(self._depth.numpy()).reshape(self.map.height, self.map.width)
        if sky.all() or not sky.any():
            return None
        # Of a large panorama, directions of all pixels would not fit.
        step = max(1, self.map.height // self._parameters.most_sky_rows)
        row, column = (np.arange(step // 2, size, step) for size in (self.map.height, self.map.width))
        u, v = np.meshgrid((column + 0.5) / self.map.width, (row + 0.5) / self.map.height)
        directions = direction_of_latlong(u, v) @ panorama.rotation.T
        some = np.ix_(row, column)
        found = sky_map(self._scaled(panorama.light_radiance[some]), sky[some], directions, self._parameters)
        if found is None:
            return None
        return _texture(found)

    @property
    def has_unseen_sky(self) -> bool:
        """Whether there is sky that this photograph does not see, and some that it does."""
        return self._unseen_sky is not None

    def sky_at(self, direction: mi.Vector3f, active: mi.Bool) -> mi.Color3f:
        """The sky's radiance in unit directions, world, as far as it can be guessed."""
        assert self._unseen_sky is not None
        return mi.Color3f(*looked_up(self._unseen_sky, direction, active))

    # -- The depth of the map -----------------------------------------------------------------------------------

    def _depth_maps(self) -> tuple[mi.Float, mi.Float | None]:
        """``z(w)`` at the pixels' centres, metres, inf for sky; and the depth of what stays where they show what goes.

        The second is 0 elsewhere, and ``None`` where nothing is removed.
        """
        if self.infinite or not self.surfaces.has_real:
            return mi.Float(dr.inf), None
        depth = aligned_empty((self.map.height, self.map.width))
        removed, stays = np.zeros(depth.shape, bool), aligned_empty(depth.shape)
        for band in bands(self.map.width, self.map.height):
            u, v = (band.column + 0.5) / self.map.width, (band.row + 0.5) / self.map.height
            ray = mi.Ray3f(mi.Point3f(self._capture), self._to_world @ latlong_to_direction(u, v))
            found = first_hit(self.surfaces.real, ray, coherent=True)
            depth[band.rows] = dr.select(found.is_valid(), found.t, dr.inf).numpy().reshape(band.shape)
            if self.surfaces.has_removed:
                hit = self.surfaces.real_hit(ray, found, found.is_valid())
                removed[band.rows] = (hit.kind == int(FaceKind.REMOVED)).numpy().reshape(band.shape)
                kept = first_hit(self.surfaces.kept, ray, coherent=True)
                stays[band.rows] = dr.select(kept.is_valid(), kept.t, dr.inf).numpy().reshape(band.shape)
        if not removed.any():
            return mi.Float(depth.reshape(-1)), None
        # The pixels around it show some of it too, but for what stands well before it.
        around = np.where(removed, depth, np.float32(np.inf))
        around = minimum_filter(around, 2 * self._parameters.removed_rim + 1, mode=("nearest", "wrap"))
        mixed = depth > self._parameters.measured_before * around
        depth[...] = np.where(mixed & ~removed, around, depth)
        stays[~mixed] = 0.0
        return mi.Float(depth.reshape(-1)), mi.Float(stays.reshape(-1))

    def _mapped_depth(self, w0: mi.Vector3f, depth: mi.Float) -> mi.Float:
        """``z(w0)`` of unit directions in light space, metres, inf for sky; 0 where what is removed hides a point.

        Near its foot its depth and that of the floor are nearly the same.

        Args:
            w0: the directions.
            depth: of the points in them, metres.
        """
        if self.infinite or not self.surfaces.has_real:
            return mi.Float(dr.inf)
        return self._depth_for(self.map.pixel(w0), depth)

    def _depth_for(self, pixel: mi.UInt32, depth: mi.Float) -> mi.Float:
        """The same of pixels."""
        mapped = dr.gather(mi.Float, self._depth, pixel)
        if self._stays is None:
            return mapped
        stays = dr.gather(mi.Float, self._stays, pixel)
        hidden = (stays > 0.0) & (dr.abs(depth - stays) < self._parameters.removed_depth * dr.abs(depth - mapped))
        return dr.select(hidden, 0.0, mapped)

    def _capture_sees(self, mapped: mi.Float, depth: mi.Float, cosine: mi.Float) -> mi.Bool:
        """Whether the capture point sees a point, as with shadow maps: by the depth of the map in its direction.

        Args:
            mapped: that depth, metres, inf for sky.
            depth: the point's distance from the capture point, metres, inf for sky.
            cosine: between the direction and the surface's normal; slanted surfaces change depth within a pixel.
        """
        if self.infinite or not self.surfaces.has_real:
            return mi.Bool(True)
        tolerance = self._parameters.seen_depth + self._pixel_angle / dr.maximum(cosine, self._parameters.grazing)
        both_sky = dr.isinf(mapped) & dr.isinf(depth)
        return both_sky | (dr.abs(depth - mapped) <= tolerance * mapped)

    def _around_on_surface(self, w0: mi.Vector3f, finite: mi.Bool, depth: mi.Float, cosine: mi.Float) -> mi.Float:
        """The largest :meth:`_on_surface` of the four pixels around directions: at silhouettes one alone may miss."""
        result = mi.Float(0.0)
        if not self.surfaces.has_real:
            return mi.Float(1.0)
        for index in self.map.pixels_around(w0):
            mapped = self._depth_for(index, depth)
            sky = dr.select(dr.isinf(mapped), 1.0, 0.0)
            result = dr.maximum(result, dr.select(finite, self._on_surface(mapped, depth, cosine), sky))
        return result

    def _on_surface(self, mapped: mi.Float, depth: mi.Float, cosine: mi.Float) -> mi.Float:
        """Fades from 1 to 0 as points leave the surface that the map shows; 0 where :meth:`_surely_unseen` is true."""
        allowed = self._off_plane * depth
        off = dr.select(dr.isfinite(mapped), dr.abs(depth - mapped) * cosine / allowed, 2.0)
        t = dr.clip(2.0 - 2.0 * off, 0.0, 1.0)
        return t * t * (3.0 - 2.0 * t)

    def _surely_unseen(self, mapped: mi.Float, depth: mi.Float, cosine: mi.Float) -> mi.Bool:
        """Whether a point is certainly unseen: the surface that the map shows there is well off the plane of the point.

        By the distance from the plane, since on slanted surfaces, and between the bumps of a scan, depth alone varies
        within a pixel by any amount. Never true where :meth:`_capture_sees` is; the arguments are the same.
        """
        return (depth - mapped) * cosine > self._off_plane * depth


def _texture(image: NDArray[np.float32]) -> mi.Texture2f:
    """An image in the layout of a panorama, for lookups across its seam; shape (h, 2 h, channels)."""
    wrapped = np.concatenate([image[:, -1:], image, image[:, :1]], axis=1)
    return mi.Texture2f(mi.TensorXf(np.ascontiguousarray(wrapped)), wrap_mode=dr.WrapMode.Clamp)


def looked_up(texture: mi.Texture2f, direction: mi.Vector3f, active: mi.Bool) -> list[mi.Float]:
    """Channels of such an image in unit directions, light space."""
    u, v = direction_to_latlong(direction)
    width = texture.shape[1]
    return list(texture.eval(mi.Point2f((u * (width - 2) + 1.0) / width, v), active))
