"""ENVPath: the integrator of the paper, by its algorithms 1 and 2 and its table 1.

A support point is not changed but re-rendered, by an estimator that converges to the photograph where nothing new is
near (paper, eq. 5 and 6). Where the printed equations do not close, docs/theory.md ("envpath") says what is done instead;
the numbers in brackets below refer to its list of deviations.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from lightdepth.directions import pixel_solid_angles
from lightdepth.kernel.tracing import first_hit, interaction, meets
from lightdepth.kernel.variables import as_matrix, as_point
from lightdepth.lightmap.building import build_light_depth_map
from lightdepth.lightmap.median_cut import LUMINANCE, median_cut
from lightdepth.parameters.transport import DEFAULT, TransportParameters
from lightdepth.place.light_list import LightList
from lightdepth.place.object_bounds import ObjectBounds
from lightdepth.place.place import Place
from lightdepth.place.real_surfaces import FaceKind, RealSurfaces
from lightdepth.place.traced_surfaces import TracedSurfaces, leave, shadow_ray
from lightdepth.scene.meshes.geometry import face_normals
from lightdepth.scene.model import Panorama, Scene
from lightdepth.transport.integrator import CameraSamples, Integrator, Path
from lightdepth.transport.radiance_cache import RadianceCache


def support_with_scale_factors(scene: Scene, surfaces: RealSurfaces) -> RealSurfaces:
    """The real surfaces with ``ES`` (paper, eq. 8) in all channels of ``irradiance``.

    Args:
        scene: for its light-depth map.
        surfaces: as modelled; support faces are cut and turned toward the capture point.
    """
    import trimesh  # It takes longer to import than all else that renders.

    chosen = surfaces.receiving
    if not chosen.any():
        return surfaces
    parameters = scene.render.parameters.transport
    light_depth_map = build_light_depth_map(scene)
    lights = median_cut(scene.panorama.light_radiance, light_depth_map.depth, parameters.envpath_lights)
    vertices, faces, parent = trimesh.remesh.subdivide_to_size(
        surfaces.vertices[surfaces.faces[chosen]].reshape(-1, 3),
        np.arange(3 * int(chosen.sum())).reshape(-1, 3),
        parameters.envpath_longest_edge,
        max_iter=20,
        return_index=True,
    )
    vertices = vertices.astype(np.float32)
    normals = face_normals(vertices, faces)
    away = np.einsum("ij,ij->i", normals, vertices[faces[:, 0]] - scene.panorama.position) > 0.0
    faces = np.where(away[:, None], faces[:, ::-1], faces)
    # Every face has vertices of its own: the scale factor jumps where the normal does.
    corners = vertices[faces].reshape(-1, 3)
    corner_normals = np.repeat(np.where(away[:, None], -normals, normals), 3, axis=0)
    factors = _scale_factors(
        corners,
        corner_normals,
        scene.panorama,
        lights.position,
        lights.direction,
        lights.power,
        parameters.envpath_smallest_share,
    )
    offset = len(surfaces.vertices)
    own_nodes = len(surfaces.irradiance) + 3 * np.arange(len(faces))
    return replace(
        surfaces,
        vertices=np.concatenate([surfaces.vertices, corners]),
        rest=np.concatenate([surfaces.rest, corners]),
        divisions=np.concatenate([surfaces.divisions[~chosen], np.ones(len(faces), np.uint32)]),
        first_node=np.concatenate([surfaces.first_node[~chosen], own_nodes]).astype(np.uint32),
        irradiance=np.repeat(np.concatenate([[0.0, 0.0, 0.0], factors])[:, None], 3, axis=1).astype(np.float32),
        faces=np.concatenate(
            [surfaces.faces[~chosen], np.arange(len(corners), dtype=np.int32).reshape(-1, 3) + offset]
        ),
        kind=np.concatenate([surfaces.kind[~chosen], np.full(len(faces), FaceKind.SUPPORT, np.uint32)]),
        gloss=np.concatenate([surfaces.gloss[~chosen], surfaces.gloss[chosen][parent]]),
        unseen_albedo=np.concatenate([surfaces.unseen_albedo[~chosen], surfaces.unseen_albedo[chosen][parent]]),
    )


def _scale_factors(
    points: NDArray[np.float32],
    normals: NDArray[np.float32],
    panorama: Panorama,
    positions: NDArray[np.float64],
    directions: NDArray[np.float64],
    powers: NDArray[np.float64],
    smallest_share: float,
) -> NDArray[np.float64]:
    """``ES(p, n)`` of eq. 8 at points of support surfaces, shape (n,).

    Args:
        points: world, metres, shape (n, 3).
        normals: unit, shape (n, 3).
        panorama: for its pose.
        positions: of the lights, light space, metres, shape (k, 3); not finite where the light is sky.
        directions: of the lights from the capture point, light space, shape (k, 3).
        powers: of the lights, RGB, shape (k, 3).
        smallest_share: smallest denominator, as a share of the numerator.
    """
    power = powers @ LUMINANCE
    facing = np.zeros(len(points))
    for position, direction, weight in zip(positions, directions, power, strict=True):
        if np.isfinite(position).all():
            toward = panorama.rotation @ position + panorama.position - points
            toward /= np.maximum(np.linalg.norm(toward, axis=1, keepdims=True), 1e-9)
        else:
            toward = np.broadcast_to(panorama.rotation @ direction, points.shape)
        facing += weight * np.maximum(np.einsum("ij,ij->i", toward, normals), 0.0)
    total = power.sum()
    return total / np.maximum(facing, smallest_share * total)


@dataclass
class EnvpathPath(Path):
    """Paths of algorithm 1.

    Attributes:
        photograph: what the support surface that the camera sees sent before.
        synthetic_path: ``pt``: which met a new surface last.
        previous: where they scattered last, world, metres.
        previous_pdf: of that direction, per steradian; 0 where light sampling could not draw it.
    """

    photograph: mi.Color3f
    synthetic_path: mi.Bool
    previous: mi.Point3f
    previous_pdf: mi.Float


class EnvpathIntegrator(Integrator[EnvpathPath]):
    """The paper's method.

    Args:
        place: the photographed place.
        surfaces: real and synthetic surfaces; the support's irradiance holds its scale factors.
        panorama: the photograph.
        bounds: the objects' bounds, or ``None`` without objects.
        max_bounces: ``MaxLength`` of algorithm 1, in scatterings; negative for no limit.
        parameters: how paths are followed.
    """

    def __init__(
        self,
        place: Place,
        surfaces: TracedSurfaces,
        panorama: Panorama,
        bounds: ObjectBounds | None = None,
        max_bounces: int = 8,
        parameters: TransportParameters = DEFAULT,
    ) -> None:
        super().__init__(place, surfaces, bounds, max_bounces)
        self.parameters = parameters
        self._capture = mi.Vector3f(as_point(panorama.position))
        self._to_light = as_matrix(panorama.rotation.T)
        angles = pixel_solid_angles(*panorama.radiance.shape[:2])
        light = panorama.light_radiance
        total = float((light.mean(axis=1) @ LUMINANCE) @ angles * light.shape[1])
        self.total_luminance = dr.opaque(mi.Float, total)

    def begin(self, path: Path) -> EnvpathPath:
        """See the base class."""
        return EnvpathPath(
            **vars(path),
            photograph=mi.Color3f(0.0),
            synthetic_path=mi.Bool(False),
            previous=mi.Point3f(path.ray.o),
            previous_pdf=mi.Float(0.0),
        )

    def samples(self, path: EnvpathPath) -> CameraSamples:
        """See the base class."""
        # The film adds the plate; what the support point sends now less what it sent before is the change.
        change = dr.select(path.covered, 0.0, path.radiance - path.photograph)
        return CameraSamples(change, dr.select(path.covered, path.radiance, 0.0), mi.Bool(path.covered))

    def advance(self, path: EnvpathPath, lights: LightList, cache: RadianceCache | None) -> EnvpathPath:
        """The body of algorithm 1."""
        sampler, ray, active = path.sampler, mi.Ray3f(path.ray), mi.Bool(path.active)
        radiance, throughput = mi.Color3f(path.radiance), mi.Color3f(path.throughput)
        first, covered, depth = mi.Bool(path.first), mi.Bool(path.covered), mi.UInt32(path.depth)
        photograph, synthetic_path = mi.Color3f(path.photograph), mi.Bool(path.synthetic_path)
        previous, previous_pdf = path.previous, path.previous_pdf
        context = mi.BSDFContext()

        found = first_hit(self.surfaces.all, ray, active=active)
        on_real = active & self.surfaces.is_real(found)
        on_synthetic = active & found.is_valid() & ~on_real
        hit = self.surfaces.real_hit(ray, found, on_real)
        on_support = on_real & self.surfaces.receives(hit) & (dr.dot(hit.normal, ray.d) < 0.0)
        on_environment = active & ~on_synthetic & ~on_support
        si = interaction(self.surfaces.all, found, ray, on_synthetic)

        # Lines 8 to 11, eq. 4. At i = 0 this is the plate, which the film has already.
        ((seen, map_pdf, _),) = self.place.arriving(ray, hit, dr.norm(hit.point - previous), on_environment)
        arrived = on_environment & synthetic_path
        weight = dr.select(previous_pdf > 0.0, previous_pdf / (previous_pdf + map_pdf), 1.0)  # (4)
        radiance += dr.select(arrived, throughput * seen * weight, 0.0)
        active &= ~on_environment

        # Lines 12 and 13; ``pt`` is of the last vertex (5).
        direct_support = on_support & (synthetic_path | first)
        synthetic_path = mi.Bool(on_synthetic)
        covered |= first & on_synthetic
        if self.has_emitters:
            emitter = si.emitter(self.surfaces.emitting, on_synthetic)
            shines = on_synthetic & (emitter != None)  # noqa: E711 - a comparison of pointers, lane by lane
            radiance += dr.select(shines, throughput * emitter.eval(si, shines), 0.0)  # (7)
        active &= depth < self.max_bounces
        on_support &= active
        on_synthetic &= active

        # Line 16: algorithm 2.
        point = dr.select(on_synthetic, si.p, hit.point)
        normal = dr.select(on_synthetic, mi.Vector3f(si.n), hit.normal)
        materials = self.surfaces.materials
        material = materials.index(si, on_synthetic)
        own = self.place.photograph.surface_radiance(hit, path.ray.d, on_support)
        factor = self.surfaces.irradiance(hit, on_support).x
        photograph = dr.select(first & on_support, own, photograph)
        direct_support &= active
        u = dr.select(first, sampler.stratified("light")[0], sampler.next_1d(active))
        light = lights.sample(u, active)
        direction, distance, pdf = self.place.toward(light, point)

        # Eq. 5 with the luminance that eq. 7 weights by (1); light and measure are those of the capture point (2).
        from_capture = dr.select(light.finite, dr.normalize(light.position - self._capture), light.position)
        light_direction = self._to_light @ from_capture
        light_radiance, light_pdf = self.place.photograph.each[0].map.radiance_and_pdf(light_direction)
        share = _luminance(light_radiance) / (self.total_luminance * dr.maximum(light_pdf, 1e-20))
        cosine = dr.maximum(dr.dot(direction, hit.normal), 0.0)
        value_support = own * (factor * cosine * share)
        # Eq. 3, with the density that the light has as seen from the point (4).
        value, bsdf_pdf = materials.eval_pdf(material, context, si, si.to_local(direction), on_synthetic)
        value *= light.radiance / dr.maximum(pdf + bsdf_pdf, 1e-20)
        useful = (direct_support & (light_pdf > 0.0)) | (on_synthetic & (pdf > 0.0))
        toward_light = shadow_ray(point, normal, direction, distance)
        blocked = meets(self.surfaces.synthetic, toward_light, useful)
        # Table 1: from synthetic points, what lies on support or behind it comes along sampled paths.
        beyond = leave(point, normal, direction)
        behind = self.surfaces.first_real(beyond, useful & on_synthetic & ~blocked)
        blocked |= on_synthetic & behind.valid & self.surfaces.receives(behind)
        value = dr.select(on_synthetic, value, value_support)
        radiance += dr.select(useful & ~blocked, throughput * value, 0.0)

        # Lines 18 to 26.
        choice, x, y = sampler.direction(first, active)
        position = mi.Point2f(x, y)
        drawn, weight_bsdf = materials.sample(material, context, si, choice, position, on_synthetic)
        support_direction = mi.Frame3f(hit.normal).to_world(mi.warp.square_to_cosine_hemisphere(position))
        direction = dr.select(on_synthetic, si.to_world(drawn.wo), support_direction)
        attenuation = dr.minimum(own * (factor * dr.pi / self.total_luminance), 1.0)  # (3)
        throughput *= dr.select(on_synthetic, weight_bsdf, attenuation)
        smooth = mi.has_flag(drawn.sampled_type, mi.BSDFFlags.Delta)
        # Light sampling reaches environment from synthetic points only.
        previous_pdf = dr.select(on_synthetic & ~smooth, drawn.pdf, 0.0)
        previous = point
        first = mi.Bool(False)
        depth += 1
        survival = dr.clip(dr.max(throughput), 0.0, self.parameters.envpath_largest_survival)
        survival = dr.select(depth >= self.parameters.envpath_roulette_depth, survival, 1.0)
        active &= sampler.next_1d(active) < survival
        throughput *= dr.rcp(dr.maximum(survival, 1e-6))
        active &= dr.max(throughput) > 0.0
        ray = leave(point, normal, direction)
        return EnvpathPath(
            sampler,
            ray,
            active,
            radiance,
            throughput,
            first,
            covered,
            depth,
            path.cell,
            path.pdf_ratio,
            photograph,
            synthetic_path,
            previous,
            previous_pdf,
        )


def _luminance(color: mi.Color3f) -> mi.Float:
    red, green, blue = (float(weight) for weight in LUMINANCE)
    return red * color.x + green * color.y + blue * color.z
